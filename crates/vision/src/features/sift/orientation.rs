//! Dominant directions of the gradients around a keypoint (section 5).

use core::f32::consts::{PI, TAU};

use super::patch::Patch;
use crate::image::{RowBuffer, Size};
use crate::simd::add_directions;

const BINS: usize = 36;
/// Standard deviation of the Gaussian window, in scales of the keypoint.
const WINDOW: f32 = 1.5;
/// Half the side of the square that is looked at, in scales: three standard deviations.
const RADIUS: f32 = 3.0 * WINDOW;
/// A peak counts if it is at least this share of the highest.
const PEAK_RATIO: f32 = 0.8;

/// Finds dominant directions; its buffers are used again and again.
#[derive(Default)]
pub(in crate::features) struct Orientations {
    patch: Patch,
    peaks: Vec<f32>,
}

impl Orientations {
    /// Angles of the peaks about a pixel, in radians in `[0, 2 pi)` from x towards y.
    pub(in crate::features) fn peaks(
        &mut self,
        layer: &RowBuffer,
        pixel: [usize; 2],
        scale: f32,
    ) -> &[f32] {
        let histogram = self.histogram(layer, pixel, scale);
        self.peaks.clear();
        self.peaks.extend(peaks(&histogram));
        &self.peaks
    }

    /// Angle of the highest peak, the first of equals; 0 where there is no gradient.
    pub(super) fn strongest(&mut self, layer: &RowBuffer, pixel: [usize; 2], scale: f32) -> f32 {
        let histogram = self.histogram(layer, pixel, scale);
        let peaks = (0..BINS).filter(|&bin| is_peak(&histogram, bin));
        peaks
            .reduce(|best, bin| {
                if histogram[bin] > histogram[best] {
                    bin
                } else {
                    best
                }
            })
            .map_or(0.0, |bin| peak_angle(&histogram, bin))
    }

    /// The smoothed histogram; bin `i` is the direction of `10 i` degrees upwards from x.
    fn histogram(&mut self, layer: &RowBuffer, pixel: [usize; 2], scale: f32) -> [f32; BINS] {
        let radius = window_radius(layer.size(), scale) as i32;
        let deviation = WINDOW * scale;
        self.patch.reset(radius, -0.5 / (deviation * deviation));
        let mut raw = [0.0; BINS];
        self.patch.look(
            layer,
            pixel.map(|v| v as i32),
            |_, columns| columns.fill([-radius, radius]),
            |window, gradients| add_directions(window, gradients, &mut raw),
        );
        smoothed(&raw)
    }
}

/// Pixels that the window reaches to each side for a keypoint of this `scale`, in an image of this
/// size.
pub(super) fn window_radius(size: Size, scale: f32) -> usize {
    let longest = size.width.max(size.height) as f32;
    (RADIUS * scale).round_ties_even().min(longest) as usize
}

/// Weighted by the binomial coefficients of four.
fn smoothed(raw: &[f32; BINS]) -> [f32; BINS] {
    std::array::from_fn(|i| {
        let at = |offset: usize| raw[(i + BINS + offset - 2) % BINS];
        ((at(0) + at(4)) * 1.0 + (at(1) + at(3)) * 4.0 + at(2) * 6.0) / 16.0
    })
}

/// The angles of all peaks that are nearly as high as the highest.
fn peaks(histogram: &[f32; BINS]) -> impl Iterator<Item = f32> {
    let highest = histogram.iter().copied().fold(0.0, f32::max);
    (0..BINS)
        .filter(move |&bin| is_peak(histogram, bin) && histogram[bin] >= PEAK_RATIO * highest)
        .map(|bin| peak_angle(histogram, bin))
}

fn neighbours(histogram: &[f32; BINS], bin: usize) -> (f32, f32) {
    (
        histogram[(bin + BINS - 1) % BINS],
        histogram[(bin + 1) % BINS],
    )
}

fn is_peak(histogram: &[f32; BINS], bin: usize) -> bool {
    let (before, after) = neighbours(histogram, bin);
    histogram[bin] > before && histogram[bin] > after
}

