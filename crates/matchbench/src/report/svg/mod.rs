//! Figures as SVG, written directly: they need no display and no fonts, and the same scores give the same
//! bytes.
//!
//! Colours are attributes, so that a file can be shown alone. The page overrides them by class (`s0` ... `s7`,
//! `ink`, `grid`, `reference` ...), so the same drawing can be shown on a dark screen. Matchers differ by colour, by
//! marker and by dash, and keep all three in every figure of a report.

mod ap_bars;
mod ap_panel;
mod forest;
mod heat_map;
mod labels;
mod pair;
mod reliability;
mod scatter;
mod series;
mod sheet;
mod sp_curves;
mod strata;

use std::fmt::Write as _;

use super::numbers::fixed;

pub(super) use ap_bars::ap_bars;
pub(super) use ap_panel::{ApSeries, ap_panel};
pub(super) use forest::{Rival, forest};
pub(super) use heat_map::heat_map;
pub(super) use pair::{DISTANCES, data_url, pair};
pub(super) use reliability::reliability_diagram;
pub(super) use scatter::{Dot, scatter};
pub(super) use series::legend_sample;
pub(super) use sheet::{gallery, stack};
pub(super) use sp_curves::{Axes, Curve, sp_curves};
pub(super) use strata::strata_curves;

/// Where a figure is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// Alone: with background, legend and title.
    File,
    /// In the page, which has its own.
    Page,
}

/// Eight colours that can be told apart with any colour vision (after Okabe and Ito, "Color Universal Design",
/// 2008; the pale ones are darkened to a contrast of 3:1 on white). The style sheet of the page has the same
/// colours, and lighter ones for dark screens.
const PALETTE: [&str; 8] = [
    "#0072b2", "#d55e00", "#008a64", "#b5508f", "#a87400", "#3488bd", "#4d4d4d", "#8a3ffc",
];

/// Dash patterns. With more than eight matchers, the colours are used again with the next pattern.
const PATTERNS: [&str; 3] = ["", "6 3", "2 2.5"];

/// How many series have colours, and dashes, of their own.
pub(super) const COLOURS: usize = PALETTE.len();
pub(super) const DASHES: usize = PATTERNS.len();

/// How many pixels a unit of a chart has in the page at most: charts of few cells or short names would otherwise have
/// larger text than others.
const LARGEST: f64 = 1.3;
/// And at least: a chart for which there is less room can be scrolled, since its text would be too small to read.
const SMALLEST: f64 = 0.8;

/// Room beside the title of a file.
const TITLE: f64 = 12.0;
/// Names longer than this are cut.
const NAME: usize = 26;
const INK: &str = "#222222";
const MUTED: &str = "#666666";
const GRID: &str = "#dddddd";

/// Text of a name in element content or in a quoted attribute. Characters that XML cannot hold
/// are replaced.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => {
                escaped.push('\u{fffd}');
            }
            c => escaped.push(c),
        }
    }
    escaped
}

/// The beginning of a name, escaped; the whole name is in the tooltip.
pub(super) fn shorten(name: &str) -> String {
    if name.chars().count() <= NAME {
        return escape(name);
    }
    let start: String = name.chars().take(NAME - 1).collect();
    format!("{}…", escape(&start))
}

