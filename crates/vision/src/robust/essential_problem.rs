//! The essential matrix of two views, from five matches at a time.

use std::ops::Range;

use nalgebra::Matrix3;

use super::Problem;
use crate::geometry::solvers::{Solutions, five_point};
use crate::geometry::{
    Loss, PointPairs, decompose_essential, essential_from_pose, refine_pose,
    squared_sampson_distances,
};

/// Finds the essential matrix; residuals are squared Sampson distances.
#[derive(Clone, Copy, Debug)]
pub struct EssentialProblem<'a> {
    /// The matches, at depth 1.
    pub pairs: &'a PointPairs,
}

impl Problem for EssentialProblem<'_> {
    type Model = Matrix3<f64>;
    type Models = Solutions<Matrix3<f64>, 10>;
    const SAMPLE: usize = 5;

    fn len(&self) -> usize {
        self.pairs.len()
    }

    fn solve(&self, sample: &[u32]) -> Self::Models {
        let point = |i: usize| self.pairs.get(sample[i] as usize);
        five_point(
            &std::array::from_fn(|i| point(i).0),
            &std::array::from_fn(|i| point(i).1),
        )
    }

    fn squared_residuals(&self, model: &Matrix3<f64>, range: Range<usize>, out: &mut [f64]) {
        squared_sampson_distances(model, self.pairs, range, out);
    }

    /// Minimises the truncated squared distance over poses, from the matches near the model.
    fn refine(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        steps: usize,
    ) -> Option<Matrix3<f64>> {
        // All four poses have the same distances.
        let start = decompose_essential(model)?[0];
        let near = near(self.pairs, model, NEAR * squared_threshold);
        let refined = refine_pose(&start, &near, Loss::Truncated, squared_threshold, steps);
        Some(essential_from_pose(&refined))
    }
}

/// Matches beyond this multiple of the squared threshold are taken to stay outliers.
const NEAR: f64 = 9.0;

/// The matches whose squared Sampson distance is at most this.
pub(super) fn near(pairs: &PointPairs, model: &Matrix3<f64>, squared: f64) -> PointPairs {
    let mut residuals = vec![0.0; pairs.len()];
    squared_sampson_distances(model, pairs, 0..pairs.len(), &mut residuals);
    (residuals.iter().enumerate())
        .filter(|&(_, &residual)| residual <= squared)
        .map(|(index, _)| pairs.get(index))
        .collect()
}
