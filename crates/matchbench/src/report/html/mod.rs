//! One self-contained page: tables, curves and bars, with nothing to fetch.
//!
//! The template escapes every value by itself; only our own drawings, style and script go in as
//! they are. What the page shows is computed here, what it looks like stands in `page.html`,
//! `style.css` and `script.js`.

use minijinja::syntax::SyntaxConfig;
use minijinja::{AutoEscape, Environment, Value, context};

use crate::metrics::{Angle, Summary};

use super::figures::{ap_figure, sp_figure};
use super::folder::RunFacts;
use super::numbers::{NONE, count, interval, milliseconds, ratio};
use super::overview::{Cell, Overview};
use super::svg::{Place, legend_sample};

/// The page as text.
pub(super) fn render(summaries: &[Summary], facts: &RunFacts) -> String {
    let overview = Overview::new(summaries);
    let mut environment = Environment::new();
    let syntax = SyntaxConfig::builder()
        .trim_blocks(true)
        .lstrip_blocks(true)
        .keep_trailing_newline(true)
        .build()
        .expect("the delimiters are the usual ones");
    environment.set_syntax(syntax);
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment
        .add_template("page.html", include_str!("page.html"))
        .expect("the template is ours");
    let template = environment
        .get_template("page.html")
        .expect("it was just added");
    let context = context! {
        title => &facts.title,
        style => include_str!("style.css"),
        script => include_str!("script.js"),
        headline => headline(&overview),
        datasets => overview.datasets.len(),
        pairs => summaries.iter().map(|s| s.pairs).sum::<usize>(),
        results => summaries.len(),
        heads => overview.datasets.iter().map(|name| Value::from(*name)).collect::<Vec<_>>(),
        overview => overview_rows(&overview),
        legend => legend(&overview),
        curves => curves(&overview),
        bars => bars(&overview),
        scores => summaries.iter().map(scores).collect::<Vec<_>>(),
        failures => summaries.iter().map(failures).collect::<Vec<_>>(),
        times => times(summaries),
        has_estimators => summaries.iter().any(|s| !s.estimator.is_empty()),
        facts => (facts.facts.iter())
            .map(|(name, value)| context! { name, value })
            .collect::<Vec<_>>(),
        plan => facts.plan.as_deref(),
    };
    template
        .render(context)
        .expect("the template only uses what it is given")
}

/// Who is best, in a sentence: the matcher that leads on most datasets.
fn headline(overview: &Overview<'_>) -> Option<Value> {
    let wins = |i: usize| {
        let cells = overview.rows[i].cells.iter().flatten();
        cells.filter(|cell| cell.rank == Some(1)).count()
    };
    let most = (0..overview.rows.len())
        .map(wins)
        .max()
        .filter(|&n| n > 0)?;
    let winners: Vec<&str> = (0..overview.rows.len())
        .filter(|&i| wins(i) == most)
        .map(|i| &*overview.rows[i].label)
        .collect();
    let names = match winners.split_last() {
        Some((last, [])) => (*last).to_owned(),
        Some((last, others)) => format!("{} and {last}", others.join(", ")),
        None => return None,
    };
    Some(context! { names, several => winners.len() > 1, most })
}

fn overview_rows(overview: &Overview<'_>) -> Vec<Value> {
    (overview.rows.iter())
        .map(|row| {
            let cells: Vec<Value> = row.cells.iter().map(|c| auc(c.as_ref())).collect();
            context! { label => &row.label, baseline => row.is_baseline, cells }
        })
        .collect()
}

fn auc(cell: Option<&Cell<'_>>) -> Value {
    let Some(cell) = cell else {
        return context! { text => NONE };
    };
    let s = cell.summary;
    let tip = format!(
        "95 %: {}\nrotation {}, translation {}\n{} of {} pairs failed",
        interval(&s.auc, ratio),
        ratio(s.rotation_auc.value),
        ratio(s.translation_auc.value),
        s.failed,
        s.pairs
    );
    context! { text => ratio(s.auc.value), rank => cell.rank, above => cell.above_baseline, tip }
}

fn legend(overview: &Overview<'_>) -> Vec<Value> {
    (overview.rows.iter().enumerate())
        .map(|(i, row)| {
            let sample = Value::from_safe_string(legend_sample(i));
            context! { label => &row.label, sample }
        })
        .collect()
}

