//! Combines several drawings into one: rows of panels, or pictures side by side.

use std::fmt::Write as _;

use super::super::pair_view::Thumbnail;
use super::pair::data_url;
use super::{Target, escape, open, text};

/// Space between panels.
const GAP: f64 = 14.0;
/// Width of a picture, and space for its name below.
const PICTURE: f64 = 240.0;
const NAME: f64 = 22.0;

/// Rows of drawings, each a complete file, from the top left.
pub(in super::super) fn stack(rows: &[Vec<String>]) -> String {
    let mut body = String::new();
    let (mut width, mut top) = (0.0_f64, 0.0);
    for row in rows.iter().filter(|row| !row.is_empty()) {
        let (mut left, mut height) = (0.0, 0.0_f64);
        for panel in row {
            let (w, h) = size(panel);
            let place = format!(r#"<svg x="{left:.1}" y="{top:.1}" "#);
            body.push_str(&panel.replacen("<svg ", &place, 1));
            left += w + GAP;
            height = height.max(h);
        }
        width = width.max(left - GAP);
        top += height + GAP;
    }
    sheet((width, (top - GAP).max(0.0)), &body)
}

/// Pictures with their names below, so many in a row.
pub(in super::super) fn gallery(pictures: &[(&str, &Thumbnail)], columns: usize) -> String {
    let rows: Vec<Vec<String>> = (pictures.chunks(columns.max(1)))
        .map(|row| {
            row.iter()
                .map(|(name, image)| picture(name, image))
                .collect()
        })
        .collect();
    stack(&rows)
}

fn picture(name: &str, image: &Thumbnail) -> String {
    let (columns, rows) = image.original;
    let height = (PICTURE * rows as f64 / columns.max(1) as f64).round();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{PICTURE}\" height=\"{0}\" viewBox=\"0 0 {PICTURE} {0}\" \
         font-family=\"DejaVu Sans, Verdana, sans-serif\">\n<title>{1}</title>\n",
        height + NAME,
        escape(name)
    );
    let _ = writeln!(
        svg,
        r#"<image width="{PICTURE}" height="{height}" preserveAspectRatio="none" href="{}"/>"#,
        data_url(image)
    );
    let at = (PICTURE / 2.0, height + NAME - 7.0);
    text(&mut svg, "ink", at, "middle", &escape(name));
    svg.push_str("</svg>\n");
    svg
}

/// The drawing around panels, on white.
fn sheet(size: (f64, f64), body: &str) -> String {
    let mut svg = String::new();
    let size = (size.0.max(1.0).ceil(), size.1.max(1.0).ceil());
    open(&mut svg, Target::File, "sheet", size, "");
    svg.push_str(body);
    svg.push_str("</svg>\n");
    svg
}

/// Width and height, as the first tag of one of our drawings states them.
fn size(svg: &str) -> (f64, f64) {
    let side = |name: &str| {
        let rest = svg.split_once(&format!("{name}=\""))?.1;
        rest.split_once('"')?.0.parse().ok()
    };
    (
        side(" width").unwrap_or(0.0),
        side(" height").unwrap_or(0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_stand_beside_and_below_each_other() {
        let panel = |width: u32, height: u32| {
            format!(
                "<svg xmlns=\"x\" width=\"{width}\" height=\"{height}\"><rect width=\"9\"/></svg>\n"
            )
        };
        let svg = stack(&[
            vec![panel(100, 50), panel(60, 80)],
            vec![panel(120, 10)],
            vec![],
        ]);
        assert!(svg.contains(r#"width="174" height="104""#), "{svg}");
        assert!(svg.contains(r#"<svg x="114.0" y="0.0" "#), "{svg}");
        assert!(svg.contains(r#"<svg x="0.0" y="94.0" "#), "{svg}");
        assert_eq!(svg.matches("<svg ").count(), 4);
        assert!(stack(&[]).ends_with("</svg>\n"));
    }

    #[test]
    fn a_name_of_a_picture_is_text() {
        let image = Thumbnail {
            original: (640, 480),
            jpeg: vec![1, 2, 3],
        };
        let svg = gallery(&[("<b>", &image), ("two", &image)], 1);
        assert!(svg.contains("&lt;b&gt;") && !svg.contains("<b>"));
        assert!(
            svg.contains(r#"height="418""#),
            "two rows of 202 and a gap: {svg}"
        );
    }
}
