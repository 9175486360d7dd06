//! Maps of gradients in eight directions, for DAISY.

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
}
