//! The paper's panel of AP bars: a group of bars for each sequence of a portion, a bar for each matcher. The
//! axis is logarithmic, since some matchers find a hundred times as many matches as others.

use std::fmt::Write as _;

use super::super::numbers::count;
use super::series::{Legend, open_group};
use super::{COLOURS, PALETTE, Target, axis_label, grid, open, text};

const LEFT: f64 = 56.0;
const HEIGHT: f64 = 220.0;
/// Narrowest and widest bar, room between two groups, and the least width of all groups together.
const BARS: (f64, f64) = (9.0, 22.0);
const GAP: f64 = 22.0;
const WIDTH: f64 = 440.0;

/// One matcher: its number, its name, and its AP on each sequence.
pub(in super::super) type ApSeries<'a> = (usize, &'a str, Vec<Option<f64>>);

/// The panel; every series has as many values as there are `sequences`.
pub(in super::super) fn ap_panel(
    target: Target,
    title: &str,
    sequences: &[String],
    series: &[ApSeries<'_>],
) -> String {
    let top = match target {
        Target::File => 38.0,
        Target::Page => 8.0,
    };
    let (groups, bars) = (sequences.len().max(1) as f64, series.len().max(1) as f64);
    let bar = ((WIDTH / groups - GAP) / bars).clamp(BARS.0, BARS.1);
    let group = (bars * bar + GAP).max(WIDTH / groups);
    let right = LEFT + groups * group;
    let names = series.iter().map(|(_, name, _)| *name);
    let legend = Legend::beside(target, right, names);
    let (low, high) = decades(series);
    let y = |value: f64| {
        let share = (value.log10() - low) / (high - low);
        top + HEIGHT * (1.0 - share.clamp(0.0, 1.0))
    };
    let size = (
        right + 12.0 + legend.width,
        top + HEIGHT.max(legend.height) + 26.0,
    );
    let mut svg = String::new();
    open(&mut svg, target, "chart ap-panel", size, title);
    let mut decade = low;
    while decade <= high {
        let at = y(10_f64.powf(decade));
        grid(&mut svg, (LEFT, at), (right, at));
        let label = format!("{:.0}", 10_f64.powf(decade));
        text(&mut svg, "muted", (LEFT - 6.0, at + 4.0), "end", &label);
        decade += 1.0;
    }
    axis_label(&mut svg, top + HEIGHT / 2.0, "correspondences");
    for (i, sequence) in sequences.iter().enumerate() {
        let middle = LEFT + (i as f64 + 0.5) * group;
        let at = (middle, top + HEIGHT + 17.0);
        text(&mut svg, "ink", at, "middle", &super::shorten(sequence));
    }
    for (position, (number, name, values)) in series.iter().enumerate() {
        let known: Vec<String> = (sequences.iter().zip(values))
            .map(|(sequence, value)| format!("{sequence} {}", count(*value)))
            .collect();
        open_group(
            &mut svg,
            target,
            *number,
            &format!("{name}: {}", known.join(", ")),
        );
        for (i, value) in values.iter().enumerate() {
            let Some(value) = value.filter(|value| *value > 0.0) else {
                continue;
            };
            let middle = LEFT + (i as f64 + 0.5) * group;
            let left = middle + (position as f64 - bars / 2.0) * bar;
            let _ = writeln!(
                svg,
                r#"<rect class="fill{}" fill="{}" x="{left:.1}" y="{:.1}" width="{:.1}" height="{:.1}"/>"#,
                if number / COLOURS % 2 == 1 {
                    " second"
                } else {
                    ""
                },
                PALETTE[number % COLOURS],
                y(value),
                bar - 1.5,
                top + HEIGHT - y(value)
            );
        }
        svg.push_str("</g>\n");
        if target == Target::File {
            legend.entry(&mut svg, (position, top), *number, (name, ""));
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// The powers of ten that enclose all values.
fn decades(series: &[ApSeries<'_>]) -> (f64, f64) {
    let values = || {
        let values = series
            .iter()
            .flat_map(|(_, _, values)| values.iter().flatten());
        values.copied().filter(|value| *value > 0.0)
    };
    let low = values().fold(f64::INFINITY, f64::min).log10().floor();
    let high = values().fold(0.0, f64::max).log10().ceil();
    if !(low.is_finite() && high.is_finite()) {
        return (0.0, 1.0);
    }
    // A bar at the lowest value would have no length.
    (low.min(high - 1.0).max(0.0), high.max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_grow_with_the_logarithm() {
        let series = [
            (0, "sift", vec![Some(100.0), None]),
            (1, "gms", vec![Some(10_000.0), Some(1000.0)]),
        ];
        let sequences = ["01".to_owned(), "02".to_owned()];
        let svg = ap_panel(Target::File, "short", &sequences, &series);
        assert_eq!(svg.matches("class=\"fill\"").count(), 3);
        // From 100 to 10000: the highest bar is as high as the panel, that of 1000 half as high.
        assert!(
            svg.contains(r#"height="220.0""#) && svg.contains(r#"height="110.0""#),
            "{svg}"
        );
        assert!(svg.contains("<title>sift: 01 100.0, 02 –</title>"));
        let nothing = ap_panel(
            Target::Page,
            "short",
            &sequences,
            &[(0, "sift", vec![None, None])],
        );
        assert!(!nothing.contains("NaN") && !nothing.contains("inf"));
    }
}
