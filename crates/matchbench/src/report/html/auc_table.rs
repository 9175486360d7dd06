//! The AUC table at the top of the page: methods are rows, datasets are columns.

use std::fmt::Write as _;

use minijinja::{Value, context};

use crate::counted::counted;
use crate::metrics::{Angle, Model};

use super::super::content::Content;
use super::super::numbers::{NONE, bracketed, interval, ratio};
use super::super::overview::{Cell, Overview};

/// One row per method, with the AUC of `angle` on each dataset.
pub(super) fn rows(content: &Content, overview: &Overview<'_>, angle: Angle) -> Vec<Value> {
    (overview.rows.iter())
        .map(|row| {
            let cells: Vec<Value> = row.cells.iter().map(|c| auc(c.as_ref(), angle)).collect();
            let mean = (row.cells.len() > 1).then(|| ratio(row.mean()));
            let outside = content.outside.get(row.matcher);
            context! { label => &row.label, outside, cells, mean }
        })
        .collect()
}

fn auc(cell: Option<&Cell<'_>>, angle: Angle) -> Value {
    let Some(cell) = cell else {
        return context! { text => NONE };
    };
    let s = cell.summary;
    let mut tip = format!("95 %: {}", interval(&cell.auc, ratio));
    if angle == Angle::Pose {
        if s.model == Model::Pose {
            let of = |angle| ratio(s.auc_of(angle).value);
            let (rotation, translation) = (of(Angle::Rotation), of(Angle::Translation));
            let _ = write!(tip, "\nrotation {rotation}, translation {translation}");
        }
        let _ = write!(tip, "\n{} of {} failed", s.failed, counted(s.pairs, "pair"));
    }
    if s.lacking > 0 {
        let lacking = counted(s.lacking, "result");
        let _ = write!(
            tip,
            "\nnot ranked: {lacking} that others have are not recorded"
        );
    }
    let group = (angle == Angle::Pose).then_some(&*s.group);
    context! {
        text => ratio(cell.auc.value),
        rank => cell.rank,
        above => cell.above_baseline,
        group,
        // Of a run that is not finished, so that nobody takes it for the score of all.
        part => (s.lacking > 0).then(|| format!("{} of {}", s.pairs, s.pairs + s.lacking)),
        interval => bracketed(&cell.auc).trim_start(),
        tip,
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::{content, homographies};
    use super::super::render;

    #[test]
    fn homographies_are_called_so_and_have_no_rotation() {
        let mut content = content(&[("room", "sift", 4)]);
        content.summaries.push(homographies("boat", "sift"));
        let both = render(&content);
        assert!(both.contains("true pose or homography, from 0 to 1; of homographies the AUC is"));
        assert!(both.contains(">Rotation<"));
        let of_figures = "where a dataset has both, only poses are drawn";
        assert!(both.contains(of_figures));
        content.summaries.remove(0);
        let alone = render(&content);
        assert!(alone.contains("true homography, from 0 to 1") && !alone.contains(">Rotation<"));
        assert_eq!(alone.matches("overview sortable").count(), 1);
        assert!(!alone.contains(of_figures));
    }

    #[test]
    fn intervals_stand_in_the_cells() {
        let content = content(&[("room", "sift", 6)]);
        let interval = (content.summaries[0].auc().interval).expect("enough images");
        let shown = format!(
            "quiet\">[{:.3}, {:.3}]</small></td>",
            interval.low, interval.high
        );
        let page = render(&content);
        assert!(
            page.contains("id=\"intervals\"") && page.contains(&shown),
            "{shown}"
        );
    }

    #[test]
    fn a_method_that_lacks_results_is_marked_and_not_ranked() {
        let mut content = content(&[("room", "sift", 6), ("room", "orb", 8)]);
        content.summaries[1].lacking = 5;
        let page = render(&content);
        let pairs = content.summaries[1].pairs;
        let part = format!(
            "0.800<small class=\"part quiet\">{pairs} of {}</small>",
            pairs + 5
        );
        assert!(page.contains(&part), "{part}");
        assert!(!page.contains("aria-label=\"rank 1\""));
    }
}