/// The angle at the top of the parabola through a peak and its neighbours.
fn peak_angle(histogram: &[f32; BINS], bin: usize) -> f32 {
    let (before, after) = neighbours(histogram, bin);
    let top = bin as f32 + 0.5 * (before - after) / (before - 2.0 * histogram[bin] + after);
    let upwards = top.rem_euclid(BINS as f32) * (360.0 / BINS as f32);
    let radians = (360.0 - upwards) * (PI / 180.0);
    if radians >= TAU { 0.0 } else { radians }
}

#[cfg(test)]
mod tests {
    use super::super::patch::plain;
    use super::*;

    /// Section 5: gradients of the blurred image, by a Gaussian of 1.5 scales, in 36 bins.
    #[test]
    fn the_histogram_is_that_of_the_weighted_gradients_around() {
        let layer = plain::noise();
        for (pixel, scale, radius) in [([30, 25], 2.0, 9), ([3, 40], 1.6, 7), ([50, 5], 3.1, 14)] {
            let found = Orientations::default().histogram(&layer, pixel, scale);
            let around = pixel.map(|v| v as i32);
            let mut raw = [0.0; BINS];
            for gradient in plain::gradients(&layer, around, radius, 1.5 * f64::from(scale)) {
                raw[(36.0 * gradient.turns).round() as usize % BINS] += gradient.value as f32;
            }
            let expected = smoothed(&raw);
            let most = expected.iter().copied().fold(0.0, f32::max);
            // Directions are rounded, so some gradient may fall into the next bin.
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 0.03 * most,
                    "{found}, not {expected}"
                );
            }
        }
    }

    #[test]
    fn the_strongest_direction_is_that_of_the_highest_peak() {
        let (layer, mut orientations) = (plain::noise(), Orientations::default());
        for pixel in [[30, 25], [12, 40], [45, 20]] {
            let histogram = orientations.histogram(&layer, pixel, 2.0);
            let higher = |&i: &usize, &j: &usize| histogram[i].total_cmp(&histogram[j]);
            let highest = (0..BINS).max_by(higher).expect("there are bins");
            let found = orientations.strongest(&layer, pixel, 2.0);
            assert_eq!(found, peak_angle(&histogram, highest));
        }
    }

    #[test]
    fn a_direction_is_spread_over_two_bins_to_each_side() {
        let mut raw = [0.0; BINS];
        raw[1] = 16.0;
        let mut expected = [0.0; BINS];
        for (bin, share) in [(35, 1.0), (0, 4.0), (1, 6.0), (2, 4.0), (3, 1.0)] {
            expected[bin] = share;
        }
        assert_eq!(smoothed(&raw), expected);
    }

    /// "Any other local peak that is within 80% of the highest peak."
    #[test]
    fn peaks_of_four_fifths_of_the_highest_count_and_shoulders_do_not() {
        let mut histogram = [0.0; BINS];
        for (bin, value) in [(3, 10.0), (12, 8.0), (20, 7.9), (27, 9.0), (28, 9.0)] {
            histogram[bin] = value;
        }
        let degrees: Vec<f32> = peaks(&histogram).map(f32::to_degrees).collect();
        assert_eq!(degrees.len(), 2, "{degrees:?}");
        assert!((degrees[0] - 330.0).abs() < 1e-3 && (degrees[1] - 240.0).abs() < 1e-3);
    }

    #[test]
    fn the_top_of_a_parabola_is_found_across_the_seam() {
        let mut histogram = [0.0; BINS];
        // 10 - (i - 0.25)^2 around bin 0, counted upwards: 2.5 degrees above the x axis.
        for (bin, x) in [(35, -1.0_f32), (0, 0.0), (1, 1.0)] {
            histogram[bin] = 10.0 - (x - 0.25) * (x - 0.25);
        }
        assert!(is_peak(&histogram, 0));
        assert!((peak_angle(&histogram, 0).to_degrees() - 357.5).abs() < 1e-3);
        histogram.swap(1, 35);
        assert!((peak_angle(&histogram, 0).to_degrees() - 2.5).abs() < 1e-3);
        // Along x it is 0, not a whole circle.
        histogram[1] = histogram[35];
        assert_eq!(peak_angle(&histogram, 0), 0.0);
    }
}
