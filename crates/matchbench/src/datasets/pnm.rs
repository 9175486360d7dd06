//! Checks the samples of a PNM file (PGM, PPM, PAM), which its decoder scales without a look.

use image::codecs::pnm::{PnmDecoder, PnmSubtype, SampleEncoding};

use super::DecodeError;

/// Checks that no sample is above the largest value that the header states.
///
/// # Errors
/// If one is; the first of them.
pub(super) fn check_samples(bytes: &[u8]) -> Result<(), DecodeError> {
    // What is wrong with a header shows when it is decoded.
    let Ok(decoder) = PnmDecoder::new(bytes) else {
        return Ok(());
    };
    let (raster, header) = decoder.into_inner();
    let channels = match header.subtype() {
        PnmSubtype::Bitmap(_) => return Ok(()),
        PnmSubtype::Graymap(_) => 1,
        PnmSubtype::Pixmap(_) => 3,
        PnmSubtype::ArbitraryMap => header.as_arbitrary().map_or(0, |map| map.depth as usize),
    };
    let [width, height] = [header.width(), header.height()].map(|side| side as usize);
    // Another image may follow.
    let count = width.saturating_mul(height).saturating_mul(channels);
    let most = header.maximal_sample();
    let is_above = |value: &u32| *value > most;
    let above = match (header.subtype().sample_encoding(), most) {
        (SampleEncoding::Binary, 0xff | 0xffff) => None,
        (SampleEncoding::Binary, ..0xff) => {
            let samples = raster.iter().take(count);
            samples.map(|&byte| byte.into()).find(is_above)
        }
        (SampleEncoding::Binary, _) => {
            let samples = raster.as_chunks().0.iter().take(count);
            samples
                .map(|&two| u16::from_be_bytes(two).into())
                .find(is_above)
        }
        (SampleEncoding::Ascii, _) => {
            let words = raster.split(|byte| matches!(byte, b' ' | b'\t'..=b'\r'));
            let samples = words.filter(|word| !word.is_empty()).take(count);
            samples.filter_map(number).find(is_above)
        }
    };
    above.map_or(Ok(()), |value| {
        Err(DecodeError::AboveLargest { value, most })
    })
}

/// What is no number shows when it is decoded.
fn number(word: &[u8]) -> Option<u32> {
    str::from_utf8(word).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::super::{decode_gray, decode_planes, read_gray};
    use super::*;

    #[test]
    fn a_sample_above_the_largest_value_is_refused() {
        let above = |value, most| Err(DecodeError::AboveLargest { value, most });
        for (file, value, most) in [
            (&b"P2 3 1 15\n15 0\x0b16\n"[..], 16, 15),
            (b"P2 2 1 255 255 300\n", 300, 255),
            (b"P3 1 1 1023\n1023 7 1024", 1024, 1023),
            (b"P5 2 1 100\nd\xc8", 200, 100),
            (b"P5 2 1 4095\n\x0f\xff\x10\0", 4096, 4095),
            (b"P6 1 1 100\nde\0", 101, 100),
            (b"P6 1 1 256\n\x01\0\0\0\x01\x01", 257, 256),
            (b"P7\nWIDTH 1\nHEIGHT 1\nDEPTH 2\nMAXVAL 9\nTUPLTYPE GRAYSCALE_ALPHA\nENDHDR\n\x09\x0a", 10, 9),
        ] {
            assert_eq!(decode_gray(file), above(value, most).map(|()| unreachable!()));
            assert!(decode_planes(file).is_err());
        }
        for sound in [
            &b"P2 3 1 15\n15 0 1\n"[..],
            b"P5 2 1 100\nd\0P5 1 1 255\n\xff",
            b"P5 2 1 4095\n\x0f\xff\0\0",
            b"P6 1 1 255\n\xff\xff\xff",
            b"P4 3 1\n\xff",
        ] {
            assert!(decode_gray(sound).is_ok(), "{}", sound.escape_ascii());
        }
    }

    #[test]
    fn the_message_names_the_file_the_value_and_the_largest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("7.pgm");
        std::fs::write(&path, b"P5 2 1 100\nd\xc8").unwrap();
        let error = read_gray(&path).unwrap_err();
        assert_eq!(error.file, path);
        assert_eq!(
            error.what,
            "the image has a sample of 200, and 100 is the largest by its header"
        );
    }
}
