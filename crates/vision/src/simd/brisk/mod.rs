//! Means over the squares of a sampling pattern of at most 64 points, and the direction of the gradient over it.

#[cfg(target_arch = "x86_64")]
mod avx2;

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;

/// Weights of the pairs of points that tell the direction: for point `i` and an earlier point `j`,
/// the offset from `i` to `j` over its squared length, in 2048ths; 0 for pairs that do not count.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionWeights {
    /// Along x, `x[i][j]`.
    pub x: Vec<[i32; 64]>,
    /// Along y.
    pub y: Vec<[i32; 64]>,
}

/// The squares over which the points of a pattern take the mean at one scale; what is beyond its points repeats one.
#[derive(Clone, Debug)]
pub struct Squares {
    /// Distances of the centres from the keypoint, in pixels.
    pub radii: [f64; 64],
    /// Cosines and sines of their directions, before the pattern is turned.
    pub directions: [[f64; 64]; 2],
    /// Half the side of each, in pixels.
    pub half_sides: [f32; 64],
    /// Weight of a whole pixel.
    pub weights: [i32; 64],
    /// What a weighted sum is divided by to get 1024ths of a grey level.
    pub divisors: [i32; 64],
}

/// First and last pixel of the squares along one direction, and the shares of them that lie within.
struct Ends {
    pixels: [[i32; 64]; 2],
    shares: [[f32; 64]; 2],
}

/// Means over squares about `centre`, turned by the angle of this cosine and sine, in 1024ths of a grey level.
/// The pixels on the edges of a square count by the share of them that lies within. `sums` are those of an
/// integral image, in rows of `stride`.
///
/// # Panics
/// If a square reaches beyond the image.
pub fn square_means(
    sums: &[u32],
    stride: usize,
    squares: &Squares,
    centre: [f32; 2],
    cos_sin: [f64; 2],
    means: &mut [i32; 64],
) {
    let ends = square_ends(squares, centre, cos_sin);
    let totals = totals(sums, stride, &ends, &squares.weights);
    divide(&totals, &squares.divisors, means);
}

multiversioned! {
    #![avx512]

    /// Where the squares of [`square_means`] begin and end along x, and along y.
    #[expect(clippy::needless_range_loop, reason = "lanes of many arrays at once")]
    fn square_ends(squares: &Squares, centre: [f32; 2], cos_sin: [f64; 2]) -> [Ends; 2] {
        let [cos, sin] = cos_sin;
        let mut places = [[0.0_f32; 64]; 2];
        for i in 0..64 {
            let [x, y] = [squares.directions[0][i], squares.directions[1][i]];
            places[0][i] = (squares.radii[i] * (cos * x - sin * y)) as f32 + centre[0];
            places[1][i] = (squares.radii[i] * (sin * x + cos * y)) as f32 + centre[1];
        }
        [ends(&places[0], &squares.half_sides), ends(&places[1], &squares.half_sides)]
    }

    /// Quotients, rounded half up.
    fn divide(totals: &[i32; 64], divisors: &[i32; 64], means: &mut [i32; 64]) {
        for i in 0..64 {
            let (total, divisor) = (totals[i], divisors[i]);
            // Quotients of integers of 32 bits are nowhere near enough to the next integer to be rounded to it.
            let rounded = f64::from(total.wrapping_add(divisor / 2));
            means[i] = whole_of_double(rounded / f64::from(divisor));
        }
    }
}

/// Sums over squares of pixels times their shares of `weights`.
fn totals(sums: &[u32], stride: usize, ends: &[Ends; 2], weights: &[i32; 64]) -> [i32; 64] {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() >= InstructionSet::Avx2 {
        // SAFETY: what is in use was detected on this processor.
        return unsafe { avx2::totals(sums, stride, ends, weights) };
    }
    totals_one_by_one(sums, stride, ends, weights)
}

