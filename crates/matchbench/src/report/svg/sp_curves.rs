//! SP curves: success ratio over the pose error that is allowed.

use std::fmt::Write as _;

use crate::metrics::{SuccessCurve, THRESHOLDS};

use super::super::numbers::ratio;
use super::series::{Legend, marker, polyline};
use super::{COLOURS, Target, axis, axis_label, escape, grid, open, text, tick};

/// Size of the plot itself and its place in the figure, in user units.
const PLOT: (f64, f64) = (350.0, 210.0);
const LEFT: f64 = 54.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 40.0;

/// One figure with one curve per `(number of the matcher in the report, name, curve)`, in the order
/// of the legend. Curves without values (no pairs) are left out.
pub(in super::super) fn sp_curves(
    target: Target,
    title: &str,
    curves: &[(usize, &str, &SuccessCurve)],
) -> String {
    let curves: Vec<_> = (curves.iter())
        .filter(|(_, _, curve)| curve.pairs > 0)
        .collect();
    let legend = match target {
        Target::File => Legend::beside(LEFT + PLOT.0, curves.iter().map(|(_, name, _)| *name)),
        Target::Page => Legend::NONE,
    };
    let top = if target == Target::File { 34.0 } else { 8.0 };
    let width = LEFT + PLOT.0 + RIGHT + legend.width;
    // A long legend makes the figure higher.
    let plot = (PLOT.0, PLOT.1.max(legend.height));
    let height = top + plot.1 + BOTTOM;
    let max = (curves.iter()).fold(0.0_f64, |max, (_, _, curve)| max.max(curve.at(15)));
    let (step, end) = axis(max);
    let x = |k: usize| LEFT + plot.0 * (k - 1) as f64 / 14.0;
    let y = |share: f64| top + plot.1 * (1.0 - share / end);

    let mut svg = String::new();
    open(&mut svg, target, "chart sp", (width, height), title);
    let ticks = (end / step).round() as usize;
    for value in (0..=ticks).map(|i| i as f64 * step) {
        grid(&mut svg, (x(1), y(value)), (x(15), y(value)));
        let at = (LEFT - 7.0, y(value) + 3.5);
        text(&mut svg, "muted", at, "end", &tick(value, step));
    }
    for k in [1, 3, 5, 7, 9, 11, 13, 15] {
        let at = (x(k), top + plot.1 + 16.0);
        text(&mut svg, "muted", at, "middle", &k.to_string());
    }
    let at = (LEFT + plot.0 / 2.0, top + plot.1 + 32.0);
    text(&mut svg, "muted", at, "middle", "error threshold (degrees)");
    axis_label(&mut svg, top + plot.1 / 2.0, "success ratio");
    if target == Target::Page {
        let _ = writeln!(
            svg,
            r#"<line class="cursor" x1="0" x2="0" y1="{:.1}" y2="{:.1}" data-x1="{:.1}" data-x15="{:.1}" visibility="hidden"/>"#,
            top,
            top + plot.1,
            x(1),
            x(15)
        );
    }
    // The first lies above the others.
    for (row, (series, name, curve)) in curves.into_iter().enumerate().rev() {
        let points: Vec<(f64, f64)> = THRESHOLDS.map(|k| (x(k), y(curve.at(k)))).collect();
        open_series(&mut svg, target, *series, name, curve);
        polyline(&mut svg, *series, &points);
        // Every third point, not the same of neighbouring matchers: markers seldom cover another.
        for &(px, py) in points.iter().skip(series % 3).step_by(3) {
            marker(&mut svg, *series, px, py);
        }
        if target == Target::File {
            legend.entry(&mut svg, (row, top), *series, (name, &ratio(curve.auc())));
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// Opens the group of a matcher. In the page it carries its values, which the script shows on
/// hover; in a file the name is its tooltip.
fn open_series(svg: &mut String, target: Target, series: usize, name: &str, curve: &SuccessCurve) {
    let class = series % COLOURS;
    let name = escape(name);
    match target {
        Target::Page => {
            let values = curve.values().map(|value| format!("{value:.3}")).join(" ");
            let _ = writeln!(
                svg,
                r#"<g class="series s{class}" data-series="{series}" data-name="{name}" data-values="{values}">"#
            );
        }
        Target::File => {
            let _ = writeln!(svg, r#"<g class="series s{class}"><title>{name}</title>"#);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(right: usize, pairs: usize) -> SuccessCurve {
        SuccessCurve {
            below: [right; 15],
            pairs,
        }
    }

    #[test]
    fn figure_is_the_same_every_time_and_names_are_text() {
        let curves = [
            (0, "sift", &curve(5, 10)),
            (9, "</g><script>", &curve(2, 10)),
        ];
        let draw = |target| sp_curves(target, "<room>", &curves);
        for target in [Target::File, Target::Page] {
            let svg = draw(target);
            assert_eq!(svg, draw(target));
            assert!(!svg.contains("<script>") && !svg.contains("<room>"));
            assert_eq!(svg.matches("<g ").count(), 2);
            assert_eq!(svg.matches("</g>").count(), 2);
        }
        assert!(draw(Target::Page).contains("stroke-dasharray"));
    }

    #[test]
    fn curves_without_values_are_left_out() {
        let svg = sp_curves(Target::File, "room", &[(0, "sift", &curve(0, 0))]);
        assert!(!svg.contains("NaN") && !svg.contains("<g"));
    }

    #[test]
    fn a_long_legend_makes_the_figure_higher() {
        let flat = curve(1, 10);
        let many: Vec<_> = (0..30).map(|i| (i, "matcher", &flat)).collect();
        let svg = sp_curves(Target::File, "room", &many);
        assert!(svg.contains(r#"height="554""#), "{}", &svg[..120]);
        assert!(
            svg.contains(">0.100</text>"),
            "the AUC stands beside the name"
        );
    }
}
