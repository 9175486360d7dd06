//! Sums of products of gradients: the second-moment matrix of a patch.

/// Sums that are added to in turn, so that none waits for the one before.
const LANES: usize = 8;

/// Weighted sums of `dx dx`, `dx dy` and `dy dy`, each as so many sums whose sum counts.
pub type GradientProducts = [[f32; LANES]; 3];

multiversioned! {
    /// Adds `weight * weights[x] * [dx dx, dx dy, dy dy]` for each pixel of a row, with the differences of its
    /// neighbours on the right and on the left, below and above. `here` is the row with one more pixel at each
    /// end than `above`, `below` and `weights`.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn add_gradient_products(
        above: &[f32],
        here: &[f32],
        below: &[f32],
        weight: f32,
        weights: &[f32],
        sums: &mut GradientProducts,
    ) {
        let n = weights.len();
        assert!(here.len() == n + 2 && above.len() == n && below.len() == n, "rows of one length");
        let mut start = 0;
        while start + LANES <= n {
            let (above, below) = (&above[start..][..LANES], &below[start..][..LANES]);
            let (left, right) = (&here[start..][..LANES], &here[start + 2..][..LANES]);
            let weights = &weights[start..][..LANES];
            for i in 0..LANES {
                add(sums, i, weight * weights[i], right[i] - left[i], below[i] - above[i]);
            }
            start += LANES;
        }
        for x in start..n {
            add(sums, x - start, weight * weights[x], here[x + 2] - here[x], below[x] - above[x]);
        }
    }
}

#[inline(always)]
fn add(sums: &mut GradientProducts, i: usize, weight: f32, dx: f32, dy: f32) {
    let (x, y) = (weight * dx, weight * dy);
    sums[0][i] = x.mul_add(dx, sums[0][i]);
    sums[1][i] = x.mul_add(dy, sums[1][i]);
    sums[2][i] = y.mul_add(dy, sums[2][i]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    #[test]
    fn products_of_every_pixel_are_summed_and_all_sets_of_instructions_agree() {
        let mut rng = Seed(3).rng();
        let mut row = |n: usize| (0..n).map(|_| rng.normal() as f32).collect::<Vec<_>>();
        let (above, here, below, weights) = (row(21), row(23), row(21), row(21));
        let mut all: Vec<GradientProducts> = Vec::new();
        InstructionSet::for_each(|_| {
            let mut sums = GradientProducts::default();
            for _ in 0..2 {
                add_gradient_products(&above, &here, &below, 0.5, &weights, &mut sums);
            }
            all.push(sums);
        });
        assert!(all.iter().all(|sums| *sums == all[0]));
        let expected = (0..21).fold([0.0; 3], |sum: [f32; 3], x| {
            let (dx, dy) = (here[x + 2] - here[x], below[x] - above[x]);
            let products = [dx * dx, dx * dy, dy * dy];
            [0, 1, 2].map(|i| sum[i] + weights[x] * products[i])
        });
        for (sums, expected) in all[0].iter().zip(expected) {
            let sum: f32 = sums.iter().sum();
            assert!((sum - expected).abs() < 1e-4, "{sum} for {expected}");
        }
    }
}
