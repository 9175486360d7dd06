//! Maps of gradients in eight directions, for DAISY.

/// Columns of a [`DaisyRow`].
pub const DAISY_COLUMNS: usize = 16;
/// The values of eight maps at neighbouring pixels.
pub type DaisyRow = [[f32; 8]; DAISY_COLUMNS];

multiversioned! {
    /// For each pixel of a row the positive parts of its gradient in eight directions, given by
    /// what a step to the right and a step downwards count in each of them. Differences are
    /// central: the rows above, at and below have one more pixel at each end.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn rectified_gradients(
        rows: [&[f32]; 3],
        directions: &[[f32; 8]; 2],
        maps: &mut [[f32; 8]],
    ) {
        let width = maps.len();
        assert!(rows.iter().all(|row| row.len() == width + 2), "a row with its neighbours");
        let [above, here, below] = rows;
        let [right, down] = directions;
        for x in 0..width {
            let (dx, dy) = (0.5 * (here[x + 2] - here[x]), 0.5 * (below[x + 1] - above[x + 1]));
            for i in 0..8 {
                maps[x][i] = right[i].mul_add(dx, down[i] * dy).max(0.0);
            }
        }
    }

    /// Adds to `sum` what two rows hold at the place `down` of the way from the first to the
    /// second, their columns weighted `along` of the way from the first to the second weights.
    pub fn add_between(
        rows: &[DaisyRow; 2],
        down: f32,
        weights: [&[f32; DAISY_COLUMNS]; 2],
        along: f32,
        sum: &mut [f32; 8],
    ) {
        let [here, next] = weights;
        let mut weights = [0.0_f32; DAISY_COLUMNS];
        for x in 0..DAISY_COLUMNS {
            weights[x] = along.mul_add(next[x] - here[x], here[x]);
        }
        // Of the even and of the odd columns.
        let mut sums = [[[0.0_f32; 8]; 2]; 2];
        for x in 0..DAISY_COLUMNS {
            for (sums, row) in sums.iter_mut().zip(rows) {
                for i in 0..8 {
                    sums[x % 2][i] = weights[x].mul_add(row[x][i], sums[x % 2][i]);
                }
            }
        }
        let [above, below] = sums;
        for i in 0..8 {
            let (above, below) = (above[0][i] + above[1][i], below[0][i] + below[1][i]);
            sum[i] += down.mul_add(below - above, above);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_count_in_the_directions_they_point_to() {
        // Each pixel 2 lighter than the one to the left, the second column 6 lighter downwards.
        let directions = [
            [1.0, 0.0, -1.0, 0.0, 0.5, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, -1.0, 0.5, 0.0, 0.0, 0.0],
        ];
        let mut maps = [[0.0; 8]; 2];
        rectified_gradients(
            [
                &[0.0, 5.0, 7.0, 0.0],
                &[0.0, 2.0, 4.0, 6.0],
                &[0.0, 5.0, 19.0, 0.0],
            ],
            &directions,
            &mut maps,
        );
        assert_eq!(maps[0], [2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(maps[1], [2.0, 6.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn rows_and_weights_are_interpolated() {
        let rows: [DaisyRow; 2] = [1, 2].map(|row| {
            std::array::from_fn(|x| std::array::from_fn(|i| (row * 100 + 10 * x + i) as f32))
        });
        let (mut here, mut next) = ([0.0; 16], [0.0; 16]);
        here[3] = 1.0;
        next[4] = 2.0;
        let mut sum = [1.0; 8];
        add_between(&rows, 0.25, [&here, &next], 0.5, &mut sum);
        // A quarter of the way from row 1 to row 2: 125 + 10 x + i.
        let expected = |i: f32| 1.0 + 0.5 * (155.0 + i) + 0.5 * 2.0 * (165.0 + i);
        assert_eq!(sum, std::array::from_fn(|i| expected(i as f32)));
    }
}
