//! Image files as gray pixels, the same gray as OpenCV's `imread(path, IMREAD_GRAYSCALE)`.
//!
//! | file | gray |
//! | --- | --- |
//! | gray, 8 bit | as stored |
//! | JPEG | the luma channel of the file; colour is never reconstructed |
//! | colour PNG (palettes expanded) | `(9797 R + 19234 G + 3737 B) >> 15` |
//! | colour BMP, PPM, TIFF | `(4899 R + 9617 G + 1868 B + 2^13) >> 14` |
//! | colour WebP | `(9798 R + 19235 G + 3735 B + 2^14) >> 15` |
//! | 16 bit | the same in 16 bit, then `>> 8` |
//! | PNM whose largest value is not 255 or 65535 | scaled up to it first, which OpenCV does not do |
//! | CMYK TIFF | its red, green and blue, as colour |
//! | alpha | ignored |
//!
//! Choices. The format is recognised by content, not by name. Pixels are taken as stored: an EXIF orientation
//! is *not* applied (OpenCV applies it), because cameras and poses of all supported datasets belong to the
//! stored pixels; `validate` warns of such files of any format. The inverse cosine transform of a JPEG may differ from that
//! of libjpeg by one grey level. It is the portable integer version, so every machine gets the same pixels. A
//! damaged or truncated file is an error, and never gives half an image.

use std::io::{BufRead, BufReader, Cursor, Seek};
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use matchbench_vision::image::{GrayImage, Size};
use zune_core::bytestream::{ZByteReaderTrait, ZCursor};
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::decode_error::{DecodeError, MAX_SIDE, check_size, decoded};
use super::jpeg::{self, JpegError};
use super::{DatasetError, pnm, tiff};
use crate::files::{open_file, read_file};
use crate::memory::reserve;

/// Most bytes that a decoder may allocate besides the pixels: for colour profiles, comments, and rows of its
/// own.
const BESIDE_PIXELS: u64 = 64 << 20;
/// Most bytes per pixel that the JPEG decoder takes, measured: the coefficients of a progressive colour file,
/// its pixels, and data about its blocks.
const JPEG_BYTES: usize = 9;
/// Bytes per pixel for red, green and blue, both interleaved and as planes.
pub(super) const COLOUR_BYTES: usize = 6;
/// What the JPEG decoder says of a channel with three blocks across in a unit.
const THREE_ACROSS: &str = "Horizontal sample is not a power of two(3) cannot decode";
/// What the JPEG decoder says of values that have 12 bits or 16, how it begins.
const MORE_BITS: &str = "The library can only parse 8-bit images";
/// What the JPEG decoder says if it knows no frame of the file.
const NO_FRAME: &str = "Error decoding SOF Marker, Number of components cannot be zero.";
/// What is read besides JPEG. The decoders may know more, which other packages ask them for.
const FORMATS: [ImageFormat; 5] = [
    ImageFormat::Png,
    ImageFormat::Pnm,
    ImageFormat::Tiff,
    ImageFormat::Bmp,
    ImageFormat::WebP,
];
pub(super) const JPEG_MAGIC: [u8; 3] = [0xff, 0xd8, 0xff];

/// A fixed-point mean of red, green and blue: `(w . rgb + half) >> bits`.
#[derive(Clone, Copy)]
pub(super) struct GrayRule {
    weights: [u32; 3],
    half: u32,
    bits: u32,
}

// All three have the weights 0.299, 0.587, 0.114, each in the arithmetic of the library that OpenCV uses for
// this format.
const LIBPNG: GrayRule = GrayRule {
    weights: [9797, 19234, 3737],
    half: 0,
    bits: 15,
};
const LIBJPEG: GrayRule = GrayRule {
    weights: [19595, 38470, 7471],
    half: 1 << 15,
    bits: 16,
};
const CVT_COLOR: GrayRule = GrayRule {
    weights: [9798, 19235, 3735],
    half: 1 << 14,
    bits: 15,
};
const IMGCODECS: GrayRule = GrayRule {
    weights: [4899, 9617, 1868],
    half: 1 << 13,
    bits: 14,
};

