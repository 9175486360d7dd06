//! Figures as PNG, for slides and documents that take no SVG.
//!
//! Text is set in the first common sans-serif typeface that the machine has; where there is none,
//! the picture has no text, and the SVG beside it has.

use std::io;
use std::sync::{Arc, OnceLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

/// Typefaces in the order in which they are preferred.
const TYPEFACES: [&str; 7] = [
    "Inter",
    "Helvetica",
    "Arial",
    "Liberation Sans",
    "Noto Sans",
    "DejaVu Sans",
    "Segoe UI",
];

/// The drawing as a PNG file, `scale` pixels for one unit.
///
/// # Errors
/// A drawing that is no SVG, or too large for memory.
pub(super) fn png(svg: &str, scale: f32) -> io::Result<Vec<u8>> {
    let options = Options {
        fontdb: fonts(),
        ..Options::default()
    };
    let tree = Tree::from_str(svg, &options).map_err(io::Error::other)?;
    let size = tree.size().to_int_size();
    let side = |side: u32| (side as f32 * scale).ceil() as u32;
    let mut pixels = Pixmap::new(side(size.width()), side(size.height()))
        .ok_or_else(|| io::Error::other("a picture of this size cannot be drawn"))?;
    let transform = Transform::from_scale(scale, scale);
    resvg::render(&tree, transform, &mut pixels.as_mut());
    pixels.encode_png().map_err(io::Error::other)
}

/// The typefaces of this machine, which take a moment to find.
fn fonts() -> Arc<fontdb::Database> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = fontdb::Database::new();
        fonts.load_system_fonts();
        let known = |name: &&str| {
            let mut families = fonts.faces().flat_map(|face| &face.families);
            families.any(|(family, _)| family == *name)
        };
        if let Some(name) = TYPEFACES.into_iter().find(|name| known(name)) {
            fonts.set_sans_serif_family(name);
            fonts.set_serif_family(name);
        }
        Arc::new(fonts)
    };
    Arc::clone(FONTS.get_or_init(load))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_becomes_pixels() {
        let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="4" height="2" viewBox="0 0 4 2"><rect width="4" height="2" fill="#ff0000"/></svg>"##;
        let file = png(svg, 2.0).expect("it is well-formed");
        let image = image::load_from_memory(&file)
            .expect("a PNG file")
            .to_rgba8();
        assert_eq!(image.dimensions(), (8, 4));
        assert_eq!(image.get_pixel(5, 2).0, [255, 0, 0, 255]);
        assert!(png("no drawing", 1.0).is_err());
    }
}
