//! A reliability diagram: the share of right poses over the stated probability. On the diagonal the two are
//! equal. The area of a mark is as the number of its poses.

use std::fmt::Write as _;

use super::series::{Legend, open_group, polyline, sized_marker};
use super::{MUTED, Target, axis_label, grid, open, text, tick};
use crate::metrics::Reliability;

const PLOT: f64 = 320.0;
const LEFT: f64 = 54.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 42.0;
/// Radius of the mark of the most poses, and the least radius.
const RADII: (f64, f64) = (6.0, 1.5);
/// Number of parts of both axes.
const TICKS: usize = 5;

/// One figure with one line per `(number of the method in the report, name, reliability)`, in the order of the
/// legend.
pub(in super::super) fn reliability_diagram(
    target: Target,
    title: &str,
    lines: &[&(usize, &str, Reliability)],
) -> String {
    let names = lines.iter().map(|(_, name, _)| *name);
    let legend = Legend::beside(target, LEFT + PLOT, names);
    let top = if target == Target::File { 34.0 } else { 8.0 };
    let height = PLOT.max(legend.height);
    let size = (LEFT + PLOT + RIGHT + legend.width, top + height + BOTTOM);
    let x = |value: f64| LEFT + PLOT * value;
    let y = |value: f64| top + height * (1.0 - value);
    let mut svg = String::new();
    open(&mut svg, target, "chart reliability", size, title);
    let ranges = lines
        .iter()
        .flat_map(|(_, _, reliability)| &reliability.ranges);
    let most = ranges.map(|range| range.poses).max().unwrap_or(1) as f64;
    let radius = |poses: usize| (RADII.0 * (poses as f64 / most).sqrt()).max(RADII.1);
    let step = 1.0 / TICKS as f64;
    for value in (0..=TICKS).map(|i| i as f64 * step) {
        grid(&mut svg, (x(0.0), y(value)), (x(1.0), y(value)));
        let label = tick(value, step);
        text(
            &mut svg,
            "muted",
            (LEFT - 7.0, y(value) + 3.5),
            "end",
            &label,
        );
        text(
            &mut svg,
            "muted",
            (x(value), y(0.0) + 16.0),
            "middle",
            &label,
        );
    }
    let (from, to) = ((x(0.0), y(0.0)), (x(1.0), y(1.0)));
    let _ = writeln!(
        svg,
        r#"<line class="reference" x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}" stroke="{MUTED}" stroke-dasharray="2 3"/>"#,
        from.0, from.1, to.0, to.1
    );
    let below = (x(0.5), y(0.0) + 33.0);
    text(&mut svg, "muted", below, "middle", "stated probability");
    axis_label(&mut svg, y(0.5), "share of right poses");
    // The first line is drawn last, above the others.
    for (row, (series, name, reliability)) in lines.iter().enumerate().rev() {
        let mut tip = (*name).to_owned();
        for range in &reliability.ranges {
            let (stated, right, poses) = (range.stated, range.right, range.poses);
            let _ = write!(tip, "; {stated:.2} stated, {right:.2} right of {poses}");
        }
        let points: Vec<_> = (reliability.ranges.iter())
            .map(|range| (x(range.stated), y(range.right)))
            .collect();
        open_group(&mut svg, target, *series, &tip);
        polyline(&mut svg, *series, &points);
        for (range, &at) in reliability.ranges.iter().zip(&points) {
            sized_marker(&mut svg, *series, at, radius(range.poses));
        }
        if target == Target::File {
            legend.entry(&mut svg, (row, top), *series, (name, ""));
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::super::tests::{are_near, numbers, scale};
    use super::*;
    use crate::metrics::ReliabilityRange;

    #[test]
    fn a_range_is_a_point_at_its_mean() {
        let range = |poses, stated, right| ReliabilityRange {
            poses,
            stated,
            right,
        };
        let reliability = Reliability {
            poses: 50,
            right: 0.5,
            stated: 0.5,
            brier: 0.1,
            calibration_error: 0.1,
            ranges: vec![range(10, 0.25, 0.5), range(40, 0.75, 0.5)],
            no_overlap: 0,
            no_overlap_right: 0,
        };
        let svg = reliability_diagram(Target::Page, "room", &[&(0, "sift", reliability)]);
        assert_eq!(svg.matches("<circle").count(), 2);
        // Four times the poses, four times the area.
        assert!(
            svg.contains(r#"r="3.0""#) && svg.contains(r#"r="6.0""#),
            "{svg}"
        );
        assert!(svg.contains("0.75 stated, 0.50 right of 40"), "{svg}");
        let (x, y) = (
            scale(&svg, "x", "middle", ["0.0", "1.0"]),
            scale(&svg, "y", "end", ["0.0", "1.0"]),
        );
        let marks = numbers(&svg, "<circle", "cx");
        assert!(are_near(&marks, &[x(0.25), x(0.75)]), "{svg}");
        let marks = numbers(&svg, "<circle", "cy");
        assert!(are_near(&marks, &[y(0.5), y(0.5)]), "{svg}");
        assert!(!reliability_diagram(Target::File, "room", &[]).contains("NaN"));
    }
}
