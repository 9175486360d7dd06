//! A picture of a pair as a file of its own.

use std::io;

use super::converted::png;
use super::pair_view::PairView;
use super::svg::{Target, pair};

/// Most matches that are drawn; more would hide each other.
const MAX_MATCHES: usize = 250;

/// The pair as SVG with both images embedded, below a caption.
pub fn picture_svg(view: &PairView, caption: &str) -> String {
    pair(Target::File, view, caption, MAX_MATCHES)
}

/// The same as PNG, 2000 pixels wide.
///
/// # Errors
/// If the picture cannot be drawn (images without pixels, or too large for memory).
pub fn picture_png(view: &PairView, caption: &str) -> io::Result<Vec<u8>> {
    png(&picture_svg(view, caption), 2.0)
}
