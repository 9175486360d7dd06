//! Smaller 8-bit images whose pixels are the means of the areas they cover.
//!
//! A pixel on the edge of an area counts by the share of it that lies within. The rule and the rounding are
//! those of OpenCV's `INTER_AREA`: at exactly half the size, halves are rounded up; otherwise to even.

use super::{GrayImage, Size};
use crate::simd::{Cover, cover_columns, cover_rows, halve_rows_u8};

/// Shrinks `image` to `size`, which is between one third of its own size and all of it in each direction.
///
/// # Panics
/// If `size` is outside this range.
pub fn shrink_u8(image: &GrayImage, size: Size) -> GrayImage {
    let mut shrunk = GrayImage::filled(size, 0);
    if size.area() == 0 {
        return shrunk;
    }
    if image.size() == Size::new(2 * size.width, 2 * size.height) {
        for y in 0..size.height {
            halve_rows_u8(image.row(2 * y), image.row(2 * y + 1), shrunk.row_mut(y));
        }
        return shrunk;
    }
    let columns = covers(image.width(), size.width);
    // Shares of 0 may read beyond the end.
    let mut sums = vec![0.0; image.width() + 3];
    for (y, cover) in covers(image.height(), size.height).into_iter().enumerate() {
        let row = |i: usize| image.row((cover.first as usize + i).min(image.height() - 1));
        let rows = [row(0), row(1), row(2), row(3)];
        cover_rows(rows, cover.shares, &mut sums[..image.width()]);
        cover_columns(&sums, &columns, shrunk.row_mut(y));
    }
    shrunk
}

/// The input pixels, of `length`, that each of `count` output pixels covers.
fn covers(length: usize, count: usize) -> Vec<Cover> {
    assert!(
        count <= length && length <= 3 * count,
        "{length} pixels to {count}"
    );
    // As OpenCV computes it, so that it rounds the same.
    let scale = 1.0 / (count as f64 / length as f64);
    (0..count)
        .map(|i| {
            let start = i as f64 * scale;
            let end = (start + scale).min(length as f64);
            // Areas that only touch a pixel do not cover it.
            let first = (start + 1e-3).floor() as usize;
            let last = (end - 1e-3).ceil() as usize;
            let mut shares = [0.0; 4];
            for (share, pixel) in shares.iter_mut().zip(first..last) {
                let covered = end.min((pixel + 1) as f64) - start.max(pixel as f64);
                *share = (covered / scale.min(length as f64 - start)) as f32;
            }
            Cover {
                first: first as u32,
                shares,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_thirds_mix_neighbours_two_to_one() {
        let image = GrayImage::from_fn(Size::new(6, 3), |x, y| (9 * x + 90 * y) as u8);
        let shrunk = shrink_u8(&image, Size::new(4, 2));
        // Columns at 1/3, 5/3, 10/3 and 14/3, rows at 1/3 and 5/3.
        assert_eq!(shrunk.data(), [33, 45, 60, 72, 153, 165, 180, 192]);
    }

    #[test]
    fn halves_are_means_rounded_up() {
        let image = GrayImage::from_vec(Size::new(4, 2), vec![1, 2, 255, 255, 3, 4, 255, 255]);
        assert_eq!(shrink_u8(&image, Size::new(2, 1)).data(), [3, 255]);
    }

    #[test]
    fn the_mean_is_kept_at_any_size() {
        for (from, to) in [
            ((7, 5), (3, 2)),
            ((100, 61), (66, 40)),
            ((1, 1), (1, 1)),
            ((3, 9), (1, 3)),
        ] {
            let image = GrayImage::filled(Size::new(from.0, from.1), 201);
            let shrunk = shrink_u8(&image, Size::new(to.0, to.1));
            assert_eq!(shrunk, GrayImage::filled(Size::new(to.0, to.1), 201));
        }
        let nothing = shrink_u8(&GrayImage::filled(Size::new(1, 1), 9), Size::new(0, 0));
        assert!(nothing.data().is_empty());
    }
}
