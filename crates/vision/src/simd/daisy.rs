//! Maps of gradients, for DAISY.

/// Columns of a [`DaisyRow`].
pub const DAISY_COLUMNS: usize = 16;
/// Number of maps: positive parts of the gradient in four directions, and the gradient itself.
pub const DAISY_MAPS: usize = 6;
/// Neighbouring pixels of each map.
pub type DaisyRow = [[f32; DAISY_COLUMNS]; DAISY_MAPS];

multiversioned! {
    /// All maps of a row. Directions are given by what a step to the right and a step downwards
    /// count in them. Gradients are `scale` times the difference of the neighbours on both sides;
    /// the rows above, at and below have one more pixel at each end.
    pub fn rectified_gradients(
        rows: [&[f32; DAISY_COLUMNS + 2]; 3],
        scale: f32,
        directions: &[[f32; 2]; 4],
        maps: &mut DaisyRow,
    ) {
        let [above, here, below] = rows;
        let (mut dx, mut dy) = ([0.0_f32; DAISY_COLUMNS], [0.0_f32; DAISY_COLUMNS]);
        for x in 0..DAISY_COLUMNS {
            dx[x] = scale * (here[x + 2] - here[x]);
            dy[x] = scale * (below[x + 1] - above[x + 1]);
        }
        for (map, [right, down]) in maps.iter_mut().zip(directions) {
            for x in 0..DAISY_COLUMNS {
                map[x] = right.mul_add(dx[x], down * dy[x]).max(0.0);
            }
        }
        maps[4] = dx;
        maps[5] = dy;
    }

    /// Adds to `sum` what two rows hold at the place `down` of the way from the first to the
    /// second, their columns weighted `along` of the way from the first to the second weights.
    pub fn add_between(
        rows: &[DaisyRow; 2],
        down: f32,
        weights: [&[f32; DAISY_COLUMNS]; 2],
        along: f32,
        sum: &mut [f32; DAISY_MAPS],
    ) {
        const LANES: usize = 8;
        let [above, below] = rows;
        let [here, next] = weights;
        let mut weights = [[0.0_f32; DAISY_COLUMNS]; 2];
        for x in 0..DAISY_COLUMNS {
            let weight = along.mul_add(next[x] - here[x], here[x]);
            weights[1][x] = down * weight;
            weights[0][x] = weight - weights[1][x];
        }
        for i in 0..DAISY_MAPS {
            let mut sums = [0.0_f32; LANES];
            for first in [0, LANES] {
                for (k, sum) in sums.iter_mut().enumerate() {
                    let x = first + k;
                    let inner = weights[0][x].mul_add(above[i][x], *sum);
                    *sum = weights[1][x].mul_add(below[i][x], inner);
                }
            }
            let quarter = |k: usize| sums[k] + sums[k + 4];
            sum[i] += (quarter(0) + quarter(2)) + (quarter(1) + quarter(3));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_count_in_the_directions_they_point_to() {
        // Each pixel 2 lighter than the one to the left, the second column 6 lighter downwards.
        let directions = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.5, 0.5]];
        let (mut above, mut below) = ([5.0; 18], [5.0; 18]);
        (above[2], below[2]) = (7.0, 19.0);
        let here = std::array::from_fn(|x| 2.0 * x as f32);
        let mut maps = [[9.0; 16]; 6];
        rectified_gradients([&above, &here, &below], 0.5, &directions, &mut maps);
        let at = |x: usize| maps.map(|map| map[x]);
        assert_eq!(at(0), [2.0, 0.0, 0.0, 1.0, 2.0, 0.0]);
        assert_eq!(at(1), [2.0, 6.0, 0.0, 4.0, 2.0, 6.0]);
    }

    #[test]
    fn rows_and_weights_are_interpolated() {
        let rows: [DaisyRow; 2] = [1, 2].map(|row| {
            std::array::from_fn(|i| std::array::from_fn(|x| (row * 100 + 10 * x + i) as f32))
        });
        let (mut here, mut next) = ([0.0; 16], [0.0; 16]);
        here[3] = 1.0;
        next[12] = 2.0;
        let mut sum = [1.0; 6];
        add_between(&rows, 0.25, [&here, &next], 0.5, &mut sum);
        // A quarter of the way from row 1 to row 2: 125 + 10 x + i.
        let expected = |i: f32| 1.0 + 0.5 * (155.0 + i) + 0.5 * 2.0 * (245.0 + i);
        assert_eq!(sum, std::array::from_fn(|i| expected(i as f32)));
    }
}
