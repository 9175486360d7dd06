//! A pair side by side. Matches are coloured by their true error. Those that agree with the estimated pose are
//! solid lines, the others are dashed. Epipolar lines are drawn for the true and the estimated pose.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::Point2;

use super::super::pair_view::{MatchView, PairView, Thumbnail, agrees_below, class_of, evenly};
use super::{MUTED, Target, escape, open, text};
use crate::metrics::Model;

/// Width of the drawing, and of the gap between the images.
const WIDTH: f64 = 1000.0;
const GAP: f64 = 8.0;
/// Classes of the true error of a match: colour and name.
pub(in super::super) const DISTANCES: [(&str, &str); 4] = [
    ("#1f9e89", "below 1 px"),
    ("#56b4e9", "1 to 3 px"),
    ("#e69f00", "3 to 10 px"),
    ("#e0393e", "10 px and more"),
];
/// The colour of matches if there is no true baseline, so that their error is not known.
const UNKNOWN: &str = "#bbbbbb";
const TRUE_LINE: &str = "#ffffff";
const ESTIMATED_LINE: &str = "#f0e442";

/// Where the images are in the drawing.
struct Layout {
    scale: f64,
    /// Left edge of image b.
    b: f64,
    top: f64,
    height: f64,
}

/// The drawing, with at most `limit` matches, evenly spread over the list. In the page the images are not part
/// of the drawing but stand behind it.
pub(in super::super) fn pair(
    target: Target,
    view: &PairView,
    caption: &str,
    limit: usize,
) -> String {
    let sizes = view
        .images
        .each_ref()
        .map(|image| (image.original.0 as f64, image.original.1 as f64));
    let scale = (WIDTH - GAP) / (sizes[0].0 + sizes[1].0).max(1.0);
    let layout = Layout {
        scale,
        b: sizes[0].0 * scale + GAP,
        top: if target == Target::File { 34.0 } else { 0.0 },
        height: sizes[0].1.max(sizes[1].1) * scale,
    };
    let legend = if target == Target::File { 66.0 } else { 0.0 };
    let mut svg = String::new();
    let size = (WIDTH, layout.top + layout.height + legend);
    open(
        &mut svg,
        target,
        "pair",
        (size.0, (size.1 * 10.0).round() / 10.0),
        caption,
    );
    if target == Target::File {
        for (image, (left, size)) in view
            .images
            .iter()
            .zip([(0.0, sizes[0]), (layout.b, sizes[1])])
        {
            let _ = writeln!(
                svg,
                r#"<image x="{left:.1}" y="{:.1}" width="{:.1}" height="{:.1}" preserveAspectRatio="none" href="{}"/>"#,
                layout.top,
                size.0 * scale,
                size.1 * scale,
                data_url(image)
            );
        }
    }
    keypoints(&mut svg, target, &layout, view);
    matches(&mut svg, &layout, view, limit);
    lines(&mut svg, &layout, view, sizes[1]);
    if target == Target::File {
        key(&mut svg, layout.top + layout.height + 19.0, view, limit);
    }
    svg.push_str("</svg>\n");
    svg
}

/// The image as a data URL, for the `src` of an `img`.
pub(in super::super) fn data_url(image: &Thumbnail) -> String {
    format!("data:image/jpeg;base64,{}", STANDARD.encode(&image.jpeg))
}

impl Layout {
    fn a(&self, point: Point2<f64>) -> (f64, f64) {
        (point.x * self.scale, self.top + point.y * self.scale)
    }

    fn b(&self, point: Point2<f64>) -> (f64, f64) {
        (
            self.b + point.x * self.scale,
            self.top + point.y * self.scale,
        )
    }
}

fn keypoints(svg: &mut String, target: Target, layout: &Layout, view: &PairView) {
    // A picture in a file of its own shows all keypoints, and is viewed at a larger size.
    let width = if target == Target::File { 2.4 } else { 4.4 };
    let mut dots = String::new();
    let [a, b] = &view.keypoints;
    for (x, y) in (a.iter().map(|&p| layout.a(p))).chain(b.iter().map(|&p| layout.b(p))) {
        let _ = write!(dots, "M{x:.0} {y:.0}h0");
    }
    if !dots.is_empty() {
        let _ = writeln!(
            svg,
            r##"<path class="keypoints" fill="none" stroke="#ff5ce1" stroke-width="{width}" stroke-linecap="round" d="{dots}"/>"##
        );
    }
}