/// Reads and decodes the image at `path`.
///
/// # Errors
/// If the file cannot be read or is no complete image.
pub fn read_gray(path: &Path) -> Result<GrayImage, DatasetError> {
    let bytes = read_file(path).map_err(|error| DatasetError::io(path, &error))?;
    decode_gray(&bytes).map_err(|error| error.in_file(path))
}

/// Size of the image at `path`, from its header alone.
///
/// # Errors
/// If the file cannot be read or its header is not that of an image.
pub fn read_size(path: &Path) -> Result<Size, DatasetError> {
    let file = open_file(path).map_err(|error| DatasetError::io(path, &error))?;
    let mut reader = BufReader::new(file);
    let head = reader
        .fill_buf()
        .map_err(|error| DatasetError::io(path, &error))?;
    let is_jpeg = head.starts_with(&JPEG_MAGIC);
    size_in(reader, is_jpeg).map_err(|error| error.in_file(path))
}

/// Size of the image in `bytes`, from its header alone.
///
/// # Errors
/// If it is not that of an image.
pub(crate) fn size_of_image(bytes: &[u8]) -> Result<Size, DecodeError> {
    size_in(Cursor::new(bytes), bytes.starts_with(&JPEG_MAGIC))
}

fn size_in(reader: impl BufRead + Seek, is_jpeg: bool) -> Result<Size, DecodeError> {
    decoded(|| {
        if is_jpeg {
            jpeg_header(reader).map(|decoder| jpeg_size(&decoder))
        } else {
            size_of_other(reader)
        }
    })
}

/// Decodes the image in `bytes`.
///
/// # Errors
/// If they are no complete image of a supported format.
pub fn decode_gray(bytes: &[u8]) -> Result<GrayImage, DecodeError> {
    decoded(|| {
        if bytes.starts_with(&JPEG_MAGIC) {
            decode_jpeg(bytes)
        } else {
            with_other(bytes, 0, gray_of_other)
        }
    })
}

/// Converts pixels of red, green and blue to grey, in the same way as a colour PNG file is decoded.
///
/// # Panics
/// If `rgb` does not have three bytes for each pixel of an image of `size`.
pub fn gray_of_rgb(size: Size, rgb: &[u8]) -> GrayImage {
    assert_eq!(rgb.len(), 3 * size.area(), "three bytes for each pixel");
    to_gray(size, rgb, 3, LIBPNG)
}

fn decode_jpeg(bytes: &[u8]) -> Result<GrayImage, DecodeError> {
    let (size, channels, data) = jpeg_pixels(bytes, false)?;
    Ok(match channels {
        1 => GrayImage::from_vec(size, data),
        _ => to_gray(size, &data, channels, LIBJPEG),
    })
}

/// The pixels of a JPEG, and the number of channels. If the file stores brightness and colour separately, only
/// the brightness is returned, unless `colour` is asked for.
pub(super) fn jpeg_pixels(
    bytes: &[u8],
    colour: bool,
) -> Result<(Size, usize, Vec<u8>), DecodeError> {
    let decoder = jpeg_header(ZCursor::new(bytes))?;
    let size = check_size(jpeg_size(&decoder))?;
    let stored = stored_channels(&decoder);
    if !matches!(
        stored,
        ColorSpace::RGB | ColorSpace::Luma | ColorSpace::YCbCr
    ) {
        return Err(DecodeError::Unsupported(format!("{stored:?}")));
    }
    let sampling = jpeg::check(bytes).map_err(|error| match error {
        JpegError::Truncated => DecodeError::Truncated,
        JpegError::Damaged(what) => {
            DecodeError::Damaged(format!("a JPEG with {what} that are none"))
        }
        JpegError::Unsupported(what) => DecodeError::Unsupported(format!("a JPEG with {what}")),
    })?;
    let (space, channels) = match stored {
        ColorSpace::YCbCr if colour => (ColorSpace::RGB, 3),
        ColorSpace::YCbCr if sampling.is_tall => (ColorSpace::YCbCr, 3),
        ColorSpace::RGB => (ColorSpace::RGB, 3),
        _ => (ColorSpace::Luma, 1),
    };
    let more = if colour || space == ColorSpace::YCbCr {
        COLOUR_BYTES
    } else {
        0
    };
    let _memory = reserve(size.area() * (JPEG_BYTES + more))
        .map_err(|missing| DecodeError::NoMemory(size, missing))?;
    let mut decoder = jpeg_header(ZCursor::new(bytes))?;
    decoder.set_options(jpeg_options().jpeg_set_out_colorspace(space));
    let data = decoder.decode().map_err(|error| jpeg_error(&error))?;
    if space == ColorSpace::YCbCr {
        return Ok((size, 1, data.into_iter().step_by(channels).collect()));
    }
    Ok((size, channels, data))
}

