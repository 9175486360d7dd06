//! A pair as a file of its own.

use std::io;

use super::pair_view::PairView;
use super::raster::png;
use super::svg::{Target, pair};

/// Most matches drawn: more hide each other.
const MOST_MATCHES: usize = 250;

/// The pair as SVG with both images in it, under a caption.
pub fn picture_svg(view: &PairView, caption: &str) -> String {
    pair(Target::File, view, caption, MOST_MATCHES)
}

/// The same as PNG, 2000 pixels wide.
///
/// # Errors
/// A picture that cannot be drawn (of images without pixels, or too large for memory).
pub fn picture_png(view: &PairView, caption: &str) -> io::Result<Vec<u8>> {
    png(&picture_svg(view, caption), 2.0)
}