/// The opening tag of a figure of this size, and its title for screen readers. A file also gets a background
/// and a visible title, and is as wide as this needs.
fn open(svg: &mut String, target: Target, class: &str, (width, height): (f64, f64), title: &str) {
    let needed = 2.0 * TITLE + width_of_line(title);
    let title = escape(title);
    match target {
        Target::Page => {
            let sizes = if class.starts_with("chart") {
                let (least, most) = (SMALLEST * width, LARGEST * width);
                format!(r#" style="--least:{least:.0}px;max-width:{most:.0}px""#)
            } else {
                String::new()
            };
            let _ = writeln!(
                svg,
                r#"<svg class="{class}"{sizes} viewBox="0 0 {width} {height}" role="img" aria-label="{title}" tabindex="0">"#
            );
        }
        Target::File => {
            let width = width.max(needed.ceil());
            let _ = writeln!(
                svg,
                r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="DejaVu Sans, Verdana, sans-serif">"#
            );
            let _ = writeln!(svg, "<title>{title}</title>");
            let _ = writeln!(
                svg,
                r##"<rect width="{width}" height="{height}" fill="#ffffff"/>"##
            );
            text(svg, "ink", (TITLE, 20.0), "start", &title);
        }
    }
}

/// Width that a line of text needs at most in DejaVu Sans, in user units.
fn width_of_line(line: &str) -> f64 {
    let width = |c: char| match c {
        ' ' | '!' | '\'' | '(' | ')' | ',' | '-' | '.' | '/' | ':' | ';' | '[' | ']' | '|'
        | 'I' | 'f' | 'i' | 'j' | 'l' | 'r' | 't' => 4.6,
        'a'..='v' | 'x'..='z' | '0'..='9' | '_' if c != 'm' => 7.0,
        _ => 11.0,
    };
    line.chars().map(width).sum()
}

/// Width needed for the longest of the names, in user units.
fn width_of<'a>(names: impl Iterator<Item = &'a str>) -> f64 {
    let longest = names.map(|name| name.chars().count().min(NAME)).max();
    6.3 * longest.unwrap_or(0) as f64
}

/// The label of a vertical axis, written along it.
fn axis_label(svg: &mut String, middle: f64, content: &str) {
    let _ = writeln!(
        svg,
        r#"<text class="muted" transform="translate(11 {middle:.1}) rotate(-90)" text-anchor="middle" font-size="11" fill="{MUTED}">{content}</text>"#
    );
}

/// A line of text; `content` is already escaped.
fn text(svg: &mut String, class: &str, (x, y): (f64, f64), anchor: &str, content: &str) {
    let fill = if class == "ink" { INK } else { MUTED };
    let _ = writeln!(
        svg,
        r#"<text class="{class}" x="{x:.1}" y="{y:.1}" text-anchor="{anchor}" font-size="11" fill="{fill}">{content}</text>"#
    );
}

/// A line of the grid.
fn grid(svg: &mut String, from: (f64, f64), to: (f64, f64)) {
    let _ = writeln!(
        svg,
        r#"<line class="grid" x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}" stroke="{GRID}"/>"#,
        from.0, from.1, to.0, to.1
    );
}

/// A round step that divides `0 ..= max` into three to six parts, and the end of the axis, which is the first
/// multiple of the step that is not below `max`.
fn axis(max: f64) -> (f64, f64) {
    if !(max > 0.0 && max.is_finite()) {
        return (0.2, 1.0);
    }
    let mut decade = 1e-3;
    loop {
        for factor in [1.0, 2.0, 2.5, 5.0] {
            let step = decade * factor;
            let parts = (max / step - 1e-9).ceil();
            if parts <= 5.0 {
                return (step, step * parts.max(1.0));
            }
        }
        decade *= 10.0;
    }
}

