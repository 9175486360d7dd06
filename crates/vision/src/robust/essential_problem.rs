//! The essential matrix of two views, from five matches at a time.

use std::ops::Range;

use nalgebra::Matrix3;

use super::Problem;
use crate::geometry::solvers::{Solutions, five_point};
use crate::geometry::{PointPairs, squared_sampson_distances};

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
}
