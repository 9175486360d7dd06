//! Accuracy against time, the trade-off that the paper describes in words. Up and to the left is better.

use std::fmt::Write as _;

use crate::metrics::{Model, Score};

use super::super::numbers::{duration, interval, ratio};
use super::labels::Labels;
use super::series::{marker, open_group};
use super::{MUTED, Target, axis, axis_label, grid, open, shorten, text, tick};

const PLOT: (f64, f64) = (470.0, 270.0);
const LEFT: f64 = 54.0;
const RIGHT: f64 = 26.0;
const BOTTOM: f64 = 40.0;
/// Room between the outermost ticks and the edge of the plot, so that no mark is on it.
const PAD: f64 = 14.0;
/// The axis of the AUC spans at least this, since smaller differences look large on it.
const MIN_SPAN: f64 = 0.1;

/// One matcher in the figure.
pub(in super::super) struct Dot<'a> {
    /// Number of the matcher in the report.
    pub(in super::super) series: usize,
    pub(in super::super) name: &'a str,
    pub(in super::super) model: Model,
    /// Seconds for a pair.
    pub(in super::super) seconds: f64,
    pub(in super::super) auc: Score,
    /// Whether it has all results that others have; else its AUC is not compared with theirs.
    pub(in super::super) is_compared: bool,
}

