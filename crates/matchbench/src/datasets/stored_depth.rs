//! The values of a depth image as a file stores them: 16-bit integers of PNG and PGM, or the floats of an HDF5 file.

use std::path::Path;

use image::codecs::pnm::PnmDecoder;
use image::{DynamicImage, ImageFormat};
use matchbench_vision::image::{Image, Size};

use super::decode::with_other;
use super::decode_error::{DecodeError, check_size, decoded};
use super::{DatasetError, Turn};
use crate::arrays::Hdf5;
use crate::memory::reserve;

/// The array with the depth in an HDF5 file, as MegaDepth has it.
const ARRAY: &str = "depth";
/// The largest value of a PGM that has 16 bits and is not scaled.
const FULL: u32 = 0xffff;

/// The values of a depth image.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum StoredDepth {
    Integers(Image<u16>),
    Floats(Image<f32>),
}

impl StoredDepth {
    /// Decodes the `bytes` of the file at `path`.
    ///
    /// # Errors
    /// If they are neither a complete image of one 16-bit value per pixel nor an HDF5 file with an array `depth` of
    /// height x width numbers.
    pub(super) fn decode(path: &Path, bytes: Vec<u8>) -> Result<Self, DatasetError> {
        if !Hdf5::is_it(&bytes) {
            let stored = decode_depth(&bytes).map_err(|error| error.in_file(path))?;
            return Ok(Self::Integers(stored));
        }
        let file = Hdf5::of_bytes(path, bytes).map_err(DatasetError::of_array)?;
        let size = match file.stated_shape(ARRAY).as_deref() {
            Some(&[height, width]) => Size::new(width, height),
            Some(other) => {
                let what =
                    format!("its array `{ARRAY}` has the shape {other:?}, not [height, width]");
                return Err(DatasetError::new(
                    path,
                    what,
                    "store one number for each pixel",
                ));
            }
            // Reading it says why.
            None => Size::new(0, 0),
        };
        let size = check_size(size).map_err(|error| error.in_file(path))?;
        // Stored numbers have up to 8 bytes, ours 4.
        let _memory = reserve(12 * size.area())
            .map_err(|missing| DecodeError::NoMemory(size, missing).in_file(path))?;
        let array = file.array(ARRAY).map_err(DatasetError::of_array)?;
        Ok(Self::Floats(Image::from_vec(size, array.to_f32())))
    }

    pub(super) fn size(&self) -> Size {
        match self {
            Self::Integers(stored) => stored.size(),
            Self::Floats(stored) => stored.size(),
        }
    }

    #[must_use]
    pub(super) fn turned(self, turn: Turn) -> Self {
        match self {
            Self::Integers(stored) => Self::Integers(turn.pixels(stored)),
            Self::Floats(stored) => Self::Floats(turn.pixels(stored)),
        }
    }

    /// The value of a pixel; `None` if it is none of a depth, or is `invalid`.
    pub(super) fn at(&self, x: usize, y: usize, invalid: Option<u16>) -> Option<f64> {
        let value = match self {
            Self::Integers(stored) => f64::from(stored.at(x, y)),
            Self::Floats(stored) => f64::from(stored.at(x, y)),
        };
        let measured = value > 0.0 && value.is_finite() && invalid.map(f64::from) != Some(value);
        measured.then_some(value)
    }

    /// Bytes of memory that it takes.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Integers(stored) => size_of_val(stored.data()),
            Self::Floats(stored) => size_of_val(stored.data()),
        }
    }
}

/// Decodes the 16-bit values in `bytes`.
///
/// # Errors
/// If they are not a complete image of one 16-bit value per pixel.
pub fn decode_depth(bytes: &[u8]) -> Result<Image<u16>, DecodeError> {
    decoded(|| {
        check_largest(bytes)?;
        with_other(bytes, 0, |size, image, _| match image {
            DynamicImage::ImageLuma16(depth) => Ok(Image::from_vec(size, depth.into_raw())),
            other => Err(DecodeError::NoDepth(format!("{:?}", other.color()))),
        })
    })
}