/// The number of an axis tick: as many decimals as its step has.
fn tick(value: f64, step: f64) -> String {
    let decimals = [1.0, 0.1, 0.01, 0.001, 0.0001]
        .iter()
        .position(|unit| ((step / unit).round() - step / unit).abs() < 1e-6)
        .unwrap_or(4);
    fixed(value, decimals)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number of an attribute of each line that holds `element`.
    pub(super) fn numbers(svg: &str, element: &str, attribute: &str) -> Vec<f64> {
        let begin = format!(" {attribute}=\"");
        (svg.lines().filter(|line| line.contains(element)))
            .map(|line| {
                let (_, rest) = line.split_once(&begin).expect("it has the attribute");
                let (number, _) = rest.split_once('"').expect("it ends");
                number.parse().expect("a number")
            })
            .collect()
    }

    /// Where a coordinate is whose axis has these two ticks, by their labels, attribute and anchor. Labels of the vertical axis
    /// stand 3.5 lower than their lines.
    pub(super) fn scale(
        svg: &str,
        attribute: &str,
        anchor: &str,
        ticks: [&str; 2],
    ) -> impl Fn(f64) -> f64 {
        let anchor = format!("text-anchor=\"{anchor}\"");
        let lower = if attribute == "y" { 3.5 } else { 0.0 };
        let places = ticks.map(|label| {
            let its = svg.lines().filter(|line| line.contains(&anchor));
            let its = its.filter(|line| line.contains(&format!(">{label}</text>")));
            numbers(&its.collect::<Vec<_>>().join("\n"), "<text", attribute)[0] - lower
        });
        let values: [f64; 2] = ticks.map(|label| label.parse().expect("a number"));
        let unit = (places[1] - places[0]) / (values[1] - values[0]);
        move |value| places[0] + unit * (value - values[0])
    }

    /// Figures have one decimal.
    pub(super) fn are_near(found: &[f64], expected: &[f64]) -> bool {
        found.len() == expected.len()
            && (found.iter().zip(expected)).all(|(found, expected)| (found - expected).abs() < 0.15)
    }

    #[test]
    fn axes_end_at_round_numbers() {
        for (max, step, end) in [
            (0.198, 0.05, 0.2),
            (0.93, 0.2, 1.0),
            (1.0, 0.2, 1.0),
            (0.54, 0.2, 0.6),
            (2966.0, 1000.0, 3000.0),
            (0.0, 0.2, 1.0),
            (f64::NAN, 0.2, 1.0),
        ] {
            let (s, e) = axis(max);
            assert!(
                (s - step).abs() < 1e-9 && (e - end).abs() < 1e-9,
                "{max}: {s} {e}"
            );
        }
        assert_eq!(tick(0.5, 0.25), "0.50");
        assert_eq!(tick(0.4, 0.2), "0.4");
        assert_eq!(tick(0.0075, 0.0025), "0.0075");
        assert_eq!(tick(1500.0, 500.0), "1500");
    }

    #[test]
    fn text_of_charts_in_the_page_is_neither_large_nor_too_small_to_read() {
        let opening = |class, target| {
            let mut svg = String::new();
            open(&mut svg, target, class, (200.0, 100.0), "room");
            svg
        };
        let heat = opening("chart heat", Target::Page);
        let sizes = r#"style="--least:160px;max-width:260px""#;
        assert!(heat.contains(sizes), "{heat}");
        // Pictures fill the place of their images.
        assert!(!opening("pair", Target::Page).contains("style"));
        assert!(!opening("chart heat", Target::File).contains("style"));
    }

    #[test]
    fn a_file_is_as_wide_as_its_title() {
        let opening = |target, title: &str| {
            let mut svg = String::new();
            open(&mut svg, target, "chart lead", (200.0, 100.0), title);
            svg
        };
        assert!(opening(Target::File, "room").contains(r#"width="200" height="100""#));
        // Of the title, not of what it is escaped to.
        let title = "kitchen & hall (190 pairs, each 5 times, adaptive)";
        let wide = opening(Target::File, title);
        let tags = [
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="330" height="100" viewBox="0 0 330 100""#,
            r#"<rect width="330" height="100""#,
        ];
        assert!(tags.iter().all(|tag| wide.contains(tag)), "{wide}");
        assert!(opening(Target::Page, title).contains(r#"viewBox="0 0 200 100""#));
    }

    #[test]
    fn names_are_text() {
        assert_eq!(
            escape("<b a='\"'>&\u{1}"),
            "&lt;b a=&#39;&quot;&#39;&gt;&amp;\u{fffd}"
        );
    }

    #[test]
    fn long_names_are_cut_before_they_are_escaped() {
        assert_eq!(
            shorten(&"<".repeat(NAME + 1)),
            format!("{}…", "&lt;".repeat(NAME - 1))
        );
    }
}
