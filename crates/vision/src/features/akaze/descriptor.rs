//! Orientation, and the 486 comparisons that describe a patch (section 3.3).

use core::f32::consts::TAU;

use crate::image::FloatImage;
use crate::simd::{AROUND, CellSums, Planes, longest_sum_of_slices, sum_cells};

/// Bits: 3 values of each of 4, 9 and 16 cells, each pair of cells compared.
pub(super) const BITS: usize = 3 * (6 + 36 + 120);
/// Words of a row of bits.
const WORDS: usize = BITS.div_ceil(64);
/// Radius of the neighbourhood that gives the orientation, in steps.
const RADIUS: i32 = 6;
/// Standard deviation of its weights, in steps.
const DEVIATION: f64 = 2.5;

/// What is described: an image of the scale space and its derivatives.
#[derive(Clone, Copy)]
pub(super) struct Described<'a> {
    pub(super) image: &'a FloatImage,
    pub(super) dx: &'a FloatImage,
    pub(super) dy: &'a FloatImage,
    /// Distance of samples, in pixels.
    pub(super) step: usize,
}

/// Finds orientations; made once.
#[derive(Clone, Debug)]
pub(super) struct Orientations {
    /// x and y in steps, and the weight, of the samples within the radius.
    around: Vec<([i32; 2], f32)>,
}

impl Orientations {
    pub(super) fn new() -> Self {
        let weight = |x: i32, y: i32| {
            let squared = f64::from(x * x + y * y);
            libm::exp(-squared / (2.0 * DEVIATION * DEVIATION)) as f32
        };
        let places = (-RADIUS..=RADIUS).flat_map(|y| (-RADIUS..=RADIUS).map(move |x| (x, y)));
        let around = places
            .filter(|(x, y)| x * x + y * y < RADIUS * RADIUS)
            .map(|(x, y)| ([x, y], weight(x, y)))
            .collect();
        Self { around }
    }

    /// The dominant direction of the gradients around a place in pixels of the level, in
    /// `[0, 2 pi)` from x towards y.
    pub(super) fn dominant(&self, level: Described<'_>, at: [f32; 2]) -> f32 {
        let size = level.image.size();
        let [x, y] = at.map(|v| v.round_ties_even() as i32);
        let within = |v: i32, length: usize| v.clamp(0, length as i32 - 1) as usize;
        let mut gradients = [[0.0; AROUND]; 2];
        for (i, &([right, down], weight)) in self.around.iter().enumerate() {
            let x = within(x + right * level.step as i32, size.width);
            let y = within(y + down * level.step as i32, size.height);
            gradients[0][i] = weight * level.dx.at(x, y);
            gradients[1][i] = weight * level.dy.at(x, y);
        }
        let angle = longest_sum_of_slices(&gradients[0], &gradients[1]) * TAU;
        if angle < TAU { angle } else { 0.0 }
    }
}

/// The bits that describe the patch about a place, turned by `angle`.
pub(super) fn describe(level: Described<'_>, at: [f32; 2], angle: f32) -> [u64; WORDS] {
    let (sin, cos) = libm::sincosf(angle);
    let step = level.step as f32;
    let image = Planes {
        planes: [level.image, level.dx, level.dy].map(FloatImage::data),
        width: level.image.width(),
    };
    let CellSums { fives, sevens } = sum_cells(image, at, [step * cos, step * sin]);
    // Four cells of 5 x 5 are one of 10 x 10.
    let tens: [[f32; 4]; 3] = fives.map(|cells| {
        std::array::from_fn(|i| {
            let first = i / 2 * 8 + i % 2 * 2;
            (cells[first] + cells[first + 1]) + (cells[first + 4] + cells[first + 5])
        })
    });
    let mut bits = BitWriter::default();
    bits.compare(turned(tens, sin, cos));
    bits.compare(turned(sevens, sin, cos));
    bits.compare(turned(fives, sin, cos));
    bits.words
}

/// The derivatives (planes 1 and 2) along the axes of the patch: across, then along its direction.
fn turned<const N: usize>([mean, x, y]: [[f32; N]; 3], sin: f32, cos: f32) -> [[f32; N]; 3] {
    [
        mean,
        std::array::from_fn(|i| y[i] * cos - x[i] * sin),
        std::array::from_fn(|i| x[i] * cos + y[i] * sin),
    ]
}

