//! A score over difficulty: AUC of the pairs in each range of baseline or overlap.

use std::fmt::Write as _;

use super::super::numbers::ratio;
use super::series::{marker, open_group, polyline, sample};
use super::{Place, axis, escape, grid, open, text, tick};

const PLOT: (f64, f64) = (350.0, 190.0);
const LEFT: f64 = 44.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 42.0;
const LEGEND: f64 = 150.0;
const LINE: f64 = 16.0;

/// One figure with one line per `(number of the matcher in the report, name, value per range)`;
/// `ranges` are the labels below.
pub(in super::super) fn strata_curves(
    place: Place,
    title: &str,
    (what, ranges): (&str, &[String]),
    lines: &[(usize, &str, Vec<Option<f64>>)],
) -> String {
    let (top, legend) = match place {
        Place::File => (34.0, LEGEND),
        Place::Page => (8.0, 0.0),
    };
    let names = if legend > 0.0 {
        lines.len() as f64 * LINE
    } else {
        0.0
    };
    let size = (
        LEFT + PLOT.0 + RIGHT + legend,
        top + PLOT.1.max(names) + BOTTOM,
    );
    let values = || {
        lines
            .iter()
            .flat_map(|(_, _, values)| values.iter().flatten())
    };
    let (step, end) = axis(values().fold(0.0_f64, |max, &value| max.max(value)));
    let x = |range: usize| LEFT + PLOT.0 * (range as f64 + 0.5) / ranges.len().max(1) as f64;
    let y = |value: f64| top + PLOT.1 * (1.0 - value / end);

    let mut svg = String::new();
    open(&mut svg, place, "chart strata", size, title);
    for value in (0..=(end / step).round() as usize).map(|i| i as f64 * step) {
        grid(&mut svg, (LEFT, y(value)), (LEFT + PLOT.0, y(value)));
        let at = (LEFT - 7.0, y(value) + 3.5);
        text(&mut svg, "muted", at, "end", &tick(value, step));
    }
    for (i, range) in ranges.iter().enumerate() {
        let at = (x(i), top + PLOT.1 + 16.0);
        text(&mut svg, "muted", at, "middle", &escape(range));
    }
    let at = (LEFT + PLOT.0 / 2.0, top + PLOT.1 + 33.0);
    text(&mut svg, "muted", at, "middle", &escape(what));
    for (row, (series, name, values)) in lines.iter().enumerate() {
        let mut tip = (*name).to_owned();
        for (range, value) in ranges.iter().zip(values) {
            let _ = write!(tip, "; {range}: {}", ratio(*value));
        }
        open_group(&mut svg, place, *series, &tip);
        let points: Vec<_> = (values.iter().enumerate())
            .filter_map(|(i, value)| Some((x(i), y((*value)?))))
            .collect();
        polyline(&mut svg, *series, &points);
        for &(px, py) in &points {
            marker(&mut svg, *series, px, py);
        }
        if place == Place::File {
            let (left, middle) = (LEFT + PLOT.0 + 24.0, top + 8.0 + row as f64 * LINE);
            sample(&mut svg, *series, left, middle);
            let at = (left + 32.0, middle + 4.0);
            text(&mut svg, "ink", at, "start", &escape(name));
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_without_pairs_are_skipped() {
        let ranges = ["<1".to_owned(), "1 to 2".to_owned()];
        let lines = [
            (0, "sift", vec![Some(0.5), None]),
            (3, "orb", vec![None, None]),
        ];
        let svg = strata_curves(Place::Page, "room", ("baseline", &ranges), &lines);
        assert_eq!(svg.matches("<circle").count(), 1);
        assert!(svg.contains("sift; &lt;1: 0.500; 1 to 2: –"), "{svg}");
        assert!(!svg.contains("NaN"));
        assert!(!strata_curves(Place::File, "room", ("", &[]), &[]).contains("NaN"));
    }
}
