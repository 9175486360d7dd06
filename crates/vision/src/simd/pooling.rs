//! Sums of gradients over regions of a patch, and the weak learners and projections that learned descriptors
//! (BinBoost, DLCO) compute from them.

use std::ops::Range;

use super::{DIRECTIONS, truncated};

/// Patches that [`vote`] looks at together.
pub const PATCHES_AT_ONCE: usize = 32;
/// Patches that [`project`] looks at together.
pub const VECTORS_AT_ONCE: usize = 8;
/// Rows that [`pool_rows`] looks at together.
pub const POOLED_ROWS: usize = 4;

/// What a share of 1 is multiplied by to become a response: shares above 255/400 are alike.
const RESPONSE: f32 = 400.0;
/// Sums of gradients are counted in 16ths of a grey level.
const FRACTION: f32 = 16.0;

/// A question about one box and one direction: is its response at most `threshold`?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WeakLearner {
    /// `8 box + direction`.
    pub feature: u16,
    /// The largest response with the answer yes.
    pub threshold: u8,
    /// What yes counts; no counts the opposite.
    pub weight: i8,
}

/// Columns that some regions share, weighed alike, and the regions.
#[derive(Clone, Debug, PartialEq)]
pub struct PoolStep {
    /// The first of the columns.
    pub left: usize,
    /// Which of all columns' weights are theirs.
    pub columns: Range<usize>,
    /// Which of all uses are those of their sums.
    pub uses: Range<usize>,
}

/// What a region makes of the sums along some rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoolUse {
    /// The region.
    pub region: usize,
    /// Weights of the rows; 0 for those outside of it.
    pub rows: [f32; POOLED_ROWS],
}

multiversioned! {
    /// Adds a row to an integral image: `next[x + 1]` is the sum of the first `x + 1` pixels of
    /// this row and all before, in 16ths.
    ///
    /// # Panics
    /// If `last` and `next` are not one longer than `row`.
    pub fn integrate_spread(
        row: &[[f32; DIRECTIONS]],
        last: &[[u32; DIRECTIONS]],
        next: &mut [[u32; DIRECTIONS]],
    ) {
        assert!(last.len() == row.len() + 1 && next.len() == last.len(), "one longer");
        let mut sums = [0_u32; DIRECTIONS];
        next[0] = sums;
        for ((shares, above), next) in row.iter().zip(&last[1..]).zip(&mut next[1..]) {
            for i in 0..DIRECTIONS {
                sums[i] += truncated(shares[i] * FRACTION) as u32;
                next[i] = above[i] + sums[i];
            }
        }
    }

    /// For each box (left, top, right, bottom; the last two excluded) which share of its gradients
    /// has each direction, in 400ths, at most 255; 0 where there is no gradient.
    ///
    /// # Panics
    /// If a box reaches beyond the integral image, whose rows hold `stride` values.
    pub fn box_responses(
        integral: &[[u32; DIRECTIONS]],
        stride: usize,
        boxes: &[[u8; 4]],
        responses: &mut [[u8; DIRECTIONS]],
    ) {
        for (&[left, top, right, bottom], responses) in boxes.iter().zip(responses) {
            let at = |x: u8, y: u8| &integral[usize::from(y) * stride + usize::from(x)];
            let corners = [at(left, top), at(right, top), at(left, bottom), at(right, bottom)];
            let mut sums = [0.0_f32; DIRECTIONS];
            for i in 0..DIRECTIONS {
                let sum = corners[3][i]
                    .wrapping_sub(corners[2][i])
                    .wrapping_sub(corners[1][i])
                    .wrapping_add(corners[0][i]);
                sums[i] = sum as i32 as f32;
            }
            let total = ((sums[0] + sums[4]) + (sums[1] + sums[5]))
                + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
            let scale = RESPONSE / total.max(1.0);
            for i in 0..DIRECTIONS {
                responses[i] = truncated((sums[i] * scale).min(255.0)) as u8;
            }
        }
    }

    /// One bit for each of 32 patches: whether the weak learners' answers and `offset` sum to more
    /// than 0.
    ///
    /// # Panics
    /// If a learner asks for a feature that is not there.
    pub fn vote(responses: &[[u8; PATCHES_AT_ONCE]], learners: &[WeakLearner], offset: i16) -> u32 {
        let offset = i32::from(offset);
        let mut yes = [0_i16; PATCHES_AT_ONCE];
        let mut all = 0_i32;
        for learner in learners {
            let weight = i16::from(learner.weight);
            all += i32::from(weight);
            let responses = &responses[usize::from(learner.feature)];
            for i in 0..PATCHES_AT_ONCE {
                yes[i] += if responses[i] <= learner.threshold { weight } else { 0 };
            }
        }
        let mut bits = 0;
        for (i, &yes) in yes.iter().enumerate() {
            bits |= u32::from(2 * i32::from(yes) + offset > all) << i;
        }
        bits
    }

    /// Eight vectors times one matrix, eight columns at a time: adds `vectors[v][i] * matrix[i][j]`
    /// over all `i` in their order. `matrix` holds blocks of eight columns, one after the other.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn project(
        vectors: [&[f32]; VECTORS_AT_ONCE],
        matrix: &[[f32; 8]],
        products: &mut [[[f32; 8]; VECTORS_AT_ONCE]],
    ) {
        let length = vectors[0].len();
        assert!(
            vectors.iter().all(|vector| vector.len() == length)
                && matrix.len() == length * products.len(),
            "a matrix of fitting size"
        );
        for (block, products) in matrix.chunks_exact(length.max(1)).zip(products) {
            let mut sums = [[0.0_f32; 8]; VECTORS_AT_ONCE];
            for (i, row) in block.iter().enumerate() {
                for v in 0..VECTORS_AT_ONCE {
                    let value = vectors[v][i];
                    for j in 0..8 {
                        sums[v][j] = value.mul_add(row[j], sums[v][j]);
                    }
                }
            }
            *products = sums;
        }
    }
}

