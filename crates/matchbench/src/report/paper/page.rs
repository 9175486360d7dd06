//! The page: tables with the published numbers beside ours, and the figures.

use minijinja::{Environment, Value, context};

use super::figures::PaperFigure;
use super::{NOTHING, RANKS, Sheet, SheetRow};

/// The page as text, which says first what is `lacking`. The template escapes every value.
pub(super) fn render(lacking: Option<&str>, sheets: &[Sheet], figures: &[PaperFigure]) -> String {
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
            let rows: Vec<Value> = sheet.rows.iter().map(line).collect();
            context! {
                name => sheet.name,
                caption => &sheet.caption,
                heads => &sheet.heads,
                notes => &sheet.notes,
                groups,
                under => sheet.under.as_ref().map(line),
                rows,
            }
        })
        .collect();
    let figures: Vec<_> = (figures.iter())
        .map(|figure| context! { name => figure.name, caption => &figure.caption })
        .collect();
    template
        .and_then(|template| template.render(context! { lacking, sheets, figures }))
        .expect("the template only uses what it is given")
}

fn line(row: &SheetRow) -> Value {
    let cells: Vec<Value> = (row.cells.iter())
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
}
