//! The two nearest by Euclidean distance.

use super::{Prepared, TILE_BYTES, TwoNearest, pack};

/// Candidates of a panel: two vectors of eight.
const LANES: usize = 16;

/// Queries of a block: with two vectors each, twelve of sixteen registers hold sums.
const ROWS: usize = 6;

/// For each row of `a`, the squared Euclidean distances to its two nearest rows of `b`; both are
/// rows of `dim` values, and `prepared` is what searches among the rows of `b` keep.
///
/// The distance of two rows is defined as `(a[k] - b[k])^2` summed for `k = 0, 1, ...` with one
/// fused multiply-add each. Where the processor can, most candidates are rejected by a cheap lower bound
/// first; the results are identical.
///
/// With the `ratio` of a ratio test, only rows of `a` whose nearest is at less than `ratio` times the distance (not the
/// squared one) of the second nearest are sure to have these two. The others may have any two whose distances have no
/// such ratio, with squared distances that are rounded otherwise.
///
/// # Panics
/// If `dim` is 0.
pub fn two_nearest_floats(
    a: &[f32],
    b: &[f32],
    dim: usize,
    prepared: &Prepared,
    ratio: Option<f32>,
) -> Vec<TwoNearest> {
    #[cfg(target_arch = "x86_64")]
    let found = super::coarse::two_nearest(a, b, dim, &prepared.kept, ratio);
    #[cfg(not(target_arch = "x86_64"))]
    let found = {
        let _ = ratio;
        not_found(a, dim, prepared)
    };
    complete(found, |missing| {
        if missing.len() * dim == a.len() {
            return two_nearest(a, b, dim);
        }
        let rows = missing.iter().flat_map(|&row| &a[row * dim..][..dim]);
        two_nearest(&rows.copied().collect::<Vec<f32>>(), b, dim)
    })
}

/// For each row of `a`, where they can be found fast, rows of `b` in ascending order. Among them
/// are all that are at most as far as the farther of any two that are `apart`: without it of any two, so all
/// that are no farther than the second nearest. `prepared` is what searches among the rows of `b` keep.
pub fn near_rows(
    a: &[f32],
    b: &[f32],
    dim: usize,
    prepared: &Prepared,
    apart: Option<&dyn Fn(u32, u32) -> bool>,
) -> Vec<Option<Vec<u32>>> {
    #[cfg(target_arch = "x86_64")]
    return super::coarse::near_rows(a, b, dim, &prepared.kept, apart);
    #[cfg(not(target_arch = "x86_64"))]
    {
        let _ = (b, apart);
        not_found(a, dim, prepared)
    }
}

/// There are no products of bytes for other processors yet.
#[cfg(not(target_arch = "x86_64"))]
fn not_found<T>(a: &[f32], dim: usize, _: &Prepared) -> Vec<Option<T>> {
    (0..a.len() / dim).map(|_| None).collect()
}

/// Results with those that are missing, which `find` gets in the order of the indices that it is given.
pub fn complete<T>(results: Vec<Option<T>>, find: impl FnOnce(&[usize]) -> Vec<T>) -> Vec<T> {
    let missing = (0..results.len()).filter(|&place| results[place].is_none());
    let missing: Vec<usize> = missing.collect();
    let found = if missing.is_empty() {
        Vec::new()
    } else {
        find(&missing)
    };
    assert_eq!(found.len(), missing.len(), "one result for each");
    let mut found = found.into_iter();
    let results = results.into_iter();
    results
        .filter_map(|known| known.or_else(|| found.next()))
        .collect()
}

/// [`two_nearest_floats`] by definition.
fn two_nearest(a: &[f32], b: &[f32], dim: usize) -> Vec<TwoNearest> {
    let count = b.len() / dim;
    let panels = pack(b, dim);
    let mut best = vec![TwoNearest::none(f32::INFINITY); a.len() / dim];
    let tile = (TILE_BYTES / size_of::<f32>() / dim).max(ROWS);
    for (a, best) in a.chunks(tile * dim).zip(best.chunks_mut(tile)) {
        for (panel, first) in panels.chunks_exact(dim).zip((0..).step_by(LANES)) {
            scan(a, panel, first, count, best);
        }
    }
    best
}

