//! Figures as PNG, for slides and documents that cannot hold SVG.
//!
//! Text is set in DejaVu Sans, which is part of the program. So pictures look the same on every machine, also
//! on one without fonts. Only characters that this font lacks are taken from the fonts of the machine.

use std::io;
use std::sync::{Arc, OnceLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

/// Name of the font that is part of the program.
const TYPEFACE: &str = "DejaVu Sans";

/// The drawing as a PNG file, `scale` pixels for one unit.
///
/// # Errors
/// If the drawing is not valid SVG, or too large for memory.
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

/// Our font, then the fonts of this machine, which take a moment to find.
fn fonts() -> Arc<fontdb::Database> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = fontdb::Database::new();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.set_sans_serif_family(TYPEFACE);
        fonts.set_serif_family(TYPEFACE);
        fonts.load_system_fonts();
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

    #[test]
    fn text_needs_no_typeface_of_the_machine() {
        let mut options = Options::default();
        let fonts = options.fontdb_mut();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.set_sans_serif_family(TYPEFACE);
        let svg = r#"<svg xmlns="http://www.w3.org/2000/svg" width="40" height="20"><text x="2" y="15" font-family="sans-serif" font-size="14">AUC</text></svg>"#;
        let tree = Tree::from_str(svg, &options).expect("it is well-formed");
        let mut pixels = Pixmap::new(40, 20).expect("small");
        resvg::render(&tree, Transform::identity(), &mut pixels.as_mut());
        assert!(
            pixels.data().iter().any(|&value| value > 0),
            "nothing was drawn"
        );
    }
}