/// Bits one after the other, from the least significant of the first word on.
#[derive(Default)]
struct BitWriter {
    words: [u64; WORDS],
    count: usize,
}

impl BitWriter {
    /// For each plane and each pair of cells: whether the first exceeds the second.
    fn compare<const N: usize>(&mut self, planes: [[f32; N]; 3]) {
        for cells in planes {
            for (first, rest) in (1..)
                .map(|i| cells.split_at(i))
                .take(N - 1)
                .map(|(a, b)| (a[a.len() - 1], b))
            {
                let mut bits = 0_u64;
                for (i, &second) in rest.iter().enumerate() {
                    bits |= u64::from(first > second) << i;
                }
                self.push(bits, rest.len());
            }
        }
    }

    fn push(&mut self, bits: u64, count: usize) {
        let (word, shift) = (self.count / 64, self.count % 64);
        self.words[word] |= bits << shift;
        if shift + count > 64 {
            self.words[word + 1] |= bits >> (64 - shift);
        }
        self.count += count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;

    #[test]
    fn a_ramp_has_its_direction_and_ordered_cells() {
        // Brighter to the right and half as much downwards: cells are ordered along the turned x.
        let size = Size::new(200, 200);
        let image = FloatImage::from_fn(size, |x, y| (2 * x + y) as f32);
        let level = Described {
            image: &image,
            dx: &FloatImage::filled(size, 2.0),
            dy: &FloatImage::filled(size, 1.0),
            step: 2,
        };
        let orientations = Orientations::new();
        assert_eq!(orientations.around.len(), 109);
        let angle = orientations.dominant(level, [100.0, 100.0]);
        assert!((angle - 0.463_647_6).abs() < 2e-4, "{angle}");
        let bits = describe(level, [100.0, 100.0], angle)[0];
        // Cells 0, 1 lie before 2, 3: 0 > 2, 0 > 3, 1 > 2, 1 > 3 are false.
        assert_eq!(bits & 0b01_1110, 0);
        let opposite = describe(level, [100.0, 100.0], angle + 0.5 * TAU)[0];
        assert_eq!(opposite & 0b01_1110, 0b01_1110);
    }

    /// Cells are in the order of their places along the patch, then across it. Each plane in turn is what rises along it:
    /// the mean, the derivative across, the derivative along.
    #[test]
    fn each_plane_of_each_grid_is_compared_cell_by_cell() {
        let size = Size::new(200, 200);
        let angle = 0.7;
        let (sin, cos) = libm::sincosf(angle);
        let rise = |factor: f32| {
            FloatImage::from_fn(size, |x, y| factor * (x as f32 * cos + y as f32 * sin))
        };
        for sign in [1.0, -1.0] {
            for (rising, factors) in [[1.0, 0.0, 0.0], [0.0, -sin, cos], [0.0, cos, sin]]
                .into_iter()
                .enumerate()
            {
                let [image, dx, dy] = factors.map(|factor| rise(sign * factor));
                let level = Described {
                    image: &image,
                    dx: &dx,
                    dy: &dy,
                    step: 2,
                };
                let words = describe(level, [100.0, 100.0], angle);
                let mut bit = 0;
                for (side, plane) in [2, 3, 4].into_iter().flat_map(|n| [(n, 0), (n, 1), (n, 2)]) {
                    for first in 0..side * side {
                        for second in first + 1..side * side {
                            let exceeds = words[bit / 64] >> (bit % 64) & 1 == 1;
                            if plane == rising && first / side < second / side {
                                let what = format!("{side} {plane}: {first} with {second}");
                                assert_eq!(exceeds, sign < 0.0, "{what}");
                            }
                            bit += 1;
                        }
                    }
                }
                assert_eq!(bit, BITS);
            }
        }
    }

    #[test]
    fn bits_fill_words_without_gaps() {
        let mut bits = BitWriter::default();
        let falling = |n: usize| -> [[f32; 16]; 3] { [std::array::from_fn(|i| (n - i) as f32); 3] };
        bits.push(0, 60);
        bits.compare(falling(20));
        assert_eq!(bits.count, 420);
        assert_eq!(bits.words[0], 0xf << 60);
        assert!(bits.words[1..6].iter().all(|&word| word == u64::MAX));
        assert_eq!(bits.words[6], (1 << 36) - 1);
    }
}
