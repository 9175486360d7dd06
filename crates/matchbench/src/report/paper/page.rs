//! The page: tables with the published numbers beside ours, and the figures.

use minijinja::{Environment, context};

use super::figures::PaperFigure;
use super::{NOTHING, RANKS, Sheet};

/// The page as text. The template escapes every value.
pub(super) fn render(sheets: &[Sheet], figures: &[PaperFigure]) -> String {
    let mut environment = Environment::new();
    environment
        .add_template("paper.html", include_str!("paper.html"))
        .expect("the template is ours");
    let template = environment.get_template("paper.html");
    let sheets: Vec<_> = (sheets.iter())
        .map(|sheet| {
            let groups: Vec<_> = (sheet.groups.iter())
                .map(|(name, columns)| context! { name, columns })
                .collect();
            let rows: Vec<_> = (sheet.rows.iter())
                .map(|row| {
                    let cells: Vec<_> = (row.cells.iter())
                        .map(|cell| {
                            context! {
                                ours => cell.ours.as_deref().unwrap_or(NOTHING),
                                published => &cell.published,
                                rank => cell.rank.map(|rank| RANKS[usize::from(rank - 1)]),
                                above => cell.is_above,
                            }
                        })
                        .collect();
                    context! { label => &row.label, baseline => row.is_baseline, cells }
                })
                .collect();
            context! {
                name => sheet.name,
                caption => &sheet.caption,
                heads => &sheet.heads,
                notes => &sheet.notes,
                groups,
                rows,
            }
        })
        .collect();
    let figures: Vec<_> = (figures.iter())
        .map(|figure| context! { name => figure.name, caption => &figure.caption })
        .collect();
    template
        .and_then(|template| template.render(context! { sheets, figures }))
        .expect("the template only uses what it is given")
}
