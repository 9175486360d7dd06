//! Smaller images whose pixels are the means of the areas they cover.
//!
//! If the ratio of the sizes is not a whole number, a pixel on the edge of an area counts by the share of it
//! that lies within, as in OpenCV's `INTER_AREA`.

use super::{FloatImage, Size};

/// Pixels that an output pixel can cover along one direction.
const COVERED: usize = 4;

/// The pixels along one direction that an output pixel covers, with weights of sum 1.
struct Span {
    first: usize,
    weights: [f32; COVERED],
}

/// `image` at `size`, between its own and about half of it.
///
/// # Panics
/// If `size` is larger than the image, or smaller than a third.
pub(crate) fn shrink(image: &FloatImage, size: Size) -> FloatImage {
    let rows = spans(image.height(), size.height);
    let columns = spans(image.width(), size.width);
    // Beyond the end there are zeros, with weights of zero.
    let mut sums = vec![0.0_f32; image.width() + COVERED];
    let mut shrunk = FloatImage::filled(size, 0.0);
    for (y, span) in rows.iter().enumerate() {
        sums.fill(0.0);
        let covered = span.weights.iter().filter(|&&weight| weight > 0.0);
        for (y, &weight) in (span.first..).zip(covered) {
            for (sum, value) in sums.iter_mut().zip(image.row(y)) {
                *sum += weight * value;
            }
        }
        for (out, span) in shrunk.row_mut(y).iter_mut().zip(&columns) {
            let [a, b, c, d] = span.weights;
            let sums = &sums[span.first..][..COVERED];
            *out = (a * sums[0] + b * sums[1]) + (c * sums[2] + d * sums[3]);
        }
    }
    shrunk
}

fn spans(length: usize, count: usize) -> Vec<Span> {
    assert!(
        count <= length && length <= 3 * count,
        "{count} pixels of {length}"
    );
    let scale = length as f64 / count as f64;
    (0..count)
        .map(|i| {
            // The last end can be rounded to more than the length.
            let (start, end) = (
                i as f64 * scale,
                ((i + 1) as f64 * scale).min(length as f64),
            );
            let first = start as usize;
            let share = |p: usize| (end.min((p + 1) as f64) - start.max(p as f64)).max(0.0) / scale;
            Span {
                first,
                weights: std::array::from_fn(|i| share(first + i) as f32),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_means_of_four() {
        let image = FloatImage::from_fn(Size::new(4, 2), |x, y| (10 * x + y) as f32);
        let half = shrink(&image, Size::new(2, 1));
        assert_eq!(half.data(), [5.5, 25.5]);
    }

    #[test]
    fn nothing_beyond_the_image_counts() {
        for length in 2..3000 {
            let last = spans(length, length / 2).pop().expect("at least one");
            let covered = last.weights.iter().filter(|&&weight| weight > 0.0).count();
            assert!(last.first + covered <= length, "{length}");
        }
    }

    #[test]
    fn odd_lengths_share_pixels() {
        // 2.5 pixels each: (1 + 2 + 3 / 2) / 2.5 and (3 / 2 + 4 + 5) / 2.5.
        let image = FloatImage::from_vec(Size::new(5, 1), vec![1.0, 2.0, 3.0, 4.0, 5.0]);
        let half = shrink(&image, Size::new(2, 1));
        assert!((half.at(0, 0) - 1.8).abs() < 1e-6 && (half.at(1, 0) - 4.2).abs() < 1e-6);
    }

    #[test]
    fn constants_stay() {
        for (from, to) in [((81, 43), (40, 21)), ((1, 1), (1, 1)), ((0, 0), (0, 0))] {
            let image = FloatImage::filled(Size::new(from.0, from.1), 7.0);
            let small = shrink(&image, Size::new(to.0, to.1));
            assert_eq!(small.size(), Size::new(to.0, to.1));
            assert!(small.data().iter().all(|v| (v - 7.0).abs() < 1e-5));
        }
    }
}
