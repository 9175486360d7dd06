//! Weights of matches, such that a crowd of them does not outvote the rest of the scene.
//!
//! Matches that lie close together are not independent evidence: one repeated or textured surface, or one corner
//! found at many scales, can outvote everything else for a model that explains nothing else. So a grid is laid over
//! the points of each view, and a match weighs `1 / sqrt(max(n_a, n_b))`, where n_a and n_b are the numbers of
//! matches in its cells. So n matches in a cell count as much as sqrt(n) lonely ones. That is between n, which
//! would be right for independent matches, and 1, which would be right for copies of each other. The weights are
//! scaled to a mean of 1.
//!
//! Where matches are [trusted](super::turns) to different degrees, the trust is a factor of the weight.
//!
//! The weights are ours. COLMAP chooses its next image by the same idea, that the spread of matches tells more than
//! their number (Schoenberger, Frahm, "Structure-from-Motion Revisited", CVPR 2016, sec. 4.2).
//!
//! | symbol | argument | default | source |
//! | --- | --- | --- | --- |
//! | | `cells` | 10 across and down | tuned on the kitchen of 7-Scenes, 6 to 20 |
//!
//! *Choice*: on the kitchen, and on the rendered scenes, the exponents 1/2, 0.7 and 1 of n do equally well over 14
//! matchers (mean AUC on the kitchen 0.306, 0.307 and 0.306; 0.284 without weights). The smallest exponent was
//! taken, also because on TUM, which was looked at, 1 loses 0.02 with ORB, AKAZE and DLCO.

use std::ops::Range;

use super::grid::{MAX_CELLS, cells_of};
use crate::geometry::PointPairs;

/// A weight for each match.
#[derive(Clone, Debug)]
pub(super) struct EvenWeights {
    /// w, in the order of the data.
    weights: Vec<f64>,
    /// For each datum, the sum of the weights from it to the end.
    sum_from: Vec<f64>,
}

impl EvenWeights {
    /// The weights of these matches, multiplied by the trust in each. A grid of `cells` x `cells` cells is laid
    /// over the points of each view; [far](super::grid) coordinates do not widen it.
    ///
    /// # Panics
    /// If there are no cells, or more than 1000 across.
    pub(super) fn new(pairs: &PointPairs, cells: u32, far: f64, trust: Option<&[f64]>) -> Self {
        let allowed = (1..=MAX_CELLS).contains(&cells);
        assert!(allowed, "a grid of crowds has 1 to 1000 cells across");
        let in_a = crowds(&pairs.a_x, &pairs.a_y, cells, far);
        let in_b = crowds(&pairs.b_x, &pairs.b_y, cells, far);
        let mut weights: Vec<f64> = (in_a.into_iter().zip(in_b))
            .map(|(a, b)| 1.0 / f64::from(a.max(b)).sqrt())
            .collect();
        for (weight, trust) in weights.iter_mut().zip(trust.unwrap_or_default()) {
            *weight *= trust;
        }
        let scale = weights.len() as f64 / weights.iter().sum::<f64>();
        for weight in &mut weights {
            *weight *= scale;
        }
        let mut sum_from = vec![0.0; weights.len() + 1];
        for (i, weight) in weights.iter().enumerate().rev() {
            sum_from[i] = sum_from[i + 1] + weight;
        }
        Self { weights, sum_from }
    }

    /// The weights of the data in `range`.
    pub(super) fn of(&self, range: Range<usize>) -> &[f64] {
        &self.weights[range]
    }

    /// Their sum.
    pub(super) fn sum(&self, range: Range<usize>) -> f64 {
        self.sum_from[range.start] - self.sum_from[range.end]
    }
}

/// For each point, the number of points in its cell, itself included.
fn crowds(x: &[f64], y: &[f64], cells: u32, far: f64) -> Vec<u32> {
    let mut crowds = vec![0; cells as usize * cells as usize + 1];
    let cells = cells_of(x, y, cells, far);
    for &cell in &cells {
        crowds[cell as usize] += 1;
    }
    cells.iter().map(|&cell| crowds[cell as usize]).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::robust::grid::NOTHING_IS_FAR;

    /// Matches at the corners of a square in one view; in the other the first two are at one corner.
    fn crowded(in_b: bool, trust: Option<&[f64]>) -> Vec<f64> {
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(Point2::from);
        let crowd = [corners[0], corners[0], corners[2], corners[3]];
        let (a, b) = if in_b {
            (corners, crowd)
        } else {
            (crowd, corners)
        };
        let pairs: PointPairs = a.into_iter().zip(b).collect();
        let weights = EvenWeights::new(&pairs, 10, NOTHING_IS_FAR, trust);
        assert!((weights.sum(0..4) - 4.0).abs() < 1e-12);
        assert!((weights.sum(1..3) - weights.of(1..3).iter().sum::<f64>()).abs() < 1e-12);
        weights.of(0..4).to_vec()
    }

    #[test]
    fn a_crowd_in_either_view_weighs_the_root_of_its_number_and_less_where_it_is_not_trusted() {
        for in_b in [false, true] {
            for (trust, parts) in [
                (None, [0.5_f64.sqrt(), 0.5_f64.sqrt(), 1.0, 1.0]),
                (
                    Some([0.5, 1.0, 0.25, 1.0]),
                    [0.5 * 0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.25, 1.0],
                ),
            ] {
                let found = crowded(in_b, trust.as_ref().map(|trust| &trust[..]));
                let scale = 4.0 / parts.iter().sum::<f64>();
                for (found, part) in found.iter().zip(parts) {
                    assert!((found - scale * part).abs() < 1e-12, "{found} {part}");
                }
            }
        }
    }
}