multiversioned! {
    #![avx512]

    /// Adds what neighbouring rows of gradients count in regions to `sums`: weighted by columns along a
    /// row, those of even and of odd number apart, then by the row, from top to bottom.
    ///
    /// `steps` name the columns (weights in `columns`) and who uses their sums (in `uses`).
    ///
    /// # Panics
    /// If columns lie beyond the end of a row, or what a step names is not there.
    pub fn pool_rows(
        rows: [&[[f32; DIRECTIONS]]; POOLED_ROWS],
        steps: &[PoolStep],
        columns: &[f32],
        uses: &[PoolUse],
        sums: &mut [[f32; DIRECTIONS]],
    ) {
        for step in steps {
            let columns = &columns[step.columns.clone()];
            let mut at = rows;
            for row in &mut at {
                *row = &row[step.left..][..columns.len()];
            }
            let mut along = [[0.0_f32; 2 * DIRECTIONS]; POOLED_ROWS];
            let (weights, last) = columns.as_chunks::<2>();
            for (n, pair) in weights.iter().enumerate() {
                let weights: [f32; 2 * DIRECTIONS] = std::array::from_fn(|i| pair[i / DIRECTIONS]);
                for (along, row) in along.iter_mut().zip(&at) {
                    let pair = row[2 * n..].first_chunk::<2>().expect("a column for each weight");
                    let pair = pair.as_flattened();
                    for i in 0..2 * DIRECTIONS {
                        along[i] = weights[i].mul_add(pair[i], along[i]);
                    }
                }
            }
            if let [weight] = *last {
                for (along, row) in along.iter_mut().zip(&at) {
                    let pixel = &row[columns.len() - 1];
                    for i in 0..DIRECTIONS {
                        along[i] = weight.mul_add(pixel[i], along[i]);
                    }
                }
            }
            let mut both = [[0.0_f32; DIRECTIONS]; POOLED_ROWS];
            for (both, along) in both.iter_mut().zip(&along) {
                for i in 0..DIRECTIONS {
                    both[i] = along[i] + along[i + DIRECTIONS];
                }
            }
            for used in &uses[step.uses.clone()] {
                let sum = &mut sums[used.region];
                for (weight, both) in used.rows.iter().zip(&both) {
                    for i in 0..DIRECTIONS {
                        sum[i] = weight.mul_add(both[i], sum[i]);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn responses_are_shares_of_the_box() {
        // A column of gradients to the right, then one upwards, three times as strong.
        let mut rows = vec![[[0; DIRECTIONS]; 3]];
        for _ in 0..2 {
            let mut row = [[0.0; DIRECTIONS]; 2];
            row[0][0] = 1.0;
            row[1][2] = 3.0;
            let mut next = [[0; DIRECTIONS]; 3];
            integrate_spread(&row, rows.last().expect("a first row"), &mut next);
            rows.push(next);
        }
        let mut responses = [[0; DIRECTIONS]; 2];
        box_responses(
            rows.as_flattened(),
            3,
            &[[0, 0, 2, 2], [1, 1, 2, 2]],
            &mut responses,
        );
        assert_eq!(responses[0], [100, 0, 255, 0, 0, 0, 0, 0]);
        assert_eq!(responses[1], [0, 0, 255, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn votes_are_counted_for_each_patch() {
        let mut rng = Seed(3).rng();
        let responses: Vec<[u8; PATCHES_AT_ONCE]> = (0..40)
            .map(|_| std::array::from_fn(|_| rng.below(256) as u8))
            .collect();
        let learners: Vec<WeakLearner> = (0..128)
            .map(|_| WeakLearner {
                feature: rng.below(40) as u16,
                threshold: rng.below(256) as u8,
                weight: rng.below(255) as i32 as i8,
            })
            .collect();
        let bits = vote(&responses, &learners, 300);
        #[expect(clippy::needless_range_loop, reason = "a column of the responses")]
        for patch in 0..PATCHES_AT_ONCE {
            let sum: i32 = learners
                .iter()
                .map(|l| {
                    let yes = responses[usize::from(l.feature)][patch] <= l.threshold;
                    i32::from(l.weight) * if yes { 1 } else { -1 }
                })
                .sum();
            assert_eq!(bits >> patch & 1 == 1, sum + 300 > 0);
        }
    }

    #[test]
    fn pooling_weighs_rows_and_columns() {
        let spread: Vec<[f32; DIRECTIONS]> = (0..20).map(|i| [i as f32; DIRECTIONS]).collect();
        let rows: Vec<&[[f32; DIRECTIONS]]> = spread.chunks(5).collect();
        let steps = [
            PoolStep {
                left: 1,
                columns: 0..3,
                uses: 0..2,
            },
            PoolStep {
                left: 3,
                columns: 1..3,
                uses: 2..3,
            },
        ];
        let uses = [
            (2, [0.0, 2.0, 1.0, 0.0]),
            (0, [0.0, 0.0, 0.0, 1.0]),
            (0, [1.0; 4]),
        ];
        let uses = uses.map(|(region, rows)| PoolUse { region, rows });
        let mut sums = [[100.0; DIRECTIONS]; 3];
        let rows = [rows[0], rows[1], rows[2], rows[3]];
        pool_rows(rows, &steps, &[1.0, 0.0, 0.5], &uses, &mut sums);
        let expected = [
            100.0 + (16.0 + 9.0) + 0.5 * (4.0 + 9.0 + 14.0 + 19.0),
            100.0,
            100.0 + 2.0 * (6.0 + 4.0) + (11.0 + 6.5),
        ];
        assert_eq!(sums, expected.map(|sum| [sum; DIRECTIONS]));
    }

    #[test]
    fn products_are_those_of_each_vector() {
        let vectors: [Vec<f32>; VECTORS_AT_ONCE] =
            std::array::from_fn(|v| (0..5).map(|i| (v * i) as f32).collect());
        let matrix: Vec<[f32; 8]> = (0..10)
            .map(|i| std::array::from_fn(|j| (i + 8 * j) as f32))
            .collect();
        let mut products = [[[0.0; 8]; VECTORS_AT_ONCE]; 2];
        project(vectors.each_ref().map(|v| &v[..]), &matrix, &mut products);
        for (block, products) in products.iter().enumerate() {
            for (v, row) in products.iter().enumerate() {
                for (j, &product) in row.iter().enumerate() {
                    let expected: f32 = (0..5)
                        .map(|i| vectors[v][i] * matrix[5 * block + i][j])
                        .sum();
                    assert_eq!(product, expected);
                }
            }
        }
    }
}