fn curves(overview: &Overview<'_>) -> Vec<Value> {
    let panels = [
        ("pose", Angle::Pose),
        ("rotation", Angle::Rotation),
        ("translation", Angle::Translation),
    ];
    (overview.datasets.iter().enumerate())
        .map(|(column, dataset)| {
            let panels: Vec<Value> = panels
                .map(|(name, angle)| {
                    let svg = sp_figure(overview, column, angle, Place::Page);
                    context! { name, svg => Value::from_safe_string(svg) }
                })
                .to_vec();
            context! { dataset => *dataset, panels }
        })
        .collect()
}

fn bars(overview: &Overview<'_>) -> Vec<Value> {
    (overview.datasets.iter().enumerate())
        .map(|(column, dataset)| {
            let svg = Value::from_safe_string(ap_figure(overview, column, Place::Page));
            context! { dataset => *dataset, svg }
        })
        .collect()
}

/// Names of a row, and its numbers as text.
fn row(summary: &Summary, cells: Vec<String>) -> Value {
    context! {
        dataset => &summary.dataset,
        matcher => &summary.matcher,
        estimator => &summary.estimator,
        cells,
    }
}

fn scores(s: &Summary) -> Value {
    let cells = vec![
        ratio(s.auc.value),
        interval(&s.auc, ratio),
        ratio(s.sp.at(5)),
        ratio(s.sp.at(10)),
        ratio(s.rotation_auc.value),
        ratio(s.translation_auc.value),
        count(s.ap5.value),
        interval(&s.ap5, count),
        ratio(s.exact_auc_5),
        ratio(s.exact_auc_10),
        ratio(s.exact_auc_20),
        ratio(s.maa_10),
    ];
    row(s, cells)
}

fn failures(s: &Summary) -> Value {
    let counts = [
        s.pairs,
        s.failed,
        s.failures.too_few_matches,
        s.failures.no_support,
        s.failures.broken,
        s.failures.unexplained,
        s.failures.missing,
        s.undirected,
        s.ignored,
    ];
    row(s, counts.map(|n| n.to_string()).to_vec())
}

/// Medians, for the results that were timed.
fn times(summaries: &[Summary]) -> Vec<Value> {
    (summaries.iter().filter(|s| s.stages.is_timed()))
        .map(|s| {
            let stages = s.stages;
            let times = [
                stages.extract,
                stages.search,
                stages.select,
                stages.estimate,
            ];
            let mut cells = vec![count(stages.features.map(|spread| spread.median))];
            cells.extend(times.map(|time| milliseconds(time.map(|spread| spread.median))));
            row(s, cells)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::summary;
    use super::*;
    use crate::metrics::Spread;

    fn facts(title: &str) -> RunFacts {
        RunFacts {
            title: title.to_owned(),
            facts: vec![("seed".to_owned(), "<7>".to_owned())],
            plan: Some("{\"threads\": 2} </script>".to_owned()),
        }
    }

    #[test]
    fn names_from_data_are_text() {
        let evil = "</script><script>alert(1)</script>";
        let page = render(
            &[summary(evil, evil, 4), summary(evil, "sift", 2)],
            &facts(evil),
        );
        assert!(!page.contains("alert(1)<"), "a name became markup");
        assert_eq!(page.matches("<script>").count(), 1);
        assert_eq!(page.matches("</script>").count(), 1);
    }

    #[test]
    fn page_stands_alone() {
        let page = render(&[summary("room", "sift", 4)], &facts("Report"));
        for outside in ["src=", "href=\"http", "@import", "url(", "fetch(", "<link"] {
            assert!(!page.contains(outside), "{outside}");
        }
        // One panel for the pose, one for each angle, one curve in each.
        assert_eq!(page.matches("class=\"series s0\"").count(), 3);
    }

    #[test]
    fn empty_and_single_reports_can_be_written() {
        assert!(render(&[], &facts("Nothing")).contains("No results"));
        let one = render(&[summary("room", "sift", 4)], &facts("One"));
        assert!(
            !one.contains("NaN") && one == render(&[summary("room", "sift", 4)], &facts("One"))
        );
    }

    #[test]
    fn times_are_shown_where_there_are_any() {
        let mut timed = summary("room", "sift", 4);
        assert!(!render(&[timed.clone()], &facts("")).contains("id=\"times\""));
        timed.stages.search = Some(Spread {
            lower: 0.01,
            median: 0.0213,
            upper: 0.05,
        });
        let page = render(&[timed], &facts(""));
        assert!(page.contains("id=\"times\"") && page.contains("21.3"));
    }
}
