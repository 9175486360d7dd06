//! Matchers by estimators: the score as a number on a coloured cell.

use std::fmt::Write as _;

use super::super::numbers::ratio;
use super::{Target, escape, open, shorten, text, width_of};

/// Room beside the names.
const MARGIN: f64 = 16.0;
const CELL: (f64, f64) = (92.0, 26.0);
const HEAD: f64 = 24.0;
/// The ends and the middle of the colour scale. It goes from light to dark in one hue, so that it can also be
/// read in grey and with any colour vision.
const SCALE: [[f64; 3]; 3] = [
    [244.0, 247.0, 251.0],
    [107.0, 174.0, 214.0],
    [8.0, 64.0, 129.0],
];

/// One row per matcher, one column per estimator; `None` if the two were not run together. The colours span the
/// values that are present.
pub(in super::super) fn heat_map(
    target: Target,
    title: &str,
    matchers: &[&str],
    estimators: &[&str],
    cells: &[Vec<Option<f64>>],
) -> String {
    let top = match target {
        Target::File => 30.0,
        Target::Page => 2.0,
    };
    let values = || cells.iter().flatten().flatten().copied();
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let left = MARGIN + width_of(matchers.iter().copied());
    let size = (
        left + CELL.0 * estimators.len() as f64 + 8.0,
        top + HEAD + CELL.1 * matchers.len() as f64 + 8.0,
    );
    let mut svg = String::new();
    open(&mut svg, target, "chart heat", size, title);
    for (column, estimator) in estimators.iter().enumerate() {
        let at = (left + CELL.0 * (column as f64 + 0.5), top + 16.0);
        text(&mut svg, "muted", at, "middle", &shorten(estimator));
    }
    for (row, (matcher, cells)) in matchers.iter().zip(cells).enumerate() {
        let y = top + HEAD + CELL.1 * row as f64;
        let at = (left - 8.0, y + CELL.1 / 2.0 + 4.0);
        text(&mut svg, "ink", at, "end", &shorten(matcher));
        for (column, (estimator, value)) in estimators.iter().zip(cells).enumerate() {
            let Some(value) = *value else { continue };
            let x = left + CELL.0 * column as f64;
            let share = if high > low {
                (value - low) / (high - low)
            } else {
                0.5
            };
            let _ = writeln!(
                svg,
                r#"<g><title>{} with {}: {}</title><rect x="{:.1}" y="{:.1}" width="{:.1}" height="{:.1}" rx="2" fill="{}"/>"#,
                escape(matcher),
                escape(estimator),
                ratio(value),
                x + 1.0,
                y + 1.0,
                CELL.0 - 2.0,
                CELL.1 - 2.0,
                colour(share),
            );
            let ink = if share > 0.55 { "#ffffff" } else { "#1d2127" };
            let _ = writeln!(
                svg,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="middle" font-size="12" fill="{ink}">{}</text></g>"#,
                x + CELL.0 / 2.0,
                y + CELL.1 / 2.0 + 4.0,
                ratio(value)
            );
        }
    }
    svg.push_str("</svg>\n");
    svg
}

fn colour(share: f64) -> String {
    let (from, to, share) = if share < 0.5 {
        (SCALE[0], SCALE[1], share * 2.0)
    } else {
        (SCALE[1], SCALE[2], share * 2.0 - 1.0)
    };
    let mix = |i: usize| (from[i] + (to[i] - from[i]) * share).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn best_is_darkest_and_what_was_not_run_is_empty() {
        let cells = [vec![Some(0.2), Some(0.8)], vec![None, Some(0.5)]];
        let svg = heat_map(
            Target::File,
            "<room>",
            &["sift", "orb"],
            &["ransac-e", "usac"],
            &cells,
        );
        // The background and three cells.
        assert_eq!(svg.matches("<rect").count(), 4);
        for (cell, colour) in [
            ("sift with ransac-e: 0.200", "#f4f7fb"),
            ("sift with usac: 0.800", "#084081"),
            ("orb with usac: 0.500", "#6baed6"),
        ] {
            let its = svg.lines().find(|line| line.contains(cell));
            assert!(its.expect(cell).contains(colour), "{svg}");
        }
        assert!(!svg.contains("<room>"));
        let alone = heat_map(Target::Page, "", &["sift"], &["x"], &[vec![Some(0.3)]]);
        assert!(!alone.contains("NaN"));
    }
}