/// What the channels of a JPEG are.
fn stored_channels<R: ZByteReaderTrait>(decoder: &JpegDecoder<R>) -> ColorSpace {
    let stored = decoder.input_colorspace();
    let channels = decoder.info().map(|info| info.components);
    match stored.expect("the headers were decoded") {
        // Adobe's marker has one number for both, and the decoder tells them apart when it comes to the pixels.
        ColorSpace::CMYK if channels == Some(3) => ColorSpace::RGB,
        stored => stored,
    }
}

fn jpeg_options() -> DecoderOptions {
    DecoderOptions::default()
        .set_strict_mode(true)
        // Portable code instead of machine-specific code, for the same bits everywhere.
        .set_use_unsafe(false)
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE)
}

/// A JPEG of which everything before the pixels was read.
pub(super) fn jpeg_header<R: ZByteReaderTrait>(reader: R) -> Result<JpegDecoder<R>, DecodeError> {
    let mut decoder = JpegDecoder::new_with_options(reader, jpeg_options());
    decoder
        .decode_headers()
        .map_err(|error| jpeg_error(&error))?;
    Ok(decoder)
}

fn jpeg_size<R: ZByteReaderTrait>(decoder: &JpegDecoder<R>) -> Size {
    let info = decoder.info().expect("the headers were decoded");
    Size::new(usize::from(info.width), usize::from(info.height))
}

fn jpeg_error(error: &zune_jpeg::errors::DecodeErrors) -> DecodeError {
    use zune_jpeg::errors::DecodeErrors as E;
    match error {
        E::ExhaustedData | E::IoErrors(_) | E::FormatStatic("Premature end of buffer") => {
            DecodeError::Truncated
        }
        E::Unsupported(scheme) => DecodeError::Unsupported(format!("{scheme:?}")),
        E::Format(what) if what == THREE_ACROSS => DecodeError::Unsupported(
            "a JPEG with a sampling factor of 3 (4:4:4, 4:2:2, 4:2:0 and 4:1:1 are read)".into(),
        ),
        E::SofError(what) if what.starts_with(MORE_BITS) => {
            DecodeError::Unsupported("a JPEG whose values do not have 8 bits".into())
        }
        E::FormatStatic(NO_FRAME) => DecodeError::Unsupported(
            "a JPEG without a frame of Huffman codes: it may be lossless, JPEG-LS, or arithmetically coded".into(),
        ),
        other => DecodeError::Damaged(other.to_string()),
    }
}

/// Calls a function with the stored pixels of an image that is not a JPEG. The function needs this many more
/// bytes of memory per pixel.
pub(super) fn with_other<T>(
    bytes: &[u8],
    more: usize,
    then: impl FnOnce(Size, DynamicImage, GrayRule) -> Result<T, DecodeError>,
) -> Result<T, DecodeError> {
    let size = check_size(size_of_other(Cursor::new(bytes))?)?;
    // 16 bits of red, green, blue and alpha are the most that a pixel has.
    let most = 8 * size.area();
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|_| DecodeError::UnknownFormat)?;
    reader.limits(limits(most as u64));
    let rule = match reader.format() {
        Some(ImageFormat::Png) => LIBPNG,
        Some(ImageFormat::WebP) if webp_ends_early(bytes) => return Err(DecodeError::Truncated),
        Some(ImageFormat::WebP) => CVT_COLOR,
        Some(ImageFormat::Pnm) => {
            pnm::check_samples(bytes)?;
            IMGCODECS
        }
        _ => IMGCODECS,
    };
    let stored = reader.into_decoder().map_err(|error| other_error(&error))?;
    let a_pixel = usize::from(stored.color_type().bytes_per_pixel()) + 1 + more;
    let _memory =
        reserve(size.area() * a_pixel).map_err(|missing| DecodeError::NoMemory(size, missing))?;
    let image = DynamicImage::from_decoder(stored).map_err(|error| other_error(&error))?;
    then(size, image, rule)
}

