//! Reads from an image file how the camera was held, and nothing else.

use std::io::Cursor;

use image::{ImageDecoder, ImageReader};
use zune_core::bytestream::ZCursor;

use super::decode::{JPEG_MAGIC, jpeg_header, limits};
use super::decode_error::decoded;

/// The orientation of the image in `bytes`, as EXIF numbers it: 1 if pixels are stored upright or the file does
/// not say.
pub(super) fn orientation_of(bytes: &[u8]) -> u16 {
    let found = decoded(|| {
        Ok(if bytes.starts_with(&JPEG_MAGIC) {
            jpeg_header(ZCursor::new(bytes))?
                .exif()
                .and_then(|exif| orientation(exif))
        } else {
            orientation_of_other(bytes)
        })
    });
    found.ok().flatten().unwrap_or(1)
}

/// The same for what is not a JPEG.
fn orientation_of_other(bytes: &[u8]) -> Option<u16> {
    let mut reader = (ImageReader::new(Cursor::new(bytes)).with_guessed_format()).ok()?;
    reader.limits(limits(0));
    let orientation = reader.into_decoder().ok()?.orientation().ok()?;
    Some(orientation.to_exif().into())
}

/// The orientation tag (0x0112) in the first directory of a TIFF block, as EXIF embeds it.
fn orientation(exif: &[u8]) -> Option<u16> {
    let exif = exif.strip_prefix(b"Exif\0\0").unwrap_or(exif);
    let little = exif.starts_with(b"II");
    let u16_at = |at: usize| {
        let bytes: [u8; 2] = exif.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if little {
            u16::from_le_bytes(bytes)
        } else {
            u16::from_be_bytes(bytes)
        })
    };
    let u32_at = |at: usize| {
        let (first, second) = (u32::from(u16_at(at)?), u32::from(u16_at(at + 2)?));
        Some(if little {
            second << 16 | first
        } else {
            first << 16 | second
        })
    };
    let directory = u32_at(4)? as usize;
    (0..usize::from(u16_at(directory)?))
        .map(|entry| directory + 2 + 12 * entry)
        .find(|&entry| u16_at(entry) == Some(0x0112))
        .and_then(|entry| u16_at(entry + 8))
}

#[cfg(test)]
mod tests {
    use image::codecs::png::PngEncoder;
    use image::{ExtendedColorType, ImageEncoder};
    use proptest::prelude::*;

    use super::*;

    /// An image of this repository; see `decode`.
    fn fixture(name: &str) -> Vec<u8> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/images/");
        std::fs::read(format!("{folder}{name}")).expect("part of the repository")
    }

    #[test]
    fn a_turned_picture_is_known_by_its_tag() {
        assert_eq!(orientation_of(&fixture("turned.jpg")), 6);
        for upright in ["color.jpg", "color.png", "color.webp", "color.tif"] {
            assert_eq!(orientation_of(&fixture(upright)), 1, "{upright}");
        }
        assert_eq!(orientation_of(b""), 1);
    }

    #[test]
    fn pictures_that_are_no_jpegs_have_the_tag_too() {
        let exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
        let mut png = Vec::new();
        let mut encoder = PngEncoder::new(&mut png);
        encoder.set_exif_metadata(exif.to_vec()).unwrap();
        (encoder.write_image(&[1, 2], 2, 1, ExtendedColorType::L8)).unwrap();
        assert_eq!(orientation_of(&png), 6);
    }

    #[test]
    fn both_byte_orders_are_read() {
        let little = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0";
        let big = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x08\0\0";
        assert_eq!(orientation(little), Some(6));
        assert_eq!(orientation(big), Some(8));
        assert_eq!(orientation(&little[..20]), None);
        // The tag is the second of two, each of twelve bytes.
        let mut second = b"II*\0\x08\0\0\0\x02\0\x0f\x01\x02\0\x01\0\0\0\x05\0\0\0".to_vec();
        second.extend(b"\x12\x01\x03\0\x01\0\0\0\x03\0\0\0");
        assert_eq!(orientation(&second), Some(3));
        assert_eq!(orientation(b""), None);
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..60)) {
            let _ = orientation(&bytes);
        }

        #[test]
        fn damaged_files_do_not_panic(which in 0..4_usize, at in 0..2000_usize, byte in any::<u8>()) {
            let names = ["turned.jpg", "color.webp", "palette.png", "color.tif"];
            let mut bytes = fixture(names[which]);
            let at = at % bytes.len();
            bytes[at] = byte;
            let _ = orientation_of(&bytes);
        }
    }
}
