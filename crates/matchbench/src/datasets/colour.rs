//! Image files in colour, for people to look at; matchers get grey images only (see `decode`).
//!
//! A picture has one plane of grey values, or three planes: red, green and blue. A colour file whose pixels are
//! all grey has one plane.

use std::path::Path;

use image::DynamicImage;
use matchbench_vision::image::{GrayImage, Size};

use super::decode::{COLOUR_BYTES, JPEG_MAGIC, gray_of_other, jpeg_pixels, with_other};
use super::decode_error::decoded;
use super::{DatasetError, DecodeError};
use crate::files::read_file;

/// The planes of the image at `path`: gray, or red, green and blue.
///
/// # Errors
/// If the file cannot be read or is no complete image.
pub fn read_planes(path: &Path) -> Result<Vec<GrayImage>, DatasetError> {
    let bytes = read_file(path).map_err(|error| DatasetError::io(path, &error))?;
    decode_planes(&bytes).map_err(|error| error.in_file(path))
}

/// The planes of the image in `bytes`.
///
/// # Errors
/// If they are no complete image of a supported format.
pub fn decode_planes(bytes: &[u8]) -> Result<Vec<GrayImage>, DecodeError> {
    decoded(|| {
        if bytes.starts_with(&JPEG_MAGIC) {
            let (size, channels, data) = jpeg_pixels(bytes, true)?;
            return Ok(planes(size, channels, &data));
        }
        with_other(bytes, COLOUR_BYTES, |size, image, rule| {
            if image.color().has_color() {
                // If no grey image can be made of it, no colour image can either.
                if matches!(
                    image,
                    DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_)
                ) {
                    return gray_of_other(size, image, rule).map(|gray| vec![gray]);
                }
                Ok(planes(size, 3, &image.into_rgb8()))
            } else {
                gray_of_other(size, image, rule).map(|gray| vec![gray])
            }
        })
    })
}

/// Separates interleaved channels. If all are the same, only one is returned.
fn planes(size: Size, channels: usize, data: &[u8]) -> Vec<GrayImage> {
    let plane = |channel: usize| {
        let values = data.iter().skip(channel).step_by(channels).copied();
        GrayImage::from_vec(size, values.collect())
    };
    let is_gray = data
        .chunks_exact(channels)
        .all(|pixel| pixel.iter().all(|value| *value == pixel[0]));
    (0..if is_gray { 1 } else { channels }).map(plane).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str) -> Vec<u8> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/images/");
        std::fs::read(format!("{folder}{name}")).expect("part of the repository")
    }

    #[test]
    fn colour_has_three_planes_and_gray_has_the_one_that_matchers_see() {
        for name in [
            "color.png",
            "color.jpg",
            "adobe-rgb.jpg",
            "color.bmp",
            "color.ppm",
            "color.tif",
            "color.webp",
        ] {
            let planes = decode_planes(&file(name)).expect("whole");
            assert_eq!(planes.len(), 3, "{name}");
            let gray = super::super::decode_gray(&file(name)).expect("whole");
            assert!(
                planes.iter().all(|plane| plane.size() == gray.size()),
                "{name}"
            );
            // Grey is the usual weighted mean of the planes, up to rounding. The colours of a JPEG are cut off
            // at 0 and 255.
            let apart = (0..gray.size().area())
                .filter(|&i| {
                    let [r, g, b] =
                        [0, 1, 2].map(|plane: usize| f64::from(planes[plane].data()[i]));
                    let mean = 0.299 * r + 0.587 * g + 0.114 * b;
                    (mean - f64::from(gray.data()[i])).abs() > 2.0
                })
                .count();
            assert!(apart * 50 <= gray.size().area(), "{name}: {apart} pixels");
        }
        for name in ["gray.jpg", "gray16.png", "one-bit.png"] {
            let gray = super::super::decode_gray(&file(name)).expect("whole");
            assert_eq!(decode_planes(&file(name)), Ok(vec![gray]), "{name}");
        }
        assert!(decode_planes(&file("cmyk.jpg")).is_err());
        assert!(decode_planes(&file("color.png")[..99]).is_err());
    }

    #[test]
    fn colours_that_are_all_gray_are_gray() {
        let size = Size::new(2, 1);
        assert_eq!(planes(size, 3, &[7, 7, 7, 9, 9, 9]).len(), 1);
        let found = planes(size, 3, &[7, 7, 7, 9, 8, 9]);
        assert_eq!(found[1].data(), [7, 8]);
        assert_eq!(found.len(), 3);
    }
}