/// One path for each class, and within it for matches that agree and those that do not. So the file is short,
/// however many matches there are.
fn matches(svg: &mut String, layout: &Layout, view: &PairView, limit: usize) {
    let shown = evenly(&view.matches, limit);
    // Matches that disagree are drawn first, so that those that agree lie above them.
    for agrees in [false, true] {
        let (class, width, opacity, dash) = if agrees {
            ("agrees", 1.2, 0.9, "")
        } else {
            ("differs", 0.9, 0.55, r#" stroke-dasharray="4 3""#)
        };
        let _ = writeln!(
            svg,
            r#"<g class="{class}" fill="none" stroke-width="{width}" stroke-opacity="{opacity}">"#
        );
        for (index, colour) in colours() {
            let (mut strokes, mut dots) = (String::new(), String::new());
            let class = |m: &MatchView| m.distance.map_or(DISTANCES.len(), class_of);
            let of_class = |m: &&MatchView| m.agrees == agrees && class(m) == index;
            for m in shown.iter().filter(of_class) {
                let ((ax, ay), (bx, by)) = (layout.a(m.a), layout.b(m.b));
                let _ = write!(strokes, "M{ax:.0} {ay:.0}L{bx:.0} {by:.0}");
                let _ = write!(dots, "M{ax:.1} {ay:.1}h0M{bx:.1} {by:.1}h0");
            }
            if !strokes.is_empty() {
                let _ = writeln!(
                    svg,
                    r#"<path stroke="{colour}"{dash} d="{strokes}"/><path stroke="{colour}" stroke-width="4" stroke-linecap="round" d="{dots}"/>"#
                );
            }
        }
        svg.push_str("</g>\n");
    }
}

fn colours() -> impl Iterator<Item = (usize, &'static str)> {
    let known = DISTANCES.iter().map(|class| class.0);
    known.chain([UNKNOWN]).enumerate()
}

fn lines(svg: &mut String, layout: &Layout, view: &PairView, (width, height): (f64, f64)) {
    if view.lines.is_empty() {
        return;
    }
    // A nested drawing clips the lines to image b. A clip path would need an id, which would have to be unique.
    let _ = writeln!(
        svg,
        r#"<svg class="epipolar" x="{:.1}" y="{:.1}" width="{:.1}" height="{:.1}" overflow="hidden" fill="none" stroke-width="1.3">"#,
        layout.b,
        layout.top,
        width * layout.scale,
        height * layout.scale
    );
    for (colour, dash, points) in [
        (TRUE_LINE, "", true),
        (ESTIMATED_LINE, r#" stroke-dasharray="7 4""#, false),
    ] {
        let mut path = String::new();
        for line in &view.lines {
            let points = if points { &line.truth } else { &line.estimate };
            for (i, p) in points.iter().enumerate() {
                let (x, y) = (p.x * layout.scale, p.y * layout.scale);
                let far = x.abs().max(y.abs()) > 1e6;
                let (x, y) = if far {
                    (x.clamp(-1e6, 1e6), y.clamp(-1e6, 1e6))
                } else {
                    (x, y)
                };
                let _ = write!(path, "{}{x:.1} {y:.1}", if i == 0 { 'M' } else { 'L' });
            }
        }
        if !path.is_empty() {
            // A dark line below, so that the lines are visible on bright images too.
            let _ = writeln!(
                svg,
                r##"<path stroke="#000000" stroke-width="3" stroke-opacity="0.4" d="{path}"/><path stroke="{colour}"{dash} d="{path}"/>"##
            );
        }
    }
    svg.push_str(
        "</svg>\n<g class=\"epipolar\" fill=\"none\" stroke=\"#ffffff\" stroke-width=\"1.2\">\n",
    );
    for line in &view.lines {
        for (x, y) in [layout.a(line.a), layout.b(line.b)] {
            let _ = writeln!(svg, r#"<circle cx="{x:.1}" cy="{y:.1}" r="4.5"/>"#);
        }
    }
    svg.push_str("</g>\n");
}

/// The legend of colours and lines, with the numbers over all matches.
fn key(svg: &mut String, top: f64, view: &PairView, limit: usize) {
    let tally = &view.tally;
    let sample = |svg: &mut String, (x, y): (f64, f64), colour: &str, dash: &str, name: &str| {
        let _ = writeln!(
            svg,
            r#"<path stroke="{colour}" stroke-width="3" stroke-dasharray="{dash}" d="M{x:.1} {:.1}h22"/>"#,
            y - 4.0
        );
        text(svg, "ink", (x + 28.0, y), "start", &escape(name));
    };
    for (class, (colour, name)) in DISTANCES.into_iter().enumerate() {
        let count =
            (tally.by_distance).map_or(String::new(), |counts| format!(": {}", counts[class]));
        let x = 12.0 + 160.0 * class as f64;
        sample(svg, (x, top), colour, "none", &format!("{name}{count}"));
    }
    let at = (12.0 + 160.0 * DISTANCES.len() as f64, top);
    let (error, lines) = match view.model {
        Model::Pose => (
            "Sampson distance from the truth",
            "circles: matches whose epipolar lines are drawn, true white, estimated yellow",
        ),
        Model::Homography => (
            "transfer error: from the true place",
            "frame of the first image in the second: true white, estimated yellow",
        ),
    };
    text(svg, "muted", at, "start", error);
    let agree = format!(
        "within {} px of the estimate: {}",
        agrees_below(view.model),
        tally.agree
    );
    sample(svg, (12.0, top + 18.0), MUTED, "none", &agree);
    let others = format!("the others: {}", tally.matches - tally.agree);
    sample(svg, (252.0, top + 18.0), MUTED, "4 3", &others);
    let shown = view.matches.len().min(limit);
    let shown = format!("{shown} of {} matches are drawn", tally.matches);
    text(svg, "muted", (412.0, top + 18.0), "start", &shown);
    let magenta = if view.has_keypoints() {
        "; magenta: keypoints"
    } else {
        ""
    };
    let below = format!("{lines}{magenta}");
    text(svg, "muted", (12.0, top + 36.0), "start", &below);
}