/// Refuses a PGM with another largest value than 65535, since its decoder would scale what is stored up to that.
fn check_largest(bytes: &[u8]) -> Result<(), DecodeError> {
    if !matches!(image::guess_format(bytes), Ok(ImageFormat::Pnm)) {
        return Ok(());
    }
    // What is wrong with a header shows when it is decoded.
    let header = PnmDecoder::new(bytes).map(|decoder| decoder.into_inner().1);
    match header.map_or(FULL, |header| header.maximal_sample()) {
        FULL => Ok(()),
        other => Err(DecodeError::NoDepth(format!(
            "the largest value is {other} by its header, not {FULL}"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use image::ExtendedColorType;

    use super::*;
    use crate::arrays::Hdf5Out;

    /// An HDF5 file with this array.
    fn hdf5(name: &str, shape: &[usize], values: &[f32]) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.h5");
        let mut out = Hdf5Out::default();
        out.floats(name.into(), shape, values);
        out.write(&path).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn floats_of_hdf5_are_read_row_by_row() {
        let values = [0.5, 2.0, 0.0, -1.0, f32::NAN, f32::INFINITY];
        let bytes = hdf5("depth", &[2, 3], &values);
        let depth = StoredDepth::decode(Path::new("d.h5"), bytes).unwrap();
        assert_eq!((depth.size(), depth.bytes()), (Size::new(3, 2), 24));
        let all: Vec<_> = (0..6).map(|i| depth.at(i % 3, i / 3, None)).collect();
        assert_eq!(all, [Some(0.5), Some(2.0), None, None, None, None]);
        assert_eq!(depth.at(1, 0, Some(2)), None);
        let turned = depth.turned(Turn::Quarter);
        assert_eq!(turned.at(0, 1, None), Some(2.0));
    }

    #[test]
    fn other_arrays_are_refused() {
        for (name, shape, what) in [
            ("depth", &[6][..], "has the shape [6], not [height, width]"),
            ("depth", &[1, 2, 3], "has the shape [1, 2, 3]"),
            ("z", &[2, 3], "array `depth`: "),
        ] {
            let bytes = hdf5(name, shape, &[1.0; 6]);
            let error = StoredDepth::decode(Path::new("d.h5"), bytes).unwrap_err();
            let error = error.to_string();
            assert!(
                error.starts_with("d.h5: ") && error.contains(what),
                "{error}"
            );
        }
        let wide = hdf5("depth", &[1, 70_000], &vec![1.0; 70_000]);
        let error = StoredDepth::decode(Path::new("d.h5"), wide).unwrap_err();
        assert!(error.what.contains("more than the limit"), "{error}");
        let bytes = hdf5("depth", &[2, 3], &[1.0; 6]);
        for length in (0..bytes.len()).step_by(7) {
            let cut = bytes[..length].to_vec();
            assert!(
                StoredDepth::decode(Path::new("d.h5"), cut).is_err(),
                "{length}"
            );
        }
    }

    #[test]
    fn what_is_not_16_bits_of_gray_is_refused() {
        let mut png = Vec::new();
        let mut write = |bytes: &[u8], colour| {
            png.clear();
            let out = &mut std::io::Cursor::new(&mut png);
            image::write_buffer_with_format(out, bytes, 2, 1, colour, ImageFormat::Png).unwrap();
            decode_depth(&png)
        };
        let read = write(&[1, 0, 2, 0], ExtendedColorType::L16).unwrap();
        assert_eq!(
            read.data(),
            [u16::from_ne_bytes([1, 0]), u16::from_ne_bytes([2, 0])]
        );
        let gray = write(&[1, 2], ExtendedColorType::L8)
            .unwrap_err()
            .to_string();
        assert!(gray.contains("16-bit"), "{gray}");
        assert!(write(&[1; 6], ExtendedColorType::Rgb8).is_err());
        assert_eq!(
            decode_depth(b"P5 2 1 65535\n\0\x01"),
            Err(DecodeError::Truncated)
        );
        assert_eq!(
            decode_depth(b"P5 2 1 65535\n\0\x01\x01\0").unwrap().data(),
            [1, 256]
        );
    }

    #[test]
    fn a_pgm_whose_values_would_be_scaled_is_refused() {
        for file in ["P5 1 1 10000\n\x03\x01", "P2 1 1 10000\n 769"] {
            let error = decode_depth(file.as_bytes()).unwrap_err().to_string();
            let named = "the largest value is 10000 by its header, not 65535, and depth is one 16-bit value";
            assert!(error.contains(named), "{error}");
        }
    }
}
