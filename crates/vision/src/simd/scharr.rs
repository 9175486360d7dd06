//! Derivatives by a widened Scharr operator, row by row, and what is made of them.
//!
//! The operator of step `s` looks at pixels `s` apart: weights `side`, `middle`, `side` across and
//! `-1`, `0`, `1` along. It is applied in two passes: [`weigh_across`] from row to row, then along
//! the row one of the others, on rows that reach `s` pixels further on both sides.

use super::truncated;

/// Weights of the widened Scharr operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scharr {
    /// Distance of the pixels that are compared.
    pub step: usize,
    /// Weight of the outer pixels across the direction of the derivative.
    pub side: f32,
    /// Weight of the middle pixels.
    pub middle: f32,
}

/// Results of [`weigh_across`]: what derivatives along x and along y are made of.
#[derive(Clone, Copy, Debug)]
pub struct Across<'a> {
    /// Weighted means of three rows.
    pub mean: &'a [f32],
    /// The row below minus the row above.
    pub difference: &'a [f32],
}

/// Bins of the histogram of [`count_norms`].
pub const NORM_BINS: usize = 300;
/// Counts for each bin.
pub const NORMS_AT_ONCE: usize = 4;

multiversioned! {
    #![avx512]

    /// The pass from row to row: of the rows `step` above, here, and `step` below the weighted
    /// mean, and the difference of the outer ones.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn weigh_across(
        rows: [&[f32]; 3],
        operator: Scharr,
        mean: &mut [f32],
        difference: &mut [f32],
    ) {
        let n = mean.len();
        let [above, here, below] = rows.map(|row| &row[..n]);
        let difference = &mut difference[..n];
        for x in 0..n {
            let outer = operator.side * (above[x] + below[x]);
            mean[x] = here[x].mul_add(operator.middle, outer);
            difference[x] = below[x] - above[x];
        }
    }

    /// Of [`weigh_across`] the difference alone.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn difference_across(above: &[f32], below: &[f32], difference: &mut [f32]) {
        let n = difference.len();
        let (above, below) = (&above[..n], &below[..n]);
        for x in 0..n {
            difference[x] = below[x] - above[x];
        }
    }

    /// Derivatives along x and y.
    ///
    /// # Panics
    /// If the rows of `across` are not `2 step` longer than `dx` and `dy`.
    pub fn derivatives(across: Across<'_>, operator: Scharr, dx: &mut [f32], dy: &mut [f32]) {
        let n = dx.len();
        let (mean, difference) = (Three::new(across.mean, n, operator), Three::new(across.difference, n, operator));
        let dy = &mut dy[..n];
        for x in 0..n {
            dx[x] = mean.derivative(x);
            dy[x] = difference.mean(x, operator);
        }
    }

    /// `scale (xx yy - xy^2)`, the determinant of the Hessian, from the first derivatives along x
    /// (`of_x`) and, of those along y, the difference of rows.
    ///
    /// # Panics
    /// If the inputs are not `2 step` longer than `out`.
    pub fn determinants(of_x: Across<'_>, difference_of_y: &[f32], operator: Scharr, scale: f32, out: &mut [f32]) {
        let n = out.len();
        let (mean, difference) = (Three::new(of_x.mean, n, operator), Three::new(of_x.difference, n, operator));
        let of_y = Three::new(difference_of_y, n, operator);
        for (x, out) in out.iter_mut().enumerate() {
            let xx = mean.derivative(x);
            let xy = difference.mean(x, operator);
            let yy = of_y.mean(x, operator);
            *out = (xx * yy - xy * xy) * scale;
        }
    }

    /// Lengths of the gradients.
    ///
    /// # Panics
    /// If the rows of `across` are not `2 step` longer than `out`.
    pub fn gradient_norms(across: Across<'_>, operator: Scharr, out: &mut [f32]) {
        let n = out.len();
        let (mean, difference) = (Three::new(across.mean, n, operator), Three::new(across.difference, n, operator));
        for (x, out) in out.iter_mut().enumerate() {
            let (dx, dy) = (mean.derivative(x), difference.mean(x, operator));
            *out = dx.mul_add(dx, dy * dy).sqrt();
        }
    }

    /// The largest of `values`, or 0.
    pub fn find_largest(values: &[f32]) -> f32 {
        let (chunks, rest) = values.as_chunks::<16>();
        let mut largest = [0.0_f32; 16];
        for values in chunks.iter().map(<[f32; 16]>::as_slice).chain([rest]) {
            for (largest, &value) in largest.iter_mut().zip(values) {
                *largest = if value > *largest { value } else { *largest };
            }
        }
        largest.into_iter().fold(0.0, f32::max)
    }

    /// Counts each of `norms`, times `scale`, in the bin of its whole part; what is larger counts in the last bin.
    /// Returns how many are 0.
    ///
    /// Neighbours mostly fall into one bin, and a count in memory waits for the one before it. So there are several
    /// counts for each bin, whose sum counts.
    pub fn count_norms(norms: &[f32], scale: f32, counts: &mut [[u32; NORM_BINS]; NORMS_AT_ONCE]) -> u32 {
        const BLOCK: usize = 64;
        const LAST: i32 = NORM_BINS as i32 - 1;
        let mut zeros = 0;
        for norms in norms.chunks(BLOCK) {
            let mut bins = [0; BLOCK];
            for (bin, &norm) in bins.iter_mut().zip(norms) {
                *bin = truncated(norm * scale).clamp(0, LAST) as usize;
                zeros += u32::from(norm == 0.0);
            }
            for bins in bins[..norms.len()].chunks(NORMS_AT_ONCE) {
                for (counts, &bin) in counts.iter_mut().zip(bins) {
                    counts[bin] += 1;
                }
            }
        }
        zeros
    }

    /// Conductivities `1 / (1 + |gradient|^2 / k^2)`, the function g2 of Perona and Malik;
    /// `inverse` is `1 / k^2`.
    ///
    /// # Panics
    /// If the rows of `across` are not `2 step` longer than `out`.
    pub fn conductivities(across: Across<'_>, operator: Scharr, inverse: f32, out: &mut [f32]) {
        let n = out.len();
        let (mean, difference) = (Three::new(across.mean, n, operator), Three::new(across.difference, n, operator));
        for (x, out) in out.iter_mut().enumerate() {
            let (dx, dy) = (mean.derivative(x), difference.mean(x, operator));
            *out = 1.0 / dx.mul_add(dx, dy * dy).mul_add(inverse, 1.0);
        }
    }
}

