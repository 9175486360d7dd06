//! The virtual line descriptor: what an image looks like along the segment between two keypoints.
//!
//! Ten discs lie on the segment, evenly between its ends (section 2 of the paper). Each is
//! described by a histogram of eight gradient directions relative to the line, and by its dominant
//! direction among 24 with the weight of it. All histograms of a line are normalised together, and
//! so are all weights: a disc counts by its contrast.

use nalgebra::Point2;

use super::gradients::{GradientPyramid, wrapped};
use crate::simd::turns;

/// Number of discs on a line.
const DISCS: usize = 10;
/// Number of bins of the histogram of a disc.
const BINS: usize = 8;
/// Number of directions among which the dominant one is found.
const DIRECTIONS: usize = 24;
/// Smallest radius of a disc in pixels of the image.
const MIN_RADIUS: f32 = 2.0;
/// A disc is described at the level where its radius is between this and sqrt(2) times this.
const LEVEL_RADIUS: f32 = 3.0;
/// Weight of the histograms in a distance; the rest is that of the dominant directions.
const HISTOGRAM_SHARE: f32 = 0.36;
/// A line with a smaller mean gradient than this, in grey levels per pixel of its level, is not described,
/// since it shows only noise.
const MIN_CONTRAST: f32 = 1.0;

/// Descriptor of a line.
#[derive(Clone, Debug)]
pub(super) struct VirtualLine {
    histograms: [[f32; BINS]; DISCS],
    /// Index and weight of the dominant direction of each disc.
    dominant: [(u8, f32); DISCS],
}

impl VirtualLine {
    /// The line from `p` to `q`, in pixels of the image; `None` if there is too little contrast to distinguish
    /// lines.
    pub(super) fn new(
        pyramid: &GradientPyramid,
        window: &Window,
        p: Point2<f32>,
        q: Point2<f32>,
    ) -> Option<Self> {
        let length = (q - p).norm();
        let spacing = 1.0 / (DISCS + 1) as f32;
        let radius = (length * spacing).max(MIN_RADIUS);
        let level = level_of(radius).min(pyramid.depth().checked_sub(1)?);
        let (from, to) = (pyramid.place(p, level), pyramid.place(q, level));
        let step = (to - from) * spacing;
        let radius = radius * (step.norm() / (length * spacing));
        let line = wrapped(turns(-step.y, step.x));
        let mut described = Self {
            histograms: [[0.0; BINS]; DISCS],
            dominant: [(0, 0.0); DISCS],
        };
        let mut area = 0.0;
        for disc in 0..DISCS {
            let centre = from + step * (disc + 1) as f32;
            let mut directions = [0.0; DIRECTIONS];
            area += window.gather(
                pyramid.level(level),
                centre,
                radius,
                line,
                &mut described.histograms[disc],
                &mut directions,
            );
            let dominant = (0..DIRECTIONS)
                .reduce(|best, i| {
                    if directions[i] > directions[best] {
                        i
                    } else {
                        best
                    }
                })
                .unwrap_or(0);
            described.dominant[disc] = (dominant as u8, directions[dominant]);
        }
        described.normalise(area)
    }

    /// Normalises all histograms together to sum 1, and all weights too; `area` is the weight of all pixels
    /// used.
    fn normalise(mut self, area: f32) -> Option<Self> {
        let sum: f32 = self.histograms.iter().flatten().sum();
        // Magnitudes are 128ths of twice the gradient.
        if sum.is_nan() || sum <= MIN_CONTRAST * 256.0 * area {
            return None;
        }
        let weights: f32 = self.dominant.iter().map(|(_, weight)| weight).sum();
        self.histograms.iter_mut().flatten().for_each(|v| *v /= sum);
        self.dominant
            .iter_mut()
            .for_each(|(_, weight)| *weight /= weights);
        Some(self)
    }

    /// How unlike two lines are: 0 for equal ones, at most about 1.
    pub(super) fn distance(&self, other: &Self) -> f32 {
        let histograms: f32 = (self.histograms.iter().flatten())
            .zip(other.histograms.iter().flatten())
            .map(|(x, y)| (x - y).abs())
            .sum();
        let directions: f32 = (self.dominant.iter().zip(&other.dominant))
            .map(|(&(i, weight), &(j, other_weight))| {
                let apart = usize::from(i.abs_diff(j));
                let apart = apart.min(DIRECTIONS - apart);
                0.5 * (weight + other_weight) * apart as f32
            })
            .sum();
        let direction_share = (1.0 - HISTOGRAM_SHARE) / DIRECTIONS as f32;
        HISTOGRAM_SHARE * histograms + direction_share * directions
    }
}

/// The level at which a disc of this radius in pixels of the image is described.
fn level_of(radius: f32) -> usize {
    let squared = (radius / LEVEL_RADIUS) * (radius / LEVEL_RADIUS);
    // Each level halves the squared radius.
    let mut level = 0;
    let mut limit = 2.0;
    while squared >= limit && level < 40 {
        level += 1;
        limit *= 2.0;
    }
    level
}

