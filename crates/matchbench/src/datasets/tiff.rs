//! Checks the order of bits in a TIFF file, which its decoder ignores.
//!
//! TIFF 6.0 allows pixels to begin at the lowest bit of each byte (FillOrder 2) and recommends it for nothing. It is
//! clear what this means for one bit per pixel. For more bits, and for data that are compressed, programs differ.

use std::io::Cursor;

use tiff::decoder::Decoder;
use tiff::tags::Tag;

use super::DecodeError;

/// Checks that bytes begin at their highest bit.
///
/// # Errors
/// If they do not.
pub(super) fn check_order_of_bits(bytes: &[u8]) -> Result<(), DecodeError> {
    // What is wrong with the rest of the file shows when it is decoded.
    let order = (Decoder::new(Cursor::new(bytes)))
        .and_then(|mut file| file.find_tag_unsigned::<u64>(Tag::FillOrder));
    match order {
        Ok(None | Some(1)) | Err(_) => Ok(()),
        Ok(Some(order)) => Err(DecodeError::Unsupported(format!(
            "a TIFF whose pixels begin at the lowest bit of a byte (FillOrder {order}, not 1)"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{decode_gray, testing};

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
}
