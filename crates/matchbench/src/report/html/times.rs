//! The paper's table of times.

use minijinja::{Value, context};

use crate::metrics::{Quartiles, Summary};

use super::super::content::Content;
use super::super::numbers::{milliseconds, whole};
use super::super::overview::Overview;
use super::super::pair_time::{seconds_for_a_pair, stages_of};

/// One table for each dataset: one row per matcher, with medians and then quartiles. Estimators share all
/// stages except their own.
pub(super) fn times(content: &Content, overview: &Overview<'_>) -> Vec<Value> {
    let table = |dataset: &str| {
        let here: Vec<&Summary> = (content.summaries.iter())
            .filter(|s| s.dataset == dataset && stages_of(content, s).is_timed())
            .collect();
        let timed_by = |estimator: &&&str| here.iter().any(|s| s.estimator == **estimator);
        let estimators: Vec<&str> =
            (overview.estimators.iter().filter(timed_by).copied()).collect();
        let mut matchers: Vec<&Summary> = Vec::new();
        for &s in &here {
            if !matchers.iter().any(|other| other.matcher == s.matcher) {
                matchers.push(s);
            }
        }
        let rows: Vec<Value> = (matchers.iter())
            .map(|first| {
                let own = |estimator: &&str| {
                    let its =
                        |s: &&&Summary| s.matcher == first.matcher && s.estimator == *estimator;
                    here.iter().find(its).copied()
                };
                let poses: Vec<_> = estimators.iter().map(own).collect();
                time_row(content, first, &poses)
            })
            .collect();
        let heads: Vec<String> = match &estimators[..] {
            [_] => vec!["Pose".to_owned()],
            several => several.iter().map(|name| format!("Pose: {name}")).collect(),
        };
        context! { dataset, heads, rows }
    };
    let timed = |table: &Value| {
        table
            .get_attr("rows")
            .is_ok_and(|rows| rows.len() > Some(0))
    };
    (overview.datasets.iter().map(|dataset| table(dataset)))
        .filter(timed)
        .collect()
}

/// A matcher with its times, and the times of the poses by each of the estimators.
fn time_row(content: &Content, first: &Summary, poses: &[Option<&Summary>]) -> Value {
    let quartiles = |spread: Option<Quartiles>, number: fn(Option<f64>) -> String| {
        let tip = spread.map(|spread| {
            format!(
                "quartiles: {} to {}",
                number(Some(spread.lower)),
                number(Some(spread.upper))
            )
        });
        context! { text => number(spread.map(|spread| spread.median)), tip }
    };
    let stages = stages_of(content, first);
    let mut cells = vec![quartiles(stages.features, whole)];
    cells.extend(
        [stages.extract, stages.search, stages.select].map(|time| quartiles(time, milliseconds)),
    );
    if !content.outside.is_empty() {
        cells.push(quartiles(stages.outside, milliseconds));
    }
    let poses_in = poses.iter().map(|own| own.and_then(|s| s.stages.estimate));
    cells.extend(poses_in.map(|pose| quartiles(pose, milliseconds)));
    if let [Some(only)] = poses {
        cells.push(context! { text => milliseconds(seconds_for_a_pair(content, only)) });
    }
    let outside = content.outside.get(&first.matcher);
    context! { matcher => &first.matcher, outside, cells }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::content;
    use super::super::render;
    use super::*;

    #[test]
    fn what_is_not_built_in_is_marked_in_every_table_of_methods() {
        let mut content = content(&[("room", "mine", 4), ("room", "orb", 2)]);
        assert!(!render(&content).contains("Waited"));
        content.summaries[0].stages.outside = Quartiles::of([1.5]);
        content.summaries[0].stages.search = Quartiles::of([1.25]);
        let words = "from outside, cuda, 1024 pixels";
        content.outside.insert("mine".into(), words.into());
        let page = render(&content);
        let mark = format!("mine<small class=\"quiet\">{words}</small>");
        // One table of AUC for each angle, and that of times.
        assert_eq!(page.matches(&mark).count(), 4);
        assert!(page.contains("Waited") && page.contains("its pairs took as seen from here"));
        assert!(
            page.contains(">1500") && page.contains(">1250"),
            "milliseconds"
        );
    }
}
