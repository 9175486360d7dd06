//! Says in words what of a TIFF file is not read. Its decoder names some of it by numbers, and ignores the order of bits.
//!
//! TIFF 6.0 allows pixels to begin at the lowest bit of each byte (FillOrder 2) and recommends it for nothing. It is
//! clear what this means for one bit per pixel. For more bits, and for data that are compressed, programs differ.

use std::io::{BufRead, Read, Seek};

use tiff::decoder::Decoder;
use tiff::tags::Tag;

use super::DecodeError;

/// Compressions that are not read, by their numbers.
const COMPRESSIONS: [(u64, &str); 7] = [
    (6, "JPEG of the old kind"),
    (34_712, "JPEG 2000"),
    (34_925, "LZMA"),
    (34_933, "PNG"),
    (50_000, "Zstandard"),
    (50_001, "WebP"),
    (50_002, "JPEG XL"),
];

/// Checks that the pixels are of a kind that is read, and goes back to the beginning of the file.
///
/// # Errors
/// If they are not, or bytes begin at their lowest bit.
pub(super) fn check_pixels(mut file: impl Read + Seek) -> Result<(), DecodeError> {
    // What is wrong with the rest of the file shows when it is decoded.
    let unread = Decoder::new(&mut file)
        .ok()
        .and_then(|mut file| unread_pixels(&mut file));
    file.rewind().map_err(|_| DecodeError::Truncated)?;
    match unread {
        None => Ok(()),
        Some(what) => Err(DecodeError::Unsupported(format!("a TIFF {what}"))),
    }
}

/// What pixels are that are not read.
fn unread_pixels(file: &mut Decoder<impl Read + Seek>) -> Option<String> {
    // Some values are one for each channel.
    let mut values = |tag| {
        let found = file.find_tag_unsigned_vec::<u64>(tag).ok().flatten();
        found.unwrap_or_default()
    };
    let mut odd = |tag, usual: &[u64]| {
        let mut values = values(tag).into_iter();
        values.find(|value| !usual.contains(value))
    };
    if let Some(order) = odd(Tag::FillOrder, &[1]) {
        return Some(format!(
            "whose pixels begin at the lowest bit of a byte (FillOrder {order}, not 1)"
        ));
    }
    let compression = odd(Tag::Compression, &[1]);
    let known = |(number, _): &&(u64, &str)| Some(*number) == compression;
    if let Some((_, name)) = COMPRESSIONS.iter().find(known) {
        return Some(format!("that is compressed by {name}"));
    }
    match odd(Tag::PhotometricInterpretation, &[0, 1]) {
        Some(3) => return Some("with a palette".to_owned()),
        Some(6) => {
            return Some(
                "of brightness and two colours (YCbCr), as often in JPEG strips".to_owned(),
            );
        }
        Some(8..=10) => return Some("of L*a*b* colours".to_owned()),
        Some(_) => {}
        None => {
            if let Some(count) = odd(Tag::SamplesPerPixel, &[1]) {
                return Some(format!("of gray with {count} values per pixel"));
            }
        }
    }
    match odd(Tag::SampleFormat, &[1]) {
        Some(2) => return Some("of integers with a sign".to_owned()),
        Some(3) => return Some("of floating-point values".to_owned()),
        _ => {}
    }
    let bits = odd(Tag::BitsPerSample, &[1, 8, 16])?;
    Some(format!("of {bits} bits per value (1, 8 and 16 are read)"))
}

/// Whether a file is a BigTIFF, for files of more than 4 GB.
pub(super) fn is_big(mut file: impl BufRead) -> bool {
    let head = file.fill_buf().unwrap_or_default();
    head.starts_with(b"II+\0") || head.starts_with(b"MM\0+")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::{decode_gray, read_gray, read_size, testing};

    #[test]
    fn a_tiff_whose_bits_are_turned_is_refused() {
        // Ten pixels, of which all but two are white.
        let tiff = |order: &[(u16, u32)]| {
            let tags = [
                (256, 5),
                (257, 2),
                (258, 1),
                (259, 1),
                (262, 1),
                (277, 1),
                (278, 2),
            ];
            testing::tiff(&[&tags, order].concat(), &[0b0111_1000, 0b1110_1000])
        };
        let white = [0, 255, 255, 255, 255, 255, 255, 255, 0, 255];
        for usual in [&[][..], &[(266, 1)]] {
            assert_eq!(decode_gray(&tiff(usual)).unwrap().data(), white);
        }
        let error = decode_gray(&tiff(&[(266, 2)])).unwrap_err().to_string();
        assert_eq!(
            error,
            "unsupported pixels: a TIFF whose pixels begin at the lowest bit of a byte (FillOrder 2, not 1)"
        );
    }

    #[test]
    fn what_is_not_read_is_said_in_words_with_the_file_and_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("0001.tif");
        let of = |bits: u32, more: &[(u16, u32)]| {
            let tags = [(256, 1), (257, 1), (258, bits), (259, 1), (278, 1)];
            testing::tiff(&[&tags, more].concat(), &[0; 16])
        };
        let compressed = |number| {
            let tags = [(256, 1), (257, 1), (258, 8), (259, number)];
            let more = [(262, 1), (277, 1), (278, 1)];
            testing::tiff(&[&tags[..], &more].concat(), &[0; 16])
        };
        let big = |magic: &[u8]| [magic, &[0; 20]].concat();
        for (file, what) in [
            (of(8, &[(262, 3), (277, 1)]), "a TIFF with a palette"),
            (
                of(8, &[(262, 6), (277, 3)]),
                "a TIFF of brightness and two colours (YCbCr), as often in JPEG strips",
            ),
            (of(8, &[(262, 8), (277, 3)]), "a TIFF of L*a*b* colours"),
            (
                of(8, &[(262, 1), (277, 2)]),
                "a TIFF of gray with 2 values per pixel",
            ),
            (
                of(16, &[(262, 1), (277, 1), (339, 2)]),
                "a TIFF of integers with a sign",
            ),
            (
                of(32, &[(262, 1), (277, 1), (339, 3)]),
                "a TIFF of floating-point values",
            ),
            (
                of(32, &[(262, 1), (277, 1)]),
                "a TIFF of 32 bits per value (1, 8 and 16 are read)",
            ),
            (
                compressed(6),
                "a TIFF that is compressed by JPEG of the old kind",
            ),
            (compressed(34_712), "a TIFF that is compressed by JPEG 2000"),
            (compressed(50_000), "a TIFF that is compressed by Zstandard"),
            (big(b"II+\0"), "a BigTIFF"),
            (big(b"MM\0+"), "a BigTIFF"),
        ] {
            fs::write(&path, file).unwrap();
            for error in [read_gray(&path).unwrap_err(), read_size(&path).unwrap_err()] {
                assert_eq!(error.file, path);
                assert_eq!(error.what, format!("unsupported pixels: {what}"));
                assert_eq!(error.remedy, "convert it to a png of 8-bit gray or colour");
            }
        }
        for tags in [
            [(262, 0), (277, 1)],
            [(262, 1), (277, 1)],
            [(262, 2), (277, 3)],
        ] {
            assert!(decode_gray(&of(8, &tags)).is_ok(), "{tags:?}");
        }
    }
}
