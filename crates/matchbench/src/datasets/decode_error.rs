//! Why an image cannot be decoded, and how large one may be.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use matchbench_vision::image::Size;

use super::DatasetError;
use crate::memory::TooMuch;
use crate::panics::caught;

/// Most pixels that an image may have unless another limit is set, 2^27 (e.g. 11,585 x 11,585). A file that
/// claims more has a damaged header or is an attack, and no memory is allocated for it.
pub const MAX_PIXELS: usize = 1 << 27;
/// Longest side of an image; the most that JPEG can say.
pub(super) const MAX_SIDE: usize = 65_535;

/// Why bytes are not an image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// The format is not one of those supported.
    #[error("not an image of a known format (png, jpeg, bmp, tiff, webp, pgm, ppm)")]
    UnknownFormat,
    /// The file ends too early.
    #[error("the image is truncated")]
    Truncated,
    /// The decoder found something that must not be there.
    #[error("the image is damaged: {0}")]
    Damaged(String),
    /// A sample is above the largest value that the header states.
    #[error("the image has a sample of {value}, and {most} is the largest by its header")]
    AboveLargest {
        /// The sample.
        value: u32,
        /// The largest value by the header.
        most: u32,
    },
    /// The decoder panicked, which it should do for no file.
    #[error("the decoder of the image panicked: {0}")]
    Panicked(String),
    /// Pixels of a kind that cannot be turned into gray (floating point, CMYK of a JPEG), or a kind of file that is not read.
    #[error("unsupported pixels: {0}")]
    Unsupported(String),
    /// Pixels that are no depth.
    #[error("{0}, and depth is one 16-bit value for each pixel")]
    NoDepth(String),
    /// More pixels than are allowed, in total or on a side.
    #[error("an image of {0} pixels, more than the limit of {limit} in all or of {MAX_SIDE} on a side", limit = most_pixels())]
    TooLarge(Size),
    /// There is not enough memory to decode it.
    #[error("it has {0} pixels, for which {1}")]
    NoMemory(Size, TooMuch),
}

impl DecodeError {
    fn remedy(&self) -> &'static str {
        match self {
            Self::UnknownFormat => {
                "convert it to png; if it should be one of these, copy or download it again"
            }
            Self::Truncated | Self::Damaged(_) => "copy or download the file again",
            Self::AboveLargest { .. } => {
                "write the largest value that it has into the header, or copy or download the file again"
            }
            Self::Panicked(_) => {
                "copy or download the file again; if it stays so, convert it to a png of 8-bit gray or colour"
            }
            Self::Unsupported(_) => "convert it to a png of 8-bit gray or colour",
            Self::NoDepth(_) => "store depth as a 16-bit gray png, or in HDF5",
            Self::TooLarge(_) => {
                "check the file, scale the image down, or raise MATCHBENCH_MAX_PIXELS"
            }
            Self::NoMemory(..) => "scale the image down, or set MATCHBENCH_MAX_MEMORY",
        }
    }

    pub(super) fn in_file(&self, path: &Path) -> DatasetError {
        DatasetError::new(path, self.to_string(), self.remedy())
    }
}

/// What `decode` makes of an image. All decoders of images are called through here: they are the code of others and are
/// given files of anybody, so their panics are errors too.
pub(super) fn decoded<T>(
    decode: impl FnOnce() -> Result<T, DecodeError>,
) -> Result<T, DecodeError> {
    caught(decode).unwrap_or_else(|message| Err(DecodeError::Panicked(message)))
}

/// The limit that was set; 0 if none was.
static ASKED: AtomicUsize = AtomicUsize::new(0);

/// Sets the largest number of pixels of an image, from now on and in all threads. Without this call the limit
/// is [`MAX_PIXELS`].
pub fn limit_pixels(most: NonZeroUsize) {
    ASKED.store(most.get(), Ordering::Relaxed);
}

fn most_pixels() -> usize {
    match ASKED.load(Ordering::Relaxed) {
        0 => MAX_PIXELS,
        asked => asked,
    }
}

/// Returns the size if an image may have it.
///
/// # Errors
/// If it has more pixels than are allowed, in total or on a side.
pub fn check_size(size: Size) -> Result<Size, DecodeError> {
    if size.width > MAX_SIDE || size.height > MAX_SIDE || size.area() > most_pixels() {
        return Err(DecodeError::TooLarge(size));
    }
    Ok(size)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::{decode_depth, decode_gray, decode_planes, read_gray};
    use super::*;

    #[test]
    fn a_panic_of_a_decoder_is_an_error_that_names_the_file() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/images/hostile.tif");
        let error = read_gray(&path).unwrap_err();
        assert_eq!(error.file, path);
        assert!(
            error
                .what
                .starts_with("the decoder of the image panicked: index out of bounds")
        );
        assert!(
            error.remedy.contains("convert it to a png"),
            "{}",
            error.remedy
        );
        let bytes = fs::read(&path).unwrap();
        let panicked = |error| matches!(error, DecodeError::Panicked(_));
        assert!(decode_gray(&bytes).is_err_and(panicked));
        assert!(decode_planes(&bytes).is_err_and(panicked));
        assert!(decode_depth(&bytes).is_err_and(panicked));
    }
}