/// AUC over the time for a pair, on a logarithmic axis. The dashed line joins the methods for which no other is
/// both faster and better, of those that are compared. Poses and homographies have lines of their own.
pub(in super::super) fn scatter(target: Target, title: &str, dots: &[Dot<'_>]) -> String {
    let top = match target {
        Target::File => 34.0,
        Target::Page => 8.0,
    };
    let dots: Vec<(&Dot<'_>, f64)> = (dots.iter())
        .filter(|dot| dot.seconds > 0.0)
        .filter_map(|dot| Some((dot, dot.auc.value?)))
        .collect();
    let times = round_times(dots.iter().map(|(dot, _)| dot.seconds));
    let [first, last] = [times.first(), times.last()].map(|t| libm::log10(*t.unwrap_or(&1.0)));
    let (bottom, end, step) = range(&dots);
    let x = |seconds: f64| {
        let share = (libm::log10(seconds) - first) / (last - first).max(f64::MIN_POSITIVE);
        LEFT + PAD + (PLOT.0 - 2.0 * PAD) * share
    };
    let y = |value: f64| {
        let share = (value - bottom) / (end - bottom);
        top + PAD + (PLOT.1 - 2.0 * PAD) * (1.0 - share)
    };

    let mut svg = String::new();
    let size = (LEFT + PLOT.0 + RIGHT, top + PLOT.1 + BOTTOM);
    open(&mut svg, target, "chart scatter", size, title);
    for value in (0..=((end - bottom) / step).round() as usize).map(|i| bottom + i as f64 * step) {
        grid(&mut svg, (LEFT, y(value)), (LEFT + PLOT.0, y(value)));
        let at = (LEFT - 7.0, y(value) + 3.5);
        text(&mut svg, "muted", at, "end", &tick(value, step));
    }
    for &seconds in &times {
        grid(&mut svg, (x(seconds), top), (x(seconds), top + PLOT.1));
        let at = (x(seconds), top + PLOT.1 + 16.0);
        text(&mut svg, "muted", at, "middle", &duration(seconds));
    }
    let at = (LEFT + PLOT.0 / 2.0, top + PLOT.1 + 32.0);
    text(&mut svg, "muted", at, "middle", "time for a pair");
    axis_label(&mut svg, top + PLOT.1 / 2.0, "AUC");
    let fronts = [Model::Pose, Model::Homography]
        .map(|model| corners(front(&dots, model).map(|(dot, auc)| (x(dot.seconds), y(auc)))));
    for corners in fronts.iter().filter(|corners| !corners.is_empty()) {
        let path: Vec<String> = (corners.iter().map(|(x, y)| format!("{x:.1},{y:.1}"))).collect();
        let _ = writeln!(
            svg,
            r#"<polyline class="front" fill="none" stroke="{MUTED}" stroke-dasharray="5 4" points="{}"/>"#,
            path.join(" ")
        );
    }
    let whisker = |dot: &Dot<'_>| (dot.auc.interval).map(|range| (y(range.high), y(range.low)));
    let mut labels = Labels::new(
        [LEFT, top, LEFT + PLOT.0, top + PLOT.1],
        dots.iter().map(|(dot, auc)| (x(dot.seconds), y(*auc))),
    );
    for line in fronts.iter().flat_map(|corners| corners.windows(2)) {
        labels.line(line[0], line[1]);
    }
    for (dot, _) in &dots {
        if let Some((high, low)) = whisker(dot) {
            labels.line((x(dot.seconds), high), (x(dot.seconds), low));
        }
    }
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
        open_group(&mut svg, target, dot.series, &(tip + &range));
        if let Some((high, low)) = whisker(dot) {
            let _ = writeln!(
                svg,
                r##"<path class="line" stroke="#888888" stroke-opacity="0.35" d="M{px:.1} {low:.1}V{high:.1}"/>"##
            );
        }
        marker(&mut svg, dot.series, px, py);
        if let Some(label) = labels.place((px, py), dot.name) {
            if let Some((lx, ly)) = label.leader {
                let _ = writeln!(
                    svg,
                    r#"<path class="leader" fill="none" stroke="{MUTED}" stroke-width="0.6" d="M{px:.1} {py:.1}L{lx:.1} {ly:.1}"/>"#
                );
            }
            text(&mut svg, "ink", label.at, "start", &shorten(dot.name));
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// Round times from below the fastest to above the slowest: 1, 2, 5, 10 ... of a unit, or only powers of ten if
/// those would be many.
fn round_times(seconds: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let low = seconds.clone().fold(f64::INFINITY, f64::min);
    let high = seconds.fold(0.0, f64::max);
    let (low, high) = if low <= high {
        (low, high)
    } else {
        (0.01, 1.0)
    };
    let all = |factors: &[f64]| -> Vec<f64> {
        let decades = -9..=6;
        let all: Vec<f64> = decades
            .flat_map(|decade| {
                factors
                    .iter()
                    .map(move |f| f * libm::exp10(f64::from(decade)))
            })
            .collect();
        let from = all.iter().rposition(|&time| time <= low).unwrap_or(0);
        let to = all.iter().position(|&time| time >= high && time > low);
        all[from..=to.unwrap_or(all.len() - 1).max(from)].to_vec()
    };
    let fine = all(&[1.0, 2.0, 5.0]);
    if fine.len() <= 8 { fine } else { all(&[1.0]) }
}

/// Lower end, upper end and step of the axis of the AUC. It starts at 0, unless all values lie close together,
/// and then spans at least [`MIN_SPAN`].
fn range(dots: &[(&Dot<'_>, f64)]) -> (f64, f64, f64) {
    let ends = |(dot, auc): &(&Dot<'_>, f64)| match dot.auc.interval {
        Some(interval) => (interval.low, interval.high),
        None => (*auc, *auc),
    };
    let high = (dots.iter().map(|dot| ends(dot).1)).fold(0.0, f64::max);
    let low = (dots.iter().map(|dot| ends(dot).0)).fold(high, f64::min);
    if low > high / 2.0 {
        let missing = (MIN_SPAN - (high - low)).max(0.0);
        let high = (high + missing / 2.0).min(high.max(1.0));
        let low = low.min(high - MIN_SPAN).max(0.0);
        let (step, _) = axis(high - low);
        let bottom = (low / step + 1e-9).floor() * step;
        let end = (high / step - 1e-9).ceil() * step;
        (bottom, end.max(bottom + step), step)
    } else {
        let (step, end) = axis(high);
        (0.0, end, step)
    }
}

/// The dots of one kind of model for which no other dot of this kind is both faster and better, the fastest
/// first; of those that are compared.
fn front<'d, 'a>(
    dots: &[(&'d Dot<'a>, f64)],
    model: Model,
) -> impl Iterator<Item = (&'d Dot<'a>, f64)> {
    let mut sorted = dots.to_vec();
    sorted.retain(|(dot, _)| dot.model == model && dot.is_compared);
    sorted.sort_by(|(one, better), (other, worse)| {
        one.seconds
            .total_cmp(&other.seconds)
            .then(worse.total_cmp(better))
    });
    let mut best = f64::NEG_INFINITY;
    sorted.retain(|&(_, auc)| {
        auc > best && {
            best = auc;
            true
        }
    });
    sorted.into_iter()
}

/// A stair line through the points: each time first right, then up.
fn corners(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut corners: Vec<(f64, f64)> = Vec::new();
    for (x, y) in points {
        if let Some(&(_, before)) = corners.last() {
            corners.push((x, before));
        }
        corners.push((x, y));
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(name: &str, seconds: f64, auc: Option<f64>) -> Dot<'_> {
        Dot {
            series: 0,
            name,
            model: Model::Pose,
            seconds,
            auc: Score {
                value: auc,
                interval: None,
            },
            is_compared: true,
        }
    }

    #[test]
    fn a_tenth_of_the_time_is_a_decade_to_the_left() {
        let dots = [
            dot("slow", 1.0, Some(0.5)),
            dot("fast", 0.1, Some(0.5)),
            dot("none", 1.0, None),
        ];
        let svg = scatter(Target::File, "room", &dots);
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(
            svg.contains(r#"cx="68.0""#) && svg.contains(r#"cx="510.0""#),
            "{svg}"
        );
        assert!(svg.contains("fast: AUC 0.500, 100 ms"));
    }

    #[test]
    fn the_front_is_what_none_is_faster_and_better_than() {
        let dots = [
            dot("slow", 1.0, Some(0.6)),
            dot("worse", 0.5, Some(0.3)),
            dot("fast", 0.1, Some(0.4)),
            dot("as good, slower", 2.0, Some(0.6)),
            Dot {
                model: Model::Homography,
                ..dot("another question", 0.3, Some(0.9))
            },
            Dot {
                is_compared: false,
                ..dot("not finished", 0.05, Some(0.9))
            },
        ];
        let svg = scatter(Target::Page, "room", &dots);
        assert_eq!(svg.matches("class=\"front\"").count(), 2, "{svg}");
        let dots: Vec<_> = (dots.iter().map(|dot| (dot, dot.auc.value.unwrap_or(0.0)))).collect();
        let names: Vec<_> = front(&dots, Model::Pose).map(|(dot, _)| dot.name).collect();
        assert_eq!(names, ["fast", "slow"]);
    }

    #[test]
    fn times_end_at_round_ones() {
        let round = |times: &[f64]| -> Vec<String> {
            let times = round_times(times.iter().copied());
            times.into_iter().map(duration).collect()
        };
        assert_eq!(round(&[0.013, 0.09]), ["10 ms", "20 ms", "50 ms", "100 ms"]);
        assert_eq!(round(&[1.0]), ["1 s", "2 s"]);
        assert_eq!(
            round(&[0.0012, 2.0]),
            ["1 ms", "10 ms", "100 ms", "1 s", "10 s"]
        );
        assert!(round(&[]).len() > 1);
    }

    #[test]
    fn marks_and_names_are_inside_whatever_is_close_together() {
        let numbers = |svg: &str, before: &str| -> Vec<f64> {
            let ends = svg.split(before).skip(1);
            let numbers = ends.map(|rest| rest.split('"').next().expect("split gives one"));
            numbers
                .map(|number| number.parse().expect("a number"))
                .collect()
        };
        for aucs in [[0.61, 0.65], [0.99, 1.0], [0.5, 0.5], [0.0, 0.02]] {
            let dots = [
                dot("a matcher with a long name", 0.01, Some(aucs[0])),
                dot("another", 0.1, Some(aucs[1])),
            ];
            let svg = scatter(Target::Page, "room", &dots);
            let within = |all: Vec<f64>, low: f64, high: f64| {
                assert!(
                    all.iter().all(|n| (low..=high).contains(n)),
                    "{all:?} {svg}"
                );
            };
            within(numbers(&svg, " cx=\""), LEFT + PAD, LEFT + PLOT.0 - PAD);
            within(numbers(&svg, " cy=\""), 8.0 + PAD, 8.0 + PLOT.1 - PAD);
            let names = svg.matches("<text class=\"ink\"").count();
            assert_eq!(names, 2, "{svg}");
            let dots: Vec<_> = (dots.iter().zip(aucs)).collect();
            let (bottom, end, _) = range(&dots);
            assert!(end - bottom > 0.099 || aucs[0] == 0.0, "{bottom} {end}");
        }
    }

    #[test]
    fn nothing_timed_is_an_empty_figure() {
        assert!(!scatter(Target::Page, "room", &[]).contains("NaN"));
        assert!(!scatter(Target::Page, "room", &[dot("x", 0.0, Some(1.0))]).contains("inf"));
    }
}