/// The three places in a row that one application along it looks at.
struct Three<'a> {
    left: &'a [f32],
    here: &'a [f32],
    right: &'a [f32],
}

impl<'a> Three<'a> {
    #[inline(always)]
    fn new(padded: &'a [f32], n: usize, operator: Scharr) -> Self {
        assert_eq!(padded.len(), n + 2 * operator.step, "padding for the step");
        Self {
            left: &padded[..n],
            here: &padded[operator.step..][..n],
            right: &padded[2 * operator.step..][..n],
        }
    }

    #[inline(always)]
    fn derivative(&self, x: usize) -> f32 {
        self.right[x] - self.left[x]
    }

    #[inline(always)]
    fn mean(&self, x: usize, operator: Scharr) -> f32 {
        let outer = operator.side * (self.left[x] + self.right[x]);
        self.here[x].mul_add(operator.middle, outer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    #[test]
    fn a_plane_has_one_gradient_and_no_curvature() {
        let operator = Scharr {
            step: 2,
            side: 3.0,
            middle: 10.0,
        };
        let row = |y: f32| -> Vec<f32> { (0..27).map(|x| 3.0 * x as f32 + 4.0 * y).collect() };
        let rows = [row(-2.0), row(0.0), row(2.0)];
        let (mut mean, mut difference) = ([0.0; 27], [0.0; 27]);
        let views = std::array::from_fn(|i| rows[i].as_slice());
        weigh_across(views, operator, &mut mean, &mut difference);
        let across = Across {
            mean: &mean,
            difference: &difference,
        };
        let (mut dx, mut dy) = ([0.0; 23], [0.0; 23]);
        derivatives(across, operator, &mut dx, &mut dy);
        // 16 weights, 4 pixels apart.
        assert_eq!((dx, dy), ([192.0; 23], [256.0; 23]));
        gradient_norms(across, operator, &mut dx);
        assert_eq!(dx, [320.0; 23]);
        (dx[3], dx[22]) = (330.0, 340.0);
        assert_eq!((find_largest(&dx[..22]), find_largest(&dx)), (330.0, 340.0));
        conductivities(across, operator, 1.0 / (320.0 * 320.0), &mut dx);
        assert!(dx.iter().all(|c| (c - 0.5).abs() < 1e-6));
        determinants(across, &difference, operator, 1.0, &mut dx);
        // xx = 192, xy = 256, yy = 256 if these were first derivatives.
        assert_eq!(dx, [192.0 * 256.0 - 256.0 * 256.0; 23]);
    }

    #[test]
    fn norms_are_counted_in_the_bins_of_their_whole_parts_with_every_set_of_instructions() {
        let mut rng = Seed(4).rng();
        for count in [1, 3, 63, 64, 130] {
            let mut norms: Vec<f32> = (0..count).map(|_| 40.0 * rng.uniform() as f32).collect();
            (norms[0], norms[count / 2]) = (0.0, 1e9);
            let scale = 8.0;
            let mut expected = [0; NORM_BINS];
            for norm in &norms {
                expected[((norm * scale) as usize).min(NORM_BINS - 1)] += 1;
            }
            let zeros = norms.iter().filter(|&&norm| norm == 0.0).count();
            InstructionSet::for_each(|set| {
                let mut counts = [[0; NORM_BINS]; NORMS_AT_ONCE];
                let found = count_norms(&norms, scale, &mut counts);
                assert_eq!(found as usize, zeros, "{count} norms, {set:?}");
                for (bin, expected) in expected.into_iter().enumerate() {
                    let sum: u32 = counts.iter().map(|counts| counts[bin]).sum();
                    assert_eq!(sum, expected, "bin {bin} of {count} norms, {set:?}");
                }
            });
        }
    }
}
