//! Accuracy against time: the trade-off that the paper argues in words. Up and to the left is better.

use std::fmt::Write as _;

use crate::metrics::Score;

use super::super::numbers::{duration, interval, ratio};
use super::series::{marker, open_group};
use super::{NAME, Place, axis, grid, open, shorten, text, tick};

const PLOT: (f64, f64) = (350.0, 210.0);
const LEFT: f64 = 44.0;
const RIGHT: f64 = 20.0;
const BOTTOM: f64 = 40.0;

/// One matcher in the figure.
pub(in super::super) struct Dot<'a> {
    /// Number of the matcher in the report.
    pub(in super::super) series: usize,
    pub(in super::super) name: &'a str,
    /// Seconds for a pair.
    pub(in super::super) seconds: f64,
    pub(in super::super) auc: Score,
}

/// AUC over the time for a pair, which is drawn on a logarithmic axis.
pub(in super::super) fn scatter(place: Place, title: &str, dots: &[Dot<'_>]) -> String {
    let top = match place {
        Place::File => 34.0,
        Place::Page => 8.0,
    };
    let dots: Vec<(&Dot<'_>, f64)> = (dots.iter())
        .filter(|dot| dot.seconds > 0.0)
        .filter_map(|dot| Some((dot, dot.auc.value?)))
        .collect();
    let logarithms = || dots.iter().map(|(dot, _)| libm::log10(dot.seconds));
    let first = logarithms().fold(f64::INFINITY, f64::min).min(3.0).floor();
    let last = logarithms().fold(first + 1.0, f64::max).ceil();
    let ends = |dot: &Dot<'_>, auc: f64| {
        dot.auc
            .interval
            .map_or((auc, auc), |interval| (interval.low, interval.high))
    };
    let high = dots
        .iter()
        .fold(0.0_f64, |high, (dot, auc)| high.max(ends(dot, *auc).1));
    let low = dots
        .iter()
        .fold(high, |low, (dot, auc)| low.min(ends(dot, *auc).0));
    // The lower end is 0 unless all values lie close together.
    let (step, end) = if low > high / 2.0 {
        axis(high - low)
    } else {
        axis(high)
    };
    let (bottom, end) = if low > high / 2.0 {
        (
            (low / step + 1e-9).floor() * step,
            (high / step - 1e-9).ceil() * step,
        )
    } else {
        (0.0, end)
    };
    let end = end.max(bottom + step);
    let x = |seconds: f64| LEFT + PLOT.0 * (libm::log10(seconds) - first) / (last - first);
    let y = |value: f64| top + PLOT.1 * (1.0 - (value - bottom) / (end - bottom));

    let mut svg = String::new();
    let size = (LEFT + PLOT.0 + RIGHT, top + PLOT.1 + BOTTOM);
    open(&mut svg, place, "chart scatter", size, title);
    for value in (0..=((end - bottom) / step).round() as usize).map(|i| bottom + i as f64 * step) {
        grid(&mut svg, (LEFT, y(value)), (LEFT + PLOT.0, y(value)));
        let at = (LEFT - 7.0, y(value) + 3.5);
        text(&mut svg, "muted", at, "end", &tick(value, step));
    }
    for decade in first as i32..=last as i32 {
        let seconds = libm::exp10(f64::from(decade));
        grid(&mut svg, (x(seconds), top), (x(seconds), top + PLOT.1));
        let at = (x(seconds), top + PLOT.1 + 16.0);
        text(&mut svg, "muted", at, "middle", &duration(seconds));
    }
    let at = (LEFT + PLOT.0 / 2.0, top + PLOT.1 + 32.0);
    text(&mut svg, "muted", at, "middle", "time for a pair");
    let mut labels = Labels::new(dots.iter().map(|(dot, auc)| (x(dot.seconds), y(*auc))));
    for (dot, auc) in dots {
        let (px, py) = (x(dot.seconds), y(auc));
        let tip = format!(
            "{}: AUC {}, {}",
            dot.name,
            ratio(auc),
            duration(dot.seconds)
        );
        let range = match dot.auc.interval {
            Some(_) => format!(" (95 %: {})", interval(&dot.auc, ratio)),
            None => String::new(),
        };
        open_group(&mut svg, place, dot.series, &(tip + &range));
        if let Some(range) = dot.auc.interval {
            let _ = writeln!(
                svg,
                r##"<path class="line" stroke="#888888" stroke-opacity="0.5" d="M{px:.1} {:.1}V{:.1}"/>"##,
                y(range.low),
                y(range.high)
            );
        }
        marker(&mut svg, dot.series, px, py);
        if let Some((at, anchor)) = labels.place((px, py), dot.name) {
            text(&mut svg, "ink", at, anchor, &shorten(dot.name));
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// Where names are already: a name that finds no room is left to the legend and the tooltip.
struct Labels {
    /// Left, top, right and bottom.
    taken: Vec<[f64; 4]>,
}

impl Labels {
    fn new(dots: impl Iterator<Item = (f64, f64)>) -> Self {
        let taken = dots.map(|(x, y)| [x - 4.0, y - 4.0, x + 4.0, y + 4.0]);
        Self {
            taken: taken.collect(),
        }
    }

    /// Baseline and anchor for the name of a dot: right or left of it, a line up or down.
    fn place(&mut self, (x, y): (f64, f64), name: &str) -> Option<((f64, f64), &'static str)> {
        let width = 6.2 * name.chars().count().min(NAME) as f64;
        for (dx, dy) in [
            (7.0, -4.0),
            (7.0, 11.0),
            (-7.0, -4.0),
            (-7.0, 11.0),
            (7.0, -15.0),
            (-7.0, -15.0),
        ] {
            let baseline = y + dy;
            let left = if dx > 0.0 { x + dx } else { x + dx - width };
            let label = [left, baseline - 9.0, left + width, baseline + 2.0];
            let free = |other: &[f64; 4]| {
                label[2] < other[0]
                    || other[2] < label[0]
                    || label[3] < other[1]
                    || other[3] < label[1]
            };
            if left > LEFT && label[2] < LEFT + PLOT.0 + RIGHT && self.taken.iter().all(free) {
                self.taken.push(label);
                return Some(((x + dx, baseline), if dx > 0.0 { "start" } else { "end" }));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(name: &str, seconds: f64, auc: Option<f64>) -> Dot<'_> {
        Dot {
            series: 0,
            name,
            seconds,
            auc: Score {
                value: auc,
                interval: None,
            },
        }
    }

    #[test]
    fn a_tenth_of_the_time_is_a_decade_to_the_left() {
        let dots = [
            dot("slow", 1.0, Some(0.5)),
            dot("fast", 0.1, Some(0.5)),
            dot("none", 1.0, None),
        ];
        let svg = scatter(Place::File, "room", &dots);
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(
            svg.contains(r#"cx="44.0""#) && svg.contains(r#"cx="394.0""#),
            "{svg}"
        );
        assert!(svg.contains("fast: AUC 0.500, 100 ms"));
    }

    #[test]
    fn names_do_not_cover_each_other() {
        let dots: Vec<Dot<'_>> = (0..12).map(|_| dot("matcher", 0.1, Some(0.5))).collect();
        let svg = scatter(Place::Page, "room", &dots);
        assert_eq!(svg.matches("<circle").count(), 12);
        assert!((1..=6).contains(&svg.matches(">matcher<").count()), "{svg}");
    }

    #[test]
    fn nothing_timed_is_an_empty_figure() {
        assert!(!scatter(Place::Page, "room", &[]).contains("NaN"));
        assert!(!scatter(Place::Page, "room", &[dot("x", 0.0, Some(1.0))]).contains("inf"));
    }
}
