//! The pixels of a simulated view: the image turned, blurred along the columns and compressed along them.
//!
//! A row of the view is a mean of few rows of the turned image, and the next row of almost the same. So rows are turned when
//! they are needed, and the last ones are kept: they stay in the cache, and the turned image is never stored.

use crate::image::{GrayImage, RowBuffer, Size};
use crate::simd::{Source, Turn, turn_row, weigh_rows_to_u8};

/// Least blur before an axis is compressed, in pixels. Four of them are half a pixel: each row of a view has one of the
/// turned image within reach.
const MIN_BLUR: f64 = 0.13;

/// How far a Gaussian mean reaches, in standard deviations.
const REACH: f64 = 4.0;

/// The standard deviation in pixels of the blur before an axis is compressed by `tilt`.
fn blur(tilt: f64) -> f64 {
    (0.8 * (tilt * tilt - 1.0).sqrt()).max(MIN_BLUR)
}

/// Rows of the turned image that a row of a view is a mean of, at most.
fn rows(tilt: f64) -> usize {
    (2.0 * REACH * blur(tilt)) as usize + 1
}

/// The bytes that [`see`] needs beside the view.
pub(super) fn memory(turned: Size, tilt: f64) -> usize {
    size_of::<f32>() * turned.width * rows(tilt).min(turned.height)
}

/// The image turned to the size of `turned`, with its height compressed by `tilt` to that of `size`: each row is a
/// Gaussian mean about its place.
pub(super) fn see(
    image: &GrayImage,
    turn: &Turn,
    [turned, size]: [Size; 2],
    tilt: f64,
) -> GrayImage {
    let mut view = GrayImage::filled(size, 0);
    if image.size().area() == 0 {
        return view;
    }
    let twice;
    let source = if image.width() > 1 {
        source(image)
    } else {
        // A second column, which has what the first one continues with.
        twice = GrayImage::from_fn(Size::new(2, image.height()), |_, y| image.at(0, y));
        source(&twice)
    };
    let mut buffer = RowBuffer::new(turned, rows(tilt));
    let sigma = blur(tilt);
    let offset = (turned.height as f64 - 1.0) / 2.0 - tilt * (size.height as f64 - 1.0) / 2.0;
    for y in 0..size.height {
        let at = tilt * y as f64 + offset;
        let first = (at - REACH * sigma).ceil() as isize;
        let last = (at + REACH * sigma).floor() as isize;
        let inside = |row: isize| row.clamp(0, turned.height as isize - 1) as usize;
        while buffer.made() <= inside(last) {
            let made = buffer.made();
            for row in buffer.append(1) {
                turn_row(source, turn, made, row);
            }
        }
        let weight = |row: isize| {
            let distance = (row as f64 - at) / sigma;
            libm::exp(-0.5 * distance * distance)
        };
        let total: f64 = (first..=last).map(weight).sum();
        let shares: Vec<f32> = (first..=last)
            .map(|row| (weight(row) / total) as f32)
            .collect();
        let rows: Vec<&[f32]> = (first..=last).map(|row| buffer.row(inside(row))).collect();
        weigh_rows_to_u8(&rows, &shares, view.row_mut(y));
    }
    view
}

fn source(image: &GrayImage) -> Source<'_> {
    Source {
        data: image.data(),
        width: image.width(),
        height: image.height(),
    }
}
