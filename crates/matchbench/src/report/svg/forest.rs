//! The best method compared with the others: how far each is behind, and whether the difference is significant.

use std::fmt::Write as _;

use crate::metrics::Difference;

use super::super::numbers::ratio;
use super::{
    COLOURS, INK, MUTED, PALETTE, Target, axis, escape, grid, open, shorten, text, tick, width_of,
    width_of_line,
};

/// Room beside the names.
const MARGIN: f64 = 14.0;
const PLOT: f64 = 210.0;
const RIGHT: f64 = 68.0;
const LINE: f64 = 19.0;
/// Room between the numbers of neighbouring ticks.
const GAP: f64 = 4.0;

/// One of the other methods.
pub(in super::super) struct Rival<'a> {
    /// Number of the matcher in the report.
    pub(in super::super) series: usize,
    pub(in super::super) name: &'a str,
    /// A sentence about it.
    pub(in super::super) words: String,
    /// By how much its score is lower, with the paired interval.
    pub(in super::super) behind: Difference,
}

/// One line per rival: a dot and its interval, over the difference to the best method (several if they are equal). If the
/// difference is not significant, the dot is hollow and the line pale.
pub(in super::super) fn forest(
    target: Target,
    title: &str,
    best: &[&str],
    rivals: &[Rival<'_>],
) -> String {
    let top = match target {
        Target::File => 30.0,
        Target::Page => 2.0,
    };
    let left = MARGIN + width_of(rivals.iter().map(|rival| rival.name));
    let ends = |rival: &Rival<'_>| {
        let value = rival.behind.value.unwrap_or(0.0);
        rival
            .behind
            .interval
            .map_or((value, value), |i| (i.low, i.high))
    };
    let low = rivals
        .iter()
        .fold(0.0_f64, |low, rival| low.min(ends(rival).0));
    let high = rivals
        .iter()
        .fold(0.0_f64, |high, rival| high.max(ends(rival).1));
    let (first, step, ticks) = ticks_with_room(low, high);
    let width = step * ticks as f64;
    let x = |value: f64| left + PLOT * (value - first) / width;

    let bottom = top + rivals.len() as f64 * LINE + 4.0;
    let mut svg = String::new();
    open(
        &mut svg,
        target,
        "chart lead",
        (left + PLOT + RIGHT, bottom + 36.0),
        title,
    );
    for value in (0..=ticks).map(|i| first + i as f64 * step) {
        grid(&mut svg, (x(value), top), (x(value), bottom));
        let at = (x(value), bottom + 14.0);
        text(&mut svg, "muted", at, "middle", &tick(value, step));
    }
    let _ = writeln!(
        svg,
        r#"<line class="reference" x1="{0:.1}" y1="{top:.1}" x2="{0:.1}" y2="{bottom:.1}" stroke="{MUTED}"/>"#,
        x(0.0)
    );
    let below = match best {
        [one] => format!("AUC by which {} leads", shorten(one)),
        [one, other] => format!("AUC by which {} and {} lead", shorten(one), shorten(other)),
        many => format!("AUC by which the first {} lead", many.len()),
    };
    text(
        &mut svg,
        "muted",
        (left + PLOT / 2.0, bottom + 30.0),
        "middle",
        &below,
    );
    for (row, rival) in rivals.iter().enumerate() {
        let middle = top + (row as f64 + 0.5) * LINE;
        let (class, colour) = (rival.series % COLOURS, PALETTE[rival.series % COLOURS]);
        let certain = rival.behind.is_certain;
        let _ = writeln!(
            svg,
            r#"<g class="rival s{class}"><title>{}</title>"#,
            escape(&rival.words)
        );
        text(
            &mut svg,
            "ink",
            (left - 7.0, middle + 4.0),
            "end",
            &shorten(rival.name),
        );
        let (from, to) = ends(rival);
        let opacity = if certain { 1.0 } else { 0.45 };
        let _ = writeln!(
            svg,
            r#"<path class="whisker" fill="none" stroke="{INK}" stroke-opacity="{opacity}" d="M{:.1} {middle:.1}H{:.1}"/>"#,
            x(from),
            x(to)
        );
        if let Some(value) = rival.behind.value {
            let look = if certain {
                format!(r#"class="mark" fill="{colour}""#)
            } else {
                format!(
                    r##"class="mark hollow" fill="#ffffff" stroke="{colour}" stroke-width="1.4""##
                )
            };
            let _ = writeln!(
                svg,
                r#"<circle {look} cx="{:.1}" cy="{middle:.1}" r="4"/>"#,
                x(value)
            );
            let at = (left + PLOT + 10.0, middle + 4.0);
            let class = if certain { "ink" } else { "muted" };
            text(&mut svg, class, at, "start", &ratio(value));
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// The first tick of an axis from `low` to `high`, its step, and into how many parts ticks divide it: as many as have
/// room for their numbers.
fn ticks_with_room(low: f64, high: f64) -> (f64, f64, usize) {
    let (finest, _) = axis(high - low);
    let ticks = |step: f64| {
        let first = (low / step + 1e-9).floor() * step;
        let parts = ((high - first) / step - 1e-9).ceil().max(1.0);
        (first, step, parts as usize)
    };
    let has_room = |&(first, step, parts): &(f64, f64, usize)| {
        let numbers = (0..=parts).map(|i| tick(first + i as f64 * step, step));
        let widest = numbers.map(|number| width_of_line(&number));
        widest.fold(0.0, f64::max) + GAP <= PLOT / parts as f64
    };
    let mut steps = [1.0, 2.0].map(|times| ticks(times * finest)).into_iter();
    steps.find(has_room).unwrap_or_else(|| ticks(4.0 * finest))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{are_near, numbers, scale};
    use super::*;

    #[test]
    fn doubt_is_hollow() {
        let rival = |name, value, low, high| Rival {
            series: 1,
            name,
            words: format!("against <{name}>"),
            behind: Difference::seen(value, Some([low, high])),
        };
        let rivals = [rival("far", 0.2, 0.1, 0.3), rival("near", 0.02, -0.1, 0.1)];
        let svg = forest(Target::Page, "room", &["best"], &rivals);
        assert!(svg.contains("by which best leads"), "{svg}");
        let level = Rival {
            behind: Difference::seen(-1e-17, Some([-0.1, 0.1])),
            ..rival("level", 0.0, 0.0, 0.0)
        };
        let shared = forest(Target::Page, "room", &["best", "level"], &[level]);
        assert!(shared.contains("by which best and level lead"), "{shared}");
        assert!(
            shared.contains(">0.000<") && !shared.contains("-0.000"),
            "{shared}"
        );
        assert_eq!(svg.matches("<circle").count(), 2);
        assert_eq!(svg.matches("hollow").count(), 1);
        assert!(
            svg.contains("&lt;near&gt;") && !svg.contains("NaN"),
            "{svg}"
        );
        let unknown = Rival {
            behind: Difference::default(),
            ..rival("x", 0.0, 0.0, 0.0)
        };
        assert!(!forest(Target::File, "room", &["best"], &[unknown]).contains("NaN"));
    }

    #[test]
    fn numbers_of_the_axis_do_not_touch() {
        // In steps of 0.025 the first two would: from -0.025 on, and up to 0.125.
        assert_eq!(ticks_with_room(-0.002, 0.11), (-0.05, 0.05, 4));
        assert_eq!(ticks_with_room(0.0, 0.11), (0.0, 0.025, 5));
        for low in (0..60).map(|i| f64::from(i) * -0.005) {
            for high in (1..60).map(|i| f64::from(i) * 0.0047) {
                let (first, step, parts) = ticks_with_room(low, high);
                let last = first + parts as f64 * step;
                assert!(first <= low + 1e-9 && last >= high - 1e-9 && parts >= 2);
                let ends = [first, last].map(|value| width_of_line(&tick(value, step)));
                assert!(ends[0].max(ends[1]) < PLOT / parts as f64, "{low} {high}");
            }
        }
    }

    #[test]
    fn dots_and_intervals_lie_at_their_numbers_and_only_what_is_certain_is_filled() {
        let rival = |behind| Rival {
            series: 0,
            name: "other",
            words: String::new(),
            behind,
        };
        let rivals = [
            rival(Difference::seen(0.2, Some([0.1, 0.28]))),
            rival(Difference::seen(0.02, Some([-0.13, 0.1]))),
            // Not among so many comparisons.
            rival(Difference {
                is_certain: false,
                ..Difference::seen(0.2, Some([0.1, 0.28]))
            }),
        ];
        let svg = forest(Target::Page, "room", &["best"], &rivals);
        let x = scale(&svg, "x", "middle", ["0.0", "0.2"]);
        let dots = numbers(&svg, "<circle", "cx");
        assert!(are_near(&dots, &[x(0.2), x(0.02), x(0.2)]), "{svg}");
        assert!(
            are_near(&numbers(&svg, "\"reference\"", "x1"), &[x(0.0)]),
            "{svg}"
        );
        let whiskers: Vec<f64> = (svg.lines().filter(|line| line.contains("whisker")))
            .flat_map(|line| {
                let (_, path) = line.split_once(" d=\"M").expect("a path");
                let (from, to) = path.split_once('H').expect("a line");
                let from = from.split(' ').next().expect("its begin");
                [from, to.trim_end_matches("\"/>")].map(|x| x.parse().expect("a number"))
            })
            .collect();
        let ends = [0.1, 0.28, -0.13, 0.1, 0.1, 0.28].map(x);
        assert!(are_near(&whiskers, &ends), "{svg}");
        assert_eq!(
            numbers(&svg, "whisker", "stroke-opacity"),
            [1.0, 0.45, 0.45]
        );
        let dots = svg.lines().filter(|line| line.contains("<circle"));
        let hollow: Vec<bool> = dots.map(|line| line.contains("hollow")).collect();
        assert_eq!(hollow, [false, true, true]);
    }
}