multiversioned! {
    #![avx512]

    /// Offers the candidates of one panel to the queries `a`.
    fn scan(
        a: &[f32],
        panel: &[[f32; LANES]],
        first: usize,
        count: usize,
        best: &mut [TwoNearest],
    ) {
        let dim = panel.len();
        for (rows, best) in a.chunks(ROWS * dim).zip(best.chunks_mut(ROWS)) {
            // The last block is filled up with its last row, whose surplus results the zip below drops.
            let rows: [&[f32]; ROWS] =
                std::array::from_fn(|row| &rows[row.min(best.len() - 1) * dim..][..dim]);
            let mut sums = [[0.0_f32; LANES]; ROWS];
            for k in 0..dim {
                for row in 0..ROWS {
                    for lane in 0..LANES {
                        let difference = rows[row][k] - panel[k][lane];
                        sums[row][lane] = difference.mul_add(difference, sums[row][lane]);
                    }
                }
            }
            for (best, sums) in best.iter_mut().zip(&sums) {
                best.offer_lanes(sums, first, count);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #[cfg(target_arch = "x86_64")]
    use super::super::coarse::WORTH;
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    /// Other processors always make single comparisons.
    #[cfg(not(target_arch = "x86_64"))]
    const WORTH: usize = 1_000;

    /// The definition, one pair at a time.
    fn defined(a: &[f32], b: &[f32], dim: usize) -> Vec<TwoNearest> {
        let distance = |a: &[f32], b: &[f32]| {
            a.iter().zip(b).fold(0.0_f32, |sum, (a, b)| {
                let difference = a - b;
                difference.mul_add(difference, sum)
            })
        };
        a.chunks_exact(dim)
            .map(|a| {
                let mut best = TwoNearest::none(f32::INFINITY);
                for (b, index) in b.chunks_exact(dim).zip(0..) {
                    best.offer(distance(a, b), index);
                }
                best
            })
            .collect()
    }

    /// Compares every path with the definition, for many shapes of data that `value` draws.
    fn check(value: impl Fn(&mut crate::seed::Rng) -> f32) {
        let mut rng = Seed(5).rng();
        let mut draw = |len: usize| (0..len).map(|_| value(&mut rng)).collect::<Vec<f32>>();
        for dim in [1, 3, 64, 120, 128, 200, 259] {
            // The last is worth more than single comparisons.
            let many = (9, WORTH / dim + 1);
            let few = [(0, 7), (7, 0), (1, 1), (7, 33), (33, 7), (1, 16), (13, 100)];
            for (rows_a, rows_b) in few.into_iter().chain([many]) {
                let (a, b) = (draw(rows_a * dim), draw(rows_b * dim));
                let expected = defined(&a, &b, dim);
                InstructionSet::for_each(|set| {
                    let shape = format!("{set:?}: {rows_a} and {rows_b} rows of {dim}");
                    assert_eq!(two_nearest(&a, &b, dim), expected, "{shape}");
                    let prepared = Prepared::default();
                    let found = two_nearest_floats(&a, &b, dim, &prepared, None);
                    assert_eq!(found, expected, "{shape}");
                });
            }
        }
    }

    #[test]
    fn real_values_agree_with_the_definition() {
        check(|rng| rng.normal() as f32);
    }

    #[test]
    fn bytes_agree_with_the_definition() {
        check(|rng| rng.below(256) as f32);
    }

    #[test]
    fn largest_bytes_agree_with_the_definition() {
        check(|rng| 255.0 * rng.below(2) as f32);
    }

    #[test]
    fn few_values_make_ties_and_agree_with_the_definition() {
        check(|rng| rng.below(2) as f32);
    }

    #[test]
    fn nan_and_infinity_agree_with_the_definition() {
        check(|rng| match rng.below(500) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            n => n as f32,
        });
    }

    #[test]
    fn tiles_join() {
        let mut rng = Seed(6).rng();
        let mut draw = |len: usize| {
            (0..len)
                .map(|_| rng.below(256) as f32)
                .collect::<Vec<f32>>()
        };
        let (a, b) = (draw(TILE_BYTES / 4 + 30), draw(70));
        for (a, b) in [(&a, &b), (&b, &a)] {
            let expected = defined(a, b, 1);
            assert_eq!(two_nearest(a, b, 1), expected);
            assert_eq!(
                two_nearest_floats(a, b, 1, &Prepared::default(), None),
                expected
            );
        }
    }
}
