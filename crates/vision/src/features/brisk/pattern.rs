//! Steps 3 and 4 of BRISK: the sampling pattern at all scales, and the descriptor that is read with it.

use std::f64::consts::{PI, TAU};

use super::BASIC_SIZE;
use crate::features::Keypoint;
use crate::image::{IntegralImage, Size};
use crate::simd::{DirectionWeights, Squares, direction, square_means};

/// Number of bits of a descriptor: pairs of points nearer than [`SHORT`].
pub(super) const BITS: usize = 512;
const POINTS: usize = 60;
/// Radius of each ring at scale 1 in pixels, and its number of points.
const RINGS: [(f32, usize); 5] = [
    (0.0, 1),
    ((0.85 * 2.9_f64) as f32, 10),
    ((0.85 * 4.9_f64) as f32, 14),
    ((0.85 * 7.4_f64) as f32, 15),
    ((0.85 * 10.8_f64) as f32, 20),
];
/// Pairs are compared below this distance, and tell the direction above the other; in pixels at
/// scale 1.
const SHORT: f32 = 5.85;
const LONG: f32 = 8.2;
/// Half the side of a point's area, per distance to the next point of its ring.
const AREA: f32 = 1.3;
/// Number of scales, over a range from 1 to 30, and the binary logarithm of 30; OpenCV rounds the
/// logarithm to single precision before it divides, whence the last digit.
const SCALES: usize = 64;
const LOG_RANGE: f32 = 4.906_891;
/// Size of a keypoint whose pattern has scale 1, per [`BASIC_SIZE`].
const SMALLEST: f32 = 0.6;
/// Number of angles.
const TURNS: i32 = 1024;

/// The sampling pattern at all scales, and its pairs.
#[derive(Clone, Debug)]
pub(super) struct Pattern {
    scales: Vec<PatternScale>,
    /// Cosine and sine of each angle.
    turns: Vec<[f64; 2]>,
    short_pairs: Vec<[u8; 2]>,
    direction_weights: DirectionWeights,
}

/// The pattern at one scale.
#[derive(Clone, Debug)]
struct PatternScale {
    squares: Squares,
    /// Distance to the border that its keypoints must keep.
    margin: f32,
}

impl Pattern {
    pub(super) fn new() -> Self {
        let turns = (0..TURNS)
            .map(|turn| f64::from(turn) * TAU / f64::from(TURNS))
            .map(|angle| [libm::cos(angle), libm::sin(angle)])
            .collect();
        let mut pattern = Self {
            scales: (0..SCALES).map(PatternScale::new).collect(),
            turns,
            short_pairs: Vec::with_capacity(BITS),
            direction_weights: DirectionWeights {
                x: vec![[0; 64]; POINTS],
                y: vec![[0; 64]; POINTS],
            },
        };
        pattern.pair_points();
        pattern
    }

    /// Tells short and long pairs apart, by their distance in the upright pattern of scale 1.
    fn pair_points(&mut self) {
        let Squares {
            radii, directions, ..
        } = &self.scales[0].squares;
        let upright: [[f32; 2]; POINTS] =
            std::array::from_fn(|i| directions.map(|along| (radii[i] * along[i]) as f32));
        for i in 1..POINTS {
            for j in 0..i {
                let dx = upright[j][0] - upright[i][0];
                let dy = upright[j][1] - upright[i][1];
                let squared_distance = dx * dx + dy * dy;
                if squared_distance > LONG * LONG {
                    let weight = |d: f32| (f64::from(d / squared_distance) * 2048.0 + 0.5) as i32;
                    self.direction_weights.x[i][j] = weight(dx);
                    self.direction_weights.y[i][j] = weight(dy);
                } else if squared_distance < SHORT * SHORT {
                    self.short_pairs.push([i as u8, j as u8]);
                }
            }
        }
    }

    /// The scale of the pattern for keypoints of this size.
    fn scale(size: f32) -> usize {
        let log_size = libm::logf(size / (BASIC_SIZE * SMALLEST)) / std::f32::consts::LN_2;
        let scale = f64::from(SCALES as f32 / LOG_RANGE * log_size) + 0.5;
        (scale as usize).min(SCALES - 1)
    }

    /// Whether the pattern of a keypoint lies within the image.
    pub(super) fn fits(&self, keypoint: &Keypoint, size: Size) -> bool {
        let margin = self.scales[Self::scale(keypoint.size)].margin;
        let inside = |v: f32, length: usize| v >= margin && v < length as f32 - margin;
        inside(keypoint.at.x, size.width) && inside(keypoint.at.y, size.height)
    }
}

