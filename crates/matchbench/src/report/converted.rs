//! Drawings (SVG) in the forms of other programs: PNG for slides, PDF for LaTeX.
//!
//! Text is set in DejaVu Sans, which is part of the program. So pictures look the same on every machine, also
//! on one without fonts. Only characters that this font lacks are taken from the fonts of the machine. A PDF holds
//! the characters that it shows.

use std::io;
use std::sync::{Arc, OnceLock};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ColorType, ImageEncoder};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};
use svg2pdf::{ConversionOptions, PageOptions};

/// Name of the font that is part of the program.
const TYPEFACE: &str = "DejaVu Sans";

/// Dots per inch at which a unit of a drawing is a point of a page.
const POINTS: f32 = 72.0;

/// Most pixels of a file: a figure of hundreds of methods has no other bound.
const MAX_PIXELS: f32 = 50e6;

/// The drawing as a PNG file, `scale` pixels for one unit, or fewer where it would have more than 50 million pixels.
///
/// # Errors
/// If the drawing is not valid SVG, or too large for memory.
pub(super) fn png(svg: &str, scale: f32) -> io::Result<Vec<u8>> {
    let tree = parse(svg)?;
    let size = tree.size().to_int_size();
    let (scale, [width, height]) = bounded([size.width(), size.height()], scale);
    let mut pixels = Pixmap::new(width, height)
        .ok_or_else(|| io::Error::other("a picture of this size cannot be drawn"))?;
    let transform = Transform::from_scale(scale, scale);
    resvg::render(&tree, transform, &mut pixels.as_mut());
    let bytes: Vec<u8> = (pixels.pixels().iter())
        .flat_map(|pixel| {
            let colour = pixel.demultiply();
            [colour.red(), colour.green(), colour.blue(), colour.alpha()]
        })
        .collect();
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Default, FilterType::Adaptive)
        .write_image(&bytes, width, height, ColorType::Rgba8.into())
        .map_err(io::Error::other)?;
    Ok(file)
}

/// The drawing as a PDF file of one page, a point for one unit.
///
/// # Errors
/// If the drawing is not valid SVG.
pub(super) fn pdf(svg: &str) -> io::Result<Vec<u8>> {
    let page = PageOptions { dpi: POINTS };
    svg2pdf::to_pdf(&parse(svg)?, ConversionOptions::default(), page)
        .map_err(|error| io::Error::other(error.to_string()))
}

fn parse(svg: &str) -> io::Result<Tree> {
    let options = Options {
        fontdb: fonts(),
        ..Options::default()
    };
    Tree::from_str(svg, &options).map_err(io::Error::other)
}

/// The scale of a drawing with these sides, lowered if necessary, and its sides in pixels.
fn bounded(sides: [u32; 2], scale: f32) -> (f32, [u32; 2]) {
    let [width, height] = sides.map(|side| side as f32);
    let most = (MAX_PIXELS / (width * height)).sqrt();
    if scale <= most {
        (
            scale,
            [width, height].map(|side| (side * scale).ceil() as u32),
        )
    } else {
        let pixels = |side: f32| ((side * most).floor() as u32).max(1);
        (most, [width, height].map(pixels))
    }
}

/// Our font, then the fonts of this machine, which take a moment to find.
fn fonts() -> Arc<fontdb::Database> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = fontdb::Database::new();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.load_system_fonts();
        // After the fonts of the machine, whose settings name others.
        fonts.set_sans_serif_family(TYPEFACE);
        fonts.set_serif_family(TYPEFACE);
        Arc::new(fonts)
    };
    Arc::clone(FONTS.get_or_init(load))
}

#[cfg(test)]
mod tests {
    use super::super::pair_view::Thumbnail;
    use super::super::svg::data_url;
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
    fn a_drawing_becomes_a_page_with_text() {
        let svg = r#"<svg xmlns="http://www.w3.org/2000/svg" width="400" height="200"><text x="2" y="15" font-family="sans-serif" font-size="14">AUC</text></svg>"#;
        let file = pdf(svg).expect("it is well-formed");
        let holds = |part: &[u8]| file.windows(part.len()).any(|bytes| bytes == part);
        assert!(file.starts_with(b"%PDF-") && holds(b"/MediaBox [0 0 400 200]"));
        assert!(holds(b"DejaVuSans") && holds(b"/Subtype /Type0"));
        assert_eq!(pdf(svg).expect("as before"), file);
        assert!(pdf("no drawing").is_err());
    }

    #[test]
    fn large_drawings_have_a_lower_scale() {
        assert_eq!(bounded([400, 300], 2.0), (2.0, [800, 600]));
        for sides in [[10_000, 10_000], [1_000_000, 300], [300, 40_000_000]] {
            let (scale, [width, height]) = bounded(sides, 2.0);
            let pixels = u64::from(width) * u64::from(height);
            assert!(
                scale < 2.0 && (40_000_000..=50_000_000).contains(&pixels),
                "{pixels}"
            );
        }
    }

    #[test]
    fn a_page_has_the_pictures_of_a_drawing() {
        let gray = image::GrayImage::from_pixel(8, 8, image::Luma([90]));
        let mut jpeg = io::Cursor::new(Vec::new());
        gray.write_to(&mut jpeg, image::ImageFormat::Jpeg)
            .expect("in memory");
        let url = data_url(&Thumbnail {
            original: (8, 8),
            jpeg: jpeg.into_inner(),
        });
        let svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="8" height="8"><image href="{url}" width="8" height="8"/></svg>"#
        );
        let file = pdf(&svg).expect("it is well-formed");
        let part = b"/Subtype /Image";
        assert!(file.windows(part.len()).any(|bytes| bytes == part));
    }

    #[test]
    fn settings_of_the_machine_do_not_choose_the_typeface() {
        let families = [fontdb::Family::SansSerif, fontdb::Family::Serif];
        let fonts = fonts();
        assert_eq!(
            families.map(|family| fonts.family_name(&family).to_owned()),
            [TYPEFACE; 2]
        );
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