/// The definition of [`totals`].
fn totals_one_by_one(
    sums: &[u32],
    stride: usize,
    ends: &[Ends; 2],
    weights: &[i32; 64],
) -> [i32; 64] {
    let [x, y] = ends;
    // Of the nine parts that an edge pixel to each side cuts a square into: what a pixel there counts.
    let mut shares = [[0_i32; 64]; 9];
    for i in 0..64 {
        let weight = weights[i] as f32;
        let [left, right] = [x.shares[0][i], x.shares[1][i]];
        let [upper, lower] = [y.shares[0][i], y.shares[1][i]];
        shares[0][i] = whole(left * upper * weight);
        shares[1][i] = whole(upper * weight);
        shares[2][i] = whole(right * upper * weight);
        shares[3][i] = whole(left * weight);
        shares[4][i] = weights[i];
        shares[5][i] = whole(right * weight);
        shares[6][i] = whole(left * lower * weight);
        shares[7][i] = whole(lower * weight);
        shares[8][i] = whole(right * lower * weight);
    }
    let mut totals = [0_i32; 64];
    for i in 0..64 {
        let [left, right] = [x.pixels[0][i] as usize, x.pixels[1][i] as usize];
        let [top, bottom] = [y.pixels[0][i] as usize, y.pixels[1][i] as usize];
        // Sums of the columns' parts above each of the four lines that cut the square.
        let mut above = [[0; 3]; 4];
        for (k, line) in [top, top + 1, bottom, bottom + 1].into_iter().enumerate() {
            let row = &sums[line * stride..][..stride];
            let ([a, b], [c, d]) = (pair(row, left), pair(row, right));
            above[k] = [b.wrapping_sub(a), c.wrapping_sub(b), d.wrapping_sub(c)];
        }
        let mut total = 0_i32;
        for (part, share) in shares.iter().enumerate() {
            let (line, column) = (part / 3, part % 3);
            let sum = above[line + 1][column].wrapping_sub(above[line][column]);
            total = total.wrapping_add(share[i].wrapping_mul(sum as i32));
        }
        totals[i] = total;
    }
    totals
}

multiversioned! {
    /// The sum over all pairs of the difference of their values times their weights, each product
    /// divided by 1024 and cut off. Values are below 2^18.
    pub fn direction(values: &[i32; 64], weights: &DirectionWeights) -> [i32; 2] {
        let mut sums = [[0_i32; 8]; 2];
        for (i, (x, y)) in weights.x.iter().zip(&weights.y).enumerate() {
            let here = values[i];
            // Pairs with later points have weight 0.
            for start in (0..i).step_by(8) {
                let earlier = values[start..].first_chunk::<8>().expect("blocks of eight");
                let x = x[start..].first_chunk::<8>().expect("blocks of eight");
                let y = y[start..].first_chunk::<8>().expect("blocks of eight");
                for k in 0..8 {
                    let difference = here - earlier[k];
                    sums[0][k] += difference * x[k] / 1024;
                    sums[1][k] += difference * y[k] / 1024;
                }
            }
        }
        let mut direction = [0; 2];
        for (sum, lanes) in direction.iter_mut().zip(sums) {
            for lane in lanes {
                *sum += lane;
            }
        }
        direction
    }
}

#[inline(always)]
fn ends(places: &[f32; 64], half_sides: &[f32; 64]) -> Ends {
    let mut ends = Ends {
        pixels: [[0; 64]; 2],
        shares: [[0.0; 64]; 2],
    };
    for i in 0..64 {
        let (start, end) = (places[i] - half_sides[i], places[i] + half_sides[i]);
        let first = whole_of_double(f64::from(start) + 0.5);
        let last = whole_of_double(f64::from(end) + 0.5);
        ends.pixels[0][i] = first;
        ends.pixels[1][i] = last;
        ends.shares[0][i] = first as f32 - start + 0.5;
        ends.shares[1][i] = end - last as f32 + 0.5;
    }
    ends
}