/// Whether a WebP file is shorter than its header says. The decoder would invent pixels for a few missing
/// bytes.
fn webp_ends_early(bytes: &[u8]) -> bool {
    const BEFORE: usize = 8;
    let stated = bytes.get(4..BEFORE).and_then(|size| size.try_into().ok());
    stated.is_some_and(|size| bytes.len() - BEFORE < u32::from_le_bytes(size) as usize)
}

/// Pixels of an image of `size` as gray.
pub(super) fn gray_of_other(
    size: Size,
    image: DynamicImage,
    rule: GrayRule,
) -> Result<GrayImage, DecodeError> {
    Ok(match image {
        DynamicImage::ImageLuma8(gray) => GrayImage::from_vec(size, gray.into_raw()),
        DynamicImage::ImageLumaA8(gray) => to_gray(size, &gray, 2, rule),
        DynamicImage::ImageRgb8(rgb) => to_gray(size, &rgb, 3, rule),
        DynamicImage::ImageRgba8(rgb) => to_gray(size, &rgb, 4, rule),
        DynamicImage::ImageLuma16(gray) => to_gray(size, &gray, 1, rule),
        DynamicImage::ImageLumaA16(gray) => to_gray(size, &gray, 2, rule),
        DynamicImage::ImageRgb16(rgb) => to_gray(size, &rgb, 3, rule),
        DynamicImage::ImageRgba16(rgb) => to_gray(size, &rgb, 4, rule),
        other => return Err(DecodeError::Unsupported(format!("{:?}", other.color()))),
    })
}

/// The limits of a decoder whose pixels take so many bytes.
pub(super) fn limits(pixels: u64) -> image::Limits {
    let mut limits = image::Limits::no_limits();
    limits.max_alloc = Some(pixels + BESIDE_PIXELS);
    limits
}

fn size_of_other(mut file: impl BufRead + Seek) -> Result<Size, DecodeError> {
    let guessed = ImageReader::new(&mut file).with_guessed_format();
    let format = guessed.ok().and_then(|reader| reader.format());
    let format = format.filter(|format| FORMATS.contains(format));
    let Some(format) = format else {
        return Err(if tiff::is_big(file) {
            DecodeError::Unsupported("a BigTIFF".into())
        } else {
            DecodeError::UnknownFormat
        });
    };
    if format == ImageFormat::Tiff {
        tiff::check_pixels(&mut file)?;
    }
    let mut reader = ImageReader::with_format(file, format);
    reader.limits(limits(0));
    let (width, height) = reader
        .into_dimensions()
        .map_err(|error| other_error(&error))?;
    if width == 0 || height == 0 {
        // Decoders of most formats say so themselves, that of PNM does not.
        return Err(DecodeError::Damaged("it has no pixels".into()));
    }
    Ok(Size::new(width as usize, height as usize))
}

fn other_error(error: &image::ImageError) -> DecodeError {
    match error {
        image::ImageError::Unsupported(what) => DecodeError::Unsupported(what.to_string()),
        image::ImageError::IoError(_) => DecodeError::Truncated,
        image::ImageError::Limits(_) => {
            DecodeError::Damaged("it asks for more memory than its pixels need".into())
        }
        other => DecodeError::Damaged(other.to_string()),
    }
}

/// Converts `channels` interleaved 8- or 16-bit values per pixel to grey. Alpha is the last channel and is
/// ignored.
fn to_gray<T>(size: Size, data: &[T], channels: usize, rule: GrayRule) -> GrayImage
where
    T: Copy + Into<u32>,
{
    let extra_bits = 8 * (size_of::<T>() - 1);
    let [red, green, blue] = rule.weights;
    let gray = |pixel: &[T]| {
        let value = match *pixel {
            [r, g, b, ..] => {
                (red * r.into() + green * g.into() + blue * b.into() + rule.half) >> rule.bits
            }
            _ => pixel[0].into(),
        };
        (value >> extra_bits) as u8
    };
    GrayImage::from_vec(size, data.chunks_exact(channels).map(gray).collect())
}

#[cfg(test)]
mod tests;
