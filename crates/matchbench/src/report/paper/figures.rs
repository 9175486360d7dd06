//! Figures 1 to 3: the sequences, and for each portion the SP curves of its sequences above its AP bars.

use crate::metrics::{Angle, Portion};

use super::super::Content;
use super::super::figures::{ap_panel_figure, sp_figure};
use super::super::latex::sequence_numbers;
use super::super::overview::Overview;
use super::super::svg::{Target, gallery, stack};
use super::published::{SEQUENCES, SHORT};

/// Panels side by side.
const COLUMNS: usize = 2;
/// Pictures of sequences side by side.
const PICTURES: usize = 4;

/// A figure as a drawing.
pub(super) struct PaperFigure {
    /// Name of its files.
    pub(super) name: &'static str,
    pub(super) caption: String,
    pub(super) svg: String,
}

/// The figures for which there are data.
pub(super) fn all(content: &Content) -> Vec<PaperFigure> {
    let overview = in_the_papers_portions(Overview::new(&content.summaries));
    let mut figures = Vec::new();
    if !content.datasets.is_empty() {
        let pictures: Vec<_> = (content.datasets.iter())
            .filter_map(|dataset| Some((&*dataset.name, dataset.thumbnail.as_ref()?)))
            .collect();
        figures.push(PaperFigure {
            name: "figure1",
            caption: "Figure 1: the sequences.".to_owned(),
            svg: gallery(&pictures, PICTURES),
        });
    }
    for (portion, baselines, name, caption) in [
        (
            Portion::Fragments,
            "short baselines",
            "figure2",
            "Figure 2: the short-baseline portion.",
        ),
        (
            Portion::Other,
            "wide baselines",
            "figure3",
            "Figure 3: the wide-baseline portion.",
        ),
    ] {
        let columns =
            (0..overview.datasets.len()).filter(|&column| overview.portions[column] == portion);
        let mut panels: Vec<String> = columns
            .filter_map(|column| sp_figure(&overview, column, Angle::Pose, Target::File))
            .collect();
        if panels.is_empty() {
            continue;
        }
        let mut rows: Vec<Vec<String>> = Vec::new();
        while !panels.is_empty() {
            let rest = panels.split_off(panels.len().min(COLUMNS));
            rows.push(panels);
            panels = rest;
        }
        rows.push(
            ap_panel_figure(&overview, portion, baselines, Target::File)
                .into_iter()
                .collect(),
        );
        figures.push(PaperFigure {
            name,
            caption: format!(
                "{caption} SP curves: the share of pairs below each pose error. AP bars: the mean number of \
                 correspondences of pairs below 5 degrees."
            ),
            svg: stack(&rows),
        });
    }
    figures
}

/// The overview in the order of the paper. A sequence of the paper belongs to the portion that it has in the
/// paper, since the portion cannot be told from a few of its pairs.
fn in_the_papers_portions(mut overview: Overview<'_>) -> Overview<'_> {
    let numbers = sequence_numbers(&overview.datasets);
    for (portion, number) in overview.portions.iter_mut().zip(&numbers) {
        let place = SEQUENCES.iter().position(|known| known.number == number);
        if let Some(place) = place {
            *portion = Portion::ALL[usize::from(place >= SHORT)];
        }
    }
    overview.in_the_papers_order()
}