/// Number of levels that are needed for lines of at most this length.
pub(super) fn levels_for(length: f32) -> usize {
    level_of(length / (DISCS + 1) as f32) + 1
}

/// The Gaussian weight of a disc, as a table over the squared distance from its centre.
pub(super) struct Window([f32; Window::STEPS + 1]);

impl Window {
    const STEPS: usize = 64;

    /// A Gaussian whose standard deviation is half the radius.
    pub(super) fn new() -> Self {
        let weight = |step: usize| libm::expf(-2.0 * step as f32 / Self::STEPS as f32);
        Self(std::array::from_fn(weight))
    }

    /// Adds the gradients of a disc to the two histograms, with directions relative to `line`. Returns the
    /// weight of the pixels.
    fn gather(
        &self,
        level: &crate::image::Image<super::gradients::Gradient>,
        centre: Point2<f32>,
        radius: f32,
        line: u16,
        histogram: &mut [f32; BINS],
        directions: &mut [f32; DIRECTIONS],
    ) -> f32 {
        let (width, height) = (level.width() as i32, level.height() as i32);
        let first = |at: f32| ((at - radius).ceil() as i32).max(0);
        let last = |at: f32, length: i32| ((at + radius).floor() as i32).min(length - 1);
        let steps = Self::STEPS as f32 / (radius * radius);
        let mut area = 0.0;
        for y in first(centre.y)..=last(centre.y, height) {
            let dy = y as f32 - centre.y;
            let row = level.row(y as usize);
            for x in first(centre.x)..=last(centre.x, width) {
                let dx = x as f32 - centre.x;
                let step = ((dx * dx + dy * dy) * steps) as usize;
                let Some(weight) = self.0.get(step) else {
                    continue;
                };
                let gradient = row[x as usize];
                let value = weight * f32::from(gradient.magnitude);
                let direction = gradient.direction.wrapping_sub(line);
                let bin = usize::from(direction >> 13);
                let share = f32::from(direction & 0x1fff) * (1.0 / 8192.0);
                histogram[bin] += value * (1.0 - share);
                histogram[(bin + 1) % BINS] += value * share;
                directions[((u32::from(direction) * DIRECTIONS as u32) >> 16) as usize] += value;
                area += weight;
            }
        }
        area
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradients::Gradient;
    use super::*;
    use crate::image::{Image, Size};

    #[test]
    fn dominant_directions_are_compared_around_the_circle() {
        let line = |direction| VirtualLine {
            histograms: [[1.0 / (DISCS * BINS) as f32; BINS]; DISCS],
            dominant: [(direction, 1.0 / DISCS as f32); DISCS],
        };
        for (one, other, apart) in [
            (5, 5, 0.0),
            (5, 6, 1.0),
            (0, 23, 1.0),
            (21, 3, 6.0),
            (0, 12, 12.0),
        ] {
            let distance = line(one).distance(&line(other));
            let expected = (1.0 - HISTOGRAM_SHARE) * apart / 24.0;
            assert!(
                (distance - expected).abs() < 1e-6,
                "{one} {other}: {distance}"
            );
        }
    }

    #[test]
    fn a_disc_is_described_where_it_has_three_to_four_pixels() {
        for radius in [3.01, 4.2, 4.3, 5.9, 6.1, 12.3, 100.0_f32] {
            let there = radius / 2.0_f32.powf(0.5 * level_of(radius) as f32);
            assert!((2.99..4.25).contains(&there), "{radius}: {there}");
        }
        assert_eq!(level_of(1.0), 0);
    }

    #[test]
    fn a_disc_is_round_and_its_gradients_fall_between_two_bins() {
        // A sixteenth of a turn is in the middle of two of the eight bins.
        let gradient = Gradient {
            magnitude: 3,
            direction: 0x1000,
        };
        let level = Image::filled(Size::new(40, 41), gradient);
        let (centre, radius) = (Point2::new(20.3, 19.8), 6.0);
        let (mut histogram, mut directions) = ([0.0; BINS], [0.0; DIRECTIONS]);
        let area = Window::new().gather(&level, centre, radius, 0, &mut histogram, &mut directions);
        let squared = |x: usize, y: usize| {
            (Point2::new(x as f32, y as f32) - centre).norm_squared() / (radius * radius)
        };
        let pixels = (0..41).flat_map(|y| (0..40).map(move |x| squared(x, y)));
        let expected: f32 = (pixels.filter(|&d| d <= 1.0))
            .map(|d| libm::expf(-2.0 * d))
            .sum();
        assert!(
            (area / expected - 1.0).abs() < 0.05,
            "{area}, not {expected}"
        );
        let half = 1.5 * area;
        assert!(
            (histogram[0] - half).abs() < 1e-3 * half && (histogram[1] - half).abs() < 1e-3 * half
        );
        assert!(histogram[2..].iter().all(|&value| value == 0.0));
        assert!((directions[1] - 3.0 * area).abs() < 1e-3 * area);
    }
}