impl PatternScale {
    fn new(index: usize) -> Self {
        let step = LOG_RANGE / SCALES as f32;
        let scale = libm::pow(2.0, f64::from(index as f32 * step)) as f32;
        let mut squares = Squares {
            radii: [0.0; 64],
            directions: [[0.0; 64]; 2],
            half_sides: [AREA * scale * 0.5; 64],
            weights: [0; 64],
            divisors: [0; 64],
        };
        let mut margin = 0.0_f32;
        let mut point = 0;
        for (radius, count) in RINGS {
            let half_side = if count == 1 {
                AREA * scale * 0.5
            } else {
                let radius = f64::from(AREA * scale) * f64::from(radius);
                (radius * libm::sin(PI / count as f64)) as f32
            };
            margin = margin.max((scale * radius + half_side).ceil() + 1.0);
            for i in 0..count {
                let angle = i as f64 * TAU / count as f64;
                squares.radii[point] = f64::from(scale * radius);
                squares.directions[0][point] = libm::cos(angle);
                squares.directions[1][point] = libm::sin(angle);
                squares.half_sides[point] = half_side;
                point += 1;
            }
        }
        for (i, half_side) in squares.half_sides.into_iter().enumerate() {
            let area = 4.0 * half_side * half_side;
            let weight = (4_194_304.0 / f64::from(area)) as i32;
            squares.weights[i] = weight;
            squares.divisors[i] = (f64::from(weight as f32 * area) / 1024.0) as i32;
        }
        Self { squares, margin }
    }
}

/// Reads descriptors from one image.
pub(super) struct Sampler<'a> {
    pattern: &'a Pattern,
    integral: &'a IntegralImage,
}

impl<'a> Sampler<'a> {
    pub(super) fn new(pattern: &'a Pattern, integral: &'a IntegralImage) -> Self {
        Self { pattern, integral }
    }

    /// The descriptor of a keypoint, whose orientation is set.
    pub(super) fn describe(&self, keypoint: &mut Keypoint) -> [u64; BITS / 64] {
        let centre = [keypoint.at.x, keypoint.at.y];
        let scale = Pattern::scale(keypoint.size);
        let mut values = [0; 64];
        self.sample(centre, scale, 0, &mut values);
        let [x, y] = direction(&values, &self.pattern.direction_weights);
        let radians = f64::from(libm::atan2f(y as f32, x as f32));
        let degrees = (radians / PI * 180.0) as f32;
        keypoint.angle = Some(
            if radians < 0.0 {
                radians + TAU
            } else {
                radians
            } as f32
                % TAU as f32,
        );

        let turn = (f64::from(TURNS) * (f64::from(degrees) / 360.0) + 0.5) as i32;
        self.sample(centre, scale, turn.rem_euclid(TURNS) as usize, &mut values);
        let mut words = [0; BITS / 64];
        for (word, pairs) in words
            .iter_mut()
            .zip(self.pattern.short_pairs.as_chunks::<64>().0)
        {
            for [i, j] in pairs.iter().rev() {
                let brighter = values[usize::from(i % 64)] > values[usize::from(j % 64)];
                *word = *word << 1 | u64::from(brighter);
            }
        }
        words
    }

    /// Means around all points of the pattern, in 1024ths of a grey level.
    fn sample(&self, centre: [f32; 2], scale: usize, turn: usize, values: &mut [i32; 64]) {
        let squares = &self.pattern.scales[scale].squares;
        let (sums, stride) = (self.integral.sums(), self.integral.stride());
        square_means(
            sums,
            stride,
            squares,
            centre,
            self.pattern.turns[turn],
            values,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::GrayImage;

    #[test]
    fn pairs_are_as_many_as_in_the_paper() {
        let pattern = Pattern::new();
        assert_eq!(RINGS.iter().map(|ring| ring.1).sum::<usize>(), POINTS);
        assert_eq!(pattern.short_pairs.len(), BITS);
        let weights = &pattern.direction_weights;
        let long = (weights.x.as_flattened().iter())
            .zip(weights.y.as_flattened())
            .filter(|&(&x, &y)| (x, y) != (0, 0));
        assert_eq!(long.count(), 870);
    }

    #[test]
    fn means_of_a_ramp_are_its_values() {
        let image = GrayImage::from_fn(Size::new(120, 110), |x, y| (x + y) as u8);
        let integral = IntegralImage::new(&image);
        let pattern = Pattern::new();
        let sampler = Sampler::new(&pattern, &integral);
        for (scale, turn, centre) in [
            (0, 0, [50.25, 40.0]),
            (0, 300, [33.7, 71.4]),
            (20, 1000, [60.1, 50.9]),
        ] {
            let mut values = [0; 64];
            sampler.sample(centre, scale, turn, &mut values);
            let Squares {
                radii, directions, ..
            } = &pattern.scales[scale].squares;
            let [cos, sin] = pattern.turns[turn];
            for (i, value) in values.into_iter().enumerate() {
                let [x, y] = directions.map(|along| along[i]);
                let along_both = (cos * x - sin * y) + (sin * x + cos * y);
                let expected = f64::from(centre[0] + centre[1]) + radii[i] * along_both;
                let value = f64::from(value) / 1024.0;
                assert!((value - expected).abs() < 0.2, "{value}, not {expected}");
            }
        }
    }

    #[test]
    fn scales_grow_with_sizes() {
        assert_eq!(Pattern::scale(1.0), 0);
        assert_eq!(Pattern::scale(7.2), 0);
        assert_eq!(Pattern::scale(12.0), 10);
        assert_eq!(Pattern::scale(f32::MAX), SCALES - 1);
        let margins = Pattern::new().scales.into_iter().map(|scale| scale.margin);
        assert!(margins.is_sorted());
    }
}