#[inline(always)]
fn pair(row: &[u32], x: usize) -> [u32; 2] {
    *row[x..].first_chunk().expect("a square within the image")
}

/// The integer part of a number from 0 to below 2^22. Unlike a cast it needs no care for other values: the sum leaves
/// no place for a fraction.
#[inline(always)]
fn whole(x: f32) -> i32 {
    const NO_FRACTION: f32 = 1.5 * (1 << 23) as f32;
    ((x.trunc() + NO_FRACTION).to_bits() & 0x003f_ffff) as i32
}

/// The integer part of a number that an `i32` holds.
#[inline(always)]
fn whole_of_double(x: f64) -> i32 {
    const NO_FRACTION: f64 = 1.5 * (1_u64 << 52) as f64;
    (x.trunc() + NO_FRACTION).to_bits() as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    #[test]
    fn pairs_are_summed_one_by_one() {
        let mut rng = Seed(3).rng();
        let values = std::array::from_fn(|_| rng.below(255 * 1024) as i32);
        let mut weights = DirectionWeights {
            x: Vec::new(),
            y: Vec::new(),
        };
        let mut expected = [0, 0];
        for i in 0..60 {
            let mut row = || -> [i32; 64] {
                std::array::from_fn(|j| {
                    if j < i {
                        rng.below(500) as i32 - 250
                    } else {
                        0
                    }
                })
            };
            let (x, y) = (row(), row());
            for j in 0..i {
                let difference: i32 = values[i] - values[j];
                expected[0] += difference * x[j] / 1024;
                expected[1] += difference * y[j] / 1024;
            }
            weights.x.push(x);
            weights.y.push(y);
        }
        assert_eq!(direction(&values, &weights), expected);
    }

    #[test]
    fn sums_over_squares_are_the_same_bits_in_all_sets() {
        const STRIDE: usize = 47;
        let mut rng = Seed(5).rng();
        // As if the sums before had gone beyond 2^32 many times.
        let sums: Vec<u32> = (0..STRIDE * 40).map(|_| rng.next_u32()).collect();
        for _ in 0..20 {
            let mut ends = |length: u32| {
                let mut ends = Ends {
                    pixels: [[0; 64]; 2],
                    shares: [[0.0; 64]; 2],
                };
                for i in 0..64 {
                    let last = rng.below(length - 1);
                    ends.pixels[1][i] = last as i32;
                    ends.pixels[0][i] = rng.below(last + 1) as i32;
                    ends.shares[0][i] = rng.below(1 << 20) as f32 / (1 << 20) as f32;
                    ends.shares[1][i] = rng.below(1 << 20) as f32 / (1 << 20) as f32;
                }
                ends
            };
            let both = [ends(STRIDE as u32), ends(40)];
            let weights = std::array::from_fn(|_| rng.below(1 << 22) as i32);
            let expected = totals_one_by_one(&sums, STRIDE, &both, &weights);
            InstructionSet::for_each(|set| {
                assert_eq!(totals(&sums, STRIDE, &both, &weights), expected, "{set:?}");
            });
        }
    }

    #[test]
    fn squares_beyond_the_image_are_refused() {
        const STRIDE: usize = 30;
        let refused = |x: [i32; 2], y: [i32; 2]| {
            let ends = [x, y].map(|pixels| Ends {
                pixels: pixels.map(|pixel| [pixel; 64]),
                shares: [[0.5; 64]; 2],
            });
            let call = || totals(&[0; 20 * STRIDE], STRIDE, &ends, &[1; 64]);
            std::panic::catch_unwind(call).is_err()
        };
        InstructionSet::for_each(|set| {
            assert!(!refused([0, 28], [0, 18]), "{set:?}");
            for (x, y) in [
                ([0, 29], [0, 18]),
                ([0, 28], [0, 19]),
                ([-1, 28], [0, 18]),
                ([0, 28], [-1, 18]),
            ] {
                assert!(refused(x, y), "{set:?}: {x:?} {y:?}");
            }
        });
    }
}
