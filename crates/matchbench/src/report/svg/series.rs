//! How a matcher is drawn: its colour, dash and marker are the same in every figure of a report.

use std::fmt::Write as _;

use super::{COLOURS, DASHES, PALETTE, PATTERNS, Target, escape, shorten, text, width_of};

/// The line and marker of a matcher, for the legend of the page.
pub(in super::super) fn legend_sample(series: usize) -> String {
    let mut svg = format!(
        r#"<svg class="sample s{}" viewBox="0 0 26 12" aria-hidden="true">"#,
        series % COLOURS
    );
    sample(&mut svg, series, 0.0, 6.0);
    svg.push_str("</svg>");
    svg
}

/// Opens the group of a matcher, which its switch in the page turns off; `tip` is its tooltip.
pub(super) fn open_group(svg: &mut String, target: Target, series: usize, tip: &str) {
    let class = series % COLOURS;
    let switch = match target {
        Target::Page => format!(r#" data-series="{series}""#),
        Target::File => String::new(),
    };
    let tip = escape(tip);
    let _ = writeln!(
        svg,
        r#"<g class="series s{class}"{switch}><title>{tip}</title>"#
    );
}

/// The line and marker of a matcher in a legend.
pub(super) fn sample(svg: &mut String, series: usize, left: f64, middle: f64) {
    polyline(svg, series, &[(left, middle), (left + 26.0, middle)]);
    marker(svg, series, left + 13.0, middle);
}

/// The legend of a file, to the right of the plot; the page has a legend of its own.
pub(super) struct Legend {
    left: f64,
    /// By how much it makes the figure wider, and the least height that it needs.
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Legend {
    const LINE: f64 = 16.0;
    /// Width for the sample before a name, and for a number after it.
    const SAMPLE: f64 = 32.0;
    const NUMBER: f64 = 44.0;

    /// A legend of these names, beside a plot that ends at `right`; only a file gets one.
    pub(super) fn beside<'a>(
        target: Target,
        right: f64,
        names: impl Iterator<Item = &'a str> + Clone,
    ) -> Self {
        match target {
            Target::File => Self {
                left: right + 24.0,
                width: 24.0 + Self::SAMPLE + width_of(names.clone()) + Self::NUMBER,
                height: names.count() as f64 * Self::LINE,
            },
            Target::Page => Self {
                left: 0.0,
                width: 0.0,
                height: 0.0,
            },
        }
    }

    /// The name on a row, counted from the `top` of the plot, and a number.
    pub(super) fn entry(
        &self,
        svg: &mut String,
        (row, top): (usize, f64),
        series: usize,
        (name, number): (&str, &str),
    ) {
        let middle = top + 8.0 + row as f64 * Self::LINE;
        sample(svg, series, self.left, middle);
        let at = (self.left + Self::SAMPLE, middle + 4.0);
        text(svg, "ink", at, "start", &shorten(name));
        let end = self.left - 24.0 + self.width;
        text(svg, "muted", (end, middle + 4.0), "end", number);
    }
}

/// The line of a matcher.
pub(super) fn polyline(svg: &mut String, series: usize, points: &[(f64, f64)]) {
    let colour = PALETTE[series % COLOURS];
    let dash = PATTERNS[series / COLOURS % DASHES];
    let _ = write!(
        svg,
        r#"<polyline class="line" fill="none" stroke="{colour}" stroke-width="1.6""#
    );
    if !dash.is_empty() {
        let _ = write!(svg, r#" stroke-dasharray="{dash}""#);
    }
    let points: Vec<String> = (points.iter().map(|(x, y)| format!("{x:.1},{y:.1}"))).collect();
    let _ = writeln!(svg, r#" points="{}"/>"#, points.join(" "));
}

/// A line through points with a marker on each, for a series with its number, its name and its tooltip. In a
/// file it also gets an entry in the legend, in this row below this edge.
pub(super) fn marked_line(
    svg: &mut String,
    target: Target,
    (series, name, tip): (usize, &str, &str),
    points: &[(f64, f64)],
    (legend, row, top): (&Legend, usize, f64),
) {
    open_group(svg, target, series, tip);
    polyline(svg, series, points);
    for &(x, y) in points {
        marker(svg, series, x, y);
    }
    if target == Target::File {
        legend.entry(svg, (row, top), series, (name, ""));
    }
    svg.push_str("</g>\n");
}

/// Radius of a marker, where no number is told by it.
const RADIUS: f64 = 2.8;

/// One of eight shapes around a point. It is hollow if the colour is used for the second time.
pub(super) fn marker(svg: &mut String, series: usize, x: f64, y: f64) {
    sized_marker(svg, series, (x, y), RADIUS);
}

/// The same of another size.
pub(super) fn sized_marker(svg: &mut String, series: usize, (x, y): (f64, f64), radius: f64) {
    // Corners in units of the marker's radius; the first shape is a circle.
    const SHAPES: [&[(f64, f64)]; 7] = [
        &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
        &[(0.0, -1.2), (1.1, 0.9), (-1.1, 0.9)],
        &[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)],
        &[(0.0, 1.2), (1.1, -0.9), (-1.1, -0.9)],
        &[(1.2, 0.0), (-0.9, -1.1), (-0.9, 1.1)],
        &[(-1.2, 0.0), (0.9, -1.1), (0.9, 1.1)],
        &[(-1.4, -0.5), (1.4, -0.5), (1.4, 0.5), (-1.4, 0.5)],
    ];
    let colour = PALETTE[series % COLOURS];
    // After all colours were used with all dashes, each colour gets another shape.
    let shape = (series + series / (COLOURS * DASHES)) % (SHAPES.len() + 1);
    let hollow = series / COLOURS % 2 == 1;
    let look = if hollow {
        format!(r##"class="mark hollow" fill="#ffffff" stroke="{colour}" stroke-width="1.2""##)
    } else {
        format!(r#"class="mark" fill="{colour}""#)
    };
    if shape == 0 {
        let _ = writeln!(
            svg,
            r#"<circle {look} cx="{x:.1}" cy="{y:.1}" r="{radius:.1}"/>"#
        );
    } else {
        let corners: Vec<String> = (SHAPES[shape - 1].iter())
            .map(|(dx, dy)| format!("{:.1},{:.1}", x + radius * dx, y + radius * dy))
            .collect();
        let _ = writeln!(svg, r#"<polygon {look} points="{}"/>"#, corners.join(" "));
    }
}
