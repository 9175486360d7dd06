//! AP bars: the mean number of matches over the pairs that are solved.

use std::fmt::Write as _;

use crate::metrics::Score;

use super::super::numbers::{count, interval};
use super::{COLOURS, INK, PALETTE, Target, axis, escape, open, shorten, text, width_of};

/// Room beside the names.
const MARGIN: f64 = 14.0;
const BAR: f64 = 210.0;
const RIGHT: f64 = 68.0;
const LINE: f64 = 19.0;

/// One bar per `(number of the matcher in the report, name, AP)`, with a whisker for its interval.
pub(in super::super) fn ap_bars(
    target: Target,
    title: &str,
    bars: &[(usize, &str, Score)],
) -> String {
    let top = match target {
        Target::File => 30.0,
        Target::Page => 2.0,
    };
    let left = MARGIN + width_of(bars.iter().map(|(_, name, _)| *name));
    let width = left + BAR + RIGHT;
    let max = bars.iter().fold(0.0_f64, |max, (_, _, ap)| {
        let high = ap.interval.map_or(0.0, |interval| interval.high);
        max.max(ap.value.unwrap_or(0.0)).max(high)
    });
    let (_, end) = axis(max);
    let x = |value: f64| left + BAR * value / end;

    let mut svg = String::new();
    let height = top + bars.len() as f64 * LINE + 6.0;
    open(&mut svg, target, "chart ap", (width, height), title);
    for (row, (series, name, ap)) in bars.iter().enumerate() {
        let middle = top + (row as f64 + 0.5) * LINE;
        let (class, colour) = (series % COLOURS, PALETTE[series % COLOURS]);
        let _ = writeln!(
            svg,
            r#"<g class="bar s{class}"><title>{}: {}{}</title>"#,
            escape(name),
            count(ap.value),
            match ap.interval {
                Some(_) => format!(" (95 %: {})", interval(ap, count)),
                None => String::new(),
            }
        );
        text(
            &mut svg,
            "ink",
            (left - 7.0, middle + 4.0),
            "end",
            &shorten(name),
        );
        let mut label = x(0.0);
        if let Some(value) = ap.value {
            let _ = writeln!(
                svg,
                r#"<rect class="fill" fill="{colour}" x="{:.1}" y="{:.1}" width="{:.1}" height="{:.1}"/>"#,
                x(0.0),
                middle - LINE * 0.36,
                x(value) - x(0.0),
                LINE * 0.72
            );
            label = x(value);
        }
        if let Some(range) = ap.interval {
            let _ = writeln!(
                svg,
                r#"<path class="whisker" fill="none" stroke="{INK}" d="M{:.1} {middle:.1}H{:.1}M{1:.1} {2:.1}v6M{0:.1} {2:.1}v6"/>"#,
                x(range.low),
                x(range.high),
                middle - 3.0
            );
            label = label.max(x(range.high));
        }
        let value = count(ap.value);
        text(
            &mut svg,
            "muted",
            (label + 7.0, middle + 4.0),
            "start",
            &value,
        );
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::super::tests::{are_near, numbers};
    use super::*;
    use crate::metrics::Interval;

    #[test]
    fn bars_have_the_length_of_their_value() {
        let bars = [
            (
                0,
                "sift",
                Score {
                    value: Some(1000.0),
                    interval: Some(Interval {
                        low: 900.0,
                        high: 1000.0,
                    }),
                },
            ),
            (
                1,
                "orb",
                Score {
                    value: None,
                    interval: None,
                },
            ),
        ];
        let svg = ap_bars(Target::File, "room", &bars);
        // The axis ends at 1000, so the first bar fills it; the second has none.
        assert!(svg.contains(r#"width="210.0""#), "{svg}");
        assert_eq!(svg.matches("class=\"fill\"").count(), 1);
        assert_eq!(svg.matches("class=\"whisker\"").count(), 1);
        assert!(svg.contains("<title>sift: 1000.0 (95 %: 900.0 to 1000.0)</title>"));
        assert!(svg.contains(">–</text>"));
    }

    #[test]
    fn whiskers_reach_from_end_to_end_of_the_interval() {
        let score = |value, [low, high]: [f64; 2]| Score {
            value: Some(value),
            interval: Some(Interval { low, high }),
        };
        let bars = [
            (0, "sift", score(400.0, [300.0, 500.0])),
            (1, "orb", score(900.0, [800.0, 1000.0])),
        ];
        let svg = ap_bars(Target::Page, "room", &bars);
        // 210 for 1000.
        assert!(
            are_near(&numbers(&svg, "<rect", "width"), &[84.0, 189.0]),
            "{svg}"
        );
        let left = numbers(&svg, "<rect", "x");
        let ends: Vec<f64> = (svg.lines().filter(|line| line.contains("whisker")))
            .zip(left)
            .flat_map(|(line, left)| {
                let (_, path) = line.split_once(" d=\"M").expect("a path");
                let (from, rest) = path.split_once(' ').expect("its begin");
                let (_, rest) = rest.split_once('H').expect("a line");
                let (to, _) = rest.split_once('M').expect("its ends");
                [from, to].map(|x| x.parse::<f64>().expect("a number") - left)
            })
            .collect();
        assert!(are_near(&ends, &[63.0, 105.0, 168.0, 210.0]), "{svg}");
    }
}
