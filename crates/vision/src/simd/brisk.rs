//! The direction of the gradient over a sampling pattern of at most 64 points.

/// Weights of the pairs of points that tell the direction: for point `i` and an earlier point `j`,
/// the offset from `i` to `j` over its squared length, in 2048ths; 0 for pairs that do not count.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionWeights {
    /// Along x, `x[i][j]`.
    pub x: Vec<[i32; 64]>,
    /// Along y.
    pub y: Vec<[i32; 64]>,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

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
}
