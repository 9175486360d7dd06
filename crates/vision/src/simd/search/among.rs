//! The nearest among chosen rows, compared by the definition of the distance.

use super::TwoNearest;

/// Rows that are summed side by side: each sum waits for its own last addition, so eight of them
/// keep the processor busy.
const ROWS: usize = 8;

/// Rows where there are no more than these: often there are only two.
const FEW: usize = 2;

multiversioned! {
    /// The two rows of `rows` nearest to the row `query` among those whose indices are `chosen`, in
    /// ascending order: the distances and the rule for ties are those of
    /// [`two_nearest_floats`](super::two_nearest_floats).
    pub fn two_nearest_among(query: &[f32], rows: &[f32], chosen: &[u32]) -> TwoNearest {
        let mut best = TwoNearest::none(f32::INFINITY);
        for chosen in chosen.chunks(ROWS) {
            for (&index, sum) in chosen.iter().zip(sums_of_few(query, rows, chosen)) {
                best.offer(sum, index);
            }
        }
        best
    }

    /// The least number of bits in which one of the `chosen` rows of `rows` differs from the row `query`; `None` if none
    /// is chosen.
    pub fn nearest_bits_among(query: &[u64], rows: &[u64], chosen: &[u32]) -> Option<u32> {
        let words = query.len();
        let distance = |&index: &u32| {
            let row = &rows[index as usize * words..][..words];
            query.iter().zip(row).map(|(a, b)| (a ^ b).count_ones()).sum()
        };
        chosen.iter().map(distance).min()
    }
}

/// Squared distances to one to [`ROWS`] chosen rows.
#[inline(always)]
fn sums_of_few(query: &[f32], rows: &[f32], chosen: &[u32]) -> [f32; ROWS] {
    if chosen.len() <= FEW {
        let mut all = [0.0; ROWS];
        all[..FEW].copy_from_slice(&sums::<FEW>(query, rows, chosen));
        all
    } else {
        sums(query, rows, chosen)
    }
}

/// Squared distances to the chosen rows, of which there are 1 to `N`; unused entries repeat the last one.
#[inline(always)]
fn sums<const N: usize>(query: &[f32], rows: &[f32], chosen: &[u32]) -> [f32; N] {
    let dim = query.len();
    let mut places = [0; N];
    for (place, row) in places.iter_mut().zip(0..) {
        *place = chosen[chosen.len().min(row + 1) - 1] as usize;
    }
    let rows = places.map(|row| &rows[row * dim..][..dim]);
    let mut sums = [0.0_f32; N];
    for k in 0..dim {
        for (sum, row) in sums.iter_mut().zip(rows) {
            let difference = query[k] - row[k];
            *sum = difference.mul_add(difference, *sum);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::super::{Prepared, two_nearest_floats};
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn among_all_it_is_the_exact_search() {
        let mut rng = Seed(8).rng();
        for (dim, count) in [(1, 1), (1, 40), (3, 7), (64, 8), (128, 33)] {
            let mut draw = |rows: usize| -> Vec<f32> {
                (0..rows * dim).map(|_| rng.uniform() as f32).collect()
            };
            let (query, rows) = (draw(1), draw(count));
            let all: Vec<u32> = (0..count as u32).collect();
            let exact = two_nearest_floats(&query, &rows, dim, &Prepared::default(), None);
            assert_eq!(two_nearest_among(&query, &rows, &all), exact[0]);
        }
    }

    #[test]
    fn the_nearest_bits_are_those_of_a_chosen_row() {
        let rows = [0, 0, 7, 0, 1, u64::MAX];
        assert_eq!(nearest_bits_among(&[0, 0], &rows, &[1, 2]), Some(3));
        assert_eq!(nearest_bits_among(&[1, u64::MAX], &rows, &[0, 2]), Some(0));
        assert_eq!(nearest_bits_among(&[0, 0], &rows, &[]), None);
    }

    #[test]
    fn others_are_not_seen() {
        let rows = [0.0, 5.0, 3.0, 4.0, 3.0];
        let found = two_nearest_among(&[0.5], &rows, &[1, 2, 4]);
        assert_eq!((found.index, found.nearest, found.second), (2, 6.25, 6.25));
        assert_eq!(two_nearest_among(&[0.5], &rows, &[]).nearest, f32::INFINITY);
    }
}
