//! A score over difficulty: the AUC of the pairs in each range of baseline or overlap.

use std::fmt::Write as _;

use super::super::numbers::ratio;
use super::series::{Legend, marked_line};
use super::{Target, axis, axis_label, escape, grid, open, text, tick};

const PLOT: (f64, f64) = (350.0, 190.0);
const LEFT: f64 = 54.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 42.0;

/// One figure with one line per `(number of the matcher in the report, name, value per range)`;
/// `ranges` are the labels below. The lines come in the order of the legend. `most` is the largest value of all figures
/// that stand beside this one, and so have the same axis.
pub(in super::super) fn strata_curves(
    target: Target,
    title: &str,
    (what, ranges): (&str, &[String]),
    lines: &[(usize, &str, Vec<Option<f64>>)],
    most: f64,
) -> String {
    let names = lines.iter().map(|(_, name, _)| *name);
    let legend = Legend::beside(target, LEFT + PLOT.0, names);
    let top = if target == Target::File { 34.0 } else { 8.0 };
    let plot = (PLOT.0, PLOT.1.max(legend.height));
    let size = (LEFT + plot.0 + RIGHT + legend.width, top + plot.1 + BOTTOM);
    let (step, end) = axis(most);
    let x = |range: usize| LEFT + plot.0 * (range as f64 + 0.5) / ranges.len().max(1) as f64;
    let y = |value: f64| top + plot.1 * (1.0 - value / end);

    let mut svg = String::new();
    open(&mut svg, target, "chart strata", size, title);
    for value in (0..=(end / step).round() as usize).map(|i| i as f64 * step) {
        grid(&mut svg, (LEFT, y(value)), (LEFT + plot.0, y(value)));
        let at = (LEFT - 7.0, y(value) + 3.5);
        text(&mut svg, "muted", at, "end", &tick(value, step));
    }
    for (i, range) in ranges.iter().enumerate() {
        let at = (x(i), top + plot.1 + 16.0);
        text(&mut svg, "muted", at, "middle", &escape(range));
    }
    let at = (LEFT + plot.0 / 2.0, top + plot.1 + 33.0);
    text(&mut svg, "muted", at, "middle", &escape(what));
    axis_label(&mut svg, top + plot.1 / 2.0, "AUC");
    // The first line is drawn last, above the others.
    for (row, (series, name, values)) in lines.iter().enumerate().rev() {
        let mut tip = (*name).to_owned();
        for (range, value) in ranges.iter().zip(values) {
            let _ = write!(tip, "; {range}: {}", ratio(*value));
        }
        let points: Vec<_> = (values.iter().enumerate())
            .filter_map(|(i, value)| Some((x(i), y((*value)?))))
            .collect();
        marked_line(
            &mut svg,
            target,
            (*series, name, &tip),
            &points,
            (&legend, row, top),
        );
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::super::tests::{are_near, numbers, scale};
    use super::*;

    #[test]
    fn ranges_without_pairs_are_skipped() {
        let ranges = ["<1".to_owned(), "1 to 2".to_owned()];
        let lines = [
            (0, "sift", vec![Some(0.5), None]),
            (3, "orb", vec![None, None]),
        ];
        let svg = strata_curves(Target::Page, "room", ("baseline", &ranges), &lines, 0.5);
        assert_eq!(svg.matches("<circle").count(), 1);
        assert!(svg.contains("sift; &lt;1: 0.500; 1 to 2: –"), "{svg}");
        assert!(!svg.contains("NaN"));
        let y = scale(&svg, "y", "end", ["0.0", "0.5"]);
        assert!(
            are_near(&numbers(&svg, "<circle", "cy"), &[y(0.5)]),
            "{svg}"
        );
        let lower = [(0, "sift", vec![Some(0.1), Some(0.3)])];
        let svg = strata_curves(Target::Page, "room", ("baseline", &ranges), &lower, 0.4);
        let y = scale(&svg, "y", "end", ["0.0", "0.4"]);
        assert!(
            are_near(&numbers(&svg, "<circle", "cy"), &[y(0.1), y(0.3)]),
            "{svg}"
        );
        assert!(!strata_curves(Target::File, "room", ("", &[]), &[], 0.0).contains("NaN"));
    }
}
