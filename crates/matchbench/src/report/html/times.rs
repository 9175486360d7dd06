//! The paper's table of times.

use minijinja::{Value, context};

use crate::metrics::{Quartiles, Summary};

use super::super::content::Content;
use super::super::figures::{seconds_for_a_pair, stages_of};
use super::super::numbers::{milliseconds, whole};
use super::super::overview::{Overview, REFERENCE};

/// One table for each dataset: a matcher a row, medians, quartiles behind
/// them. Estimators share all stages but their own.
pub(super) fn times(content: &Content, overview: &Overview<'_>) -> Vec<Value> {
    let table = |dataset: &str| {
        let here: Vec<&Summary> = (content.summaries.iter())
            .filter(|s| s.dataset == dataset && stages_of(content, s).is_timed())
            .collect();
        let mut estimators: Vec<&str> = Vec::new();
        let mut matchers: Vec<&Summary> = Vec::new();
        for &s in &here {
            if !estimators.contains(&&*s.estimator) {
                estimators.push(&s.estimator);
            }
            if !matchers.iter().any(|other| other.matcher == s.matcher) {
                matchers.push(s);
            }
        }
        estimators.sort_by_key(|id| *id != REFERENCE);
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

/// A matcher, and its poses by each of the estimators.
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
    let poses_in = poses.iter().map(|own| own.and_then(|s| s.stages.estimate));
    cells.extend(poses_in.map(|pose| quartiles(pose, milliseconds)));
    if let [Some(only)] = poses {
        cells.push(context! { text => milliseconds(seconds_for_a_pair(content, only)) });
    }
    context! { matcher => &first.matcher, cells }
}
