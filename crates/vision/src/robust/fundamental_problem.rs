//! The fundamental matrix of two views, from seven matches at a time.
//!
//! The matches are at depth 1, so what is found is `K_b^T F K_a` (see
//! [`seven_point`](crate::geometry::solvers::seven_point)): in the coordinates of the cameras the
//! equations are well conditioned, and the result needs no conversion. It need not be an essential
//! matrix; the nearest one is taken when it is decomposed.
//!
//! Local optimisation is the normalised eight-point algorithm over the inliers (Hartley, "In Defense
//! of the Eight-Point Algorithm", PAMI 19(6), 1997), with the singularity enforced afterwards.

use std::ops::Range;

use nalgebra::{Matrix3, SMatrix, SVector};

use super::Problem;
use crate::geometry::solvers::{Solutions, seven_point};
use crate::geometry::{PointPairs, squared_sampson_distances};

/// Matches that a local optimisation looks at, at most.
const REFINE_MATCHES: usize = 2000;

/// Finds the fundamental matrix; residuals are squared Sampson distances.
#[derive(Clone, Copy, Debug)]
pub struct FundamentalProblem<'a> {
    /// The matches, at depth 1.
    pub pairs: &'a PointPairs,
}

impl Problem for FundamentalProblem<'_> {
    type Model = Matrix3<f64>;
    type Models = Solutions<Matrix3<f64>, 4>;
    const SAMPLE: usize = 7;

    fn len(&self) -> usize {
        self.pairs.len()
    }

    fn solve(&self, sample: &[u32]) -> Self::Models {
        let point = |i: usize| self.pairs.get(sample[i] as usize);
        seven_point(
            &std::array::from_fn(|i| point(i).0),
            &std::array::from_fn(|i| point(i).1),
        )
    }

    fn squared_residuals(&self, model: &Matrix3<f64>, range: Range<usize>, out: &mut [f64]) {
        squared_sampson_distances(model, self.pairs, range, out);
    }

    fn refine(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        steps: usize,
    ) -> Option<Matrix3<f64>> {
        let mut refined = None;
        for _ in 0..steps {
            let from = refined.as_ref().unwrap_or(model);
            refined = Some(self.refit(from, squared_threshold)?);
        }
        refined
    }
}

impl FundamentalProblem<'_> {
    /// The eight-point solution of the inliers of a model.
    fn refit(self, model: &Matrix3<f64>, squared_threshold: f64) -> Option<Matrix3<f64>> {
        let mut residuals = vec![0.0; self.len()];
        self.squared_residuals(model, 0..self.len(), &mut residuals);
        let inliers: Vec<u32> = (0_u32..)
            .zip(&residuals)
            .filter(|&(_, &squared)| squared <= squared_threshold)
            .map(|(index, _)| index)
            .collect();
        (inliers.len() >= 8)
            .then(|| eight_point(self.pairs, &thinned(&inliers, REFINE_MATCHES)))
            .flatten()
    }
}

/// At most `most` of the numbers, evenly spread.
fn thinned(numbers: &[u32], most: usize) -> Vec<u32> {
    let step = numbers.len().div_ceil(most).max(1);
    numbers.iter().copied().step_by(step).collect()
}

/// The singular matrix that fits the `matches` best in the algebraic sense.
fn eight_point(pairs: &PointPairs, matches: &[u32]) -> Option<Matrix3<f64>> {
    let (from_a, from_b) = (
        normalisation(&pairs.a_x, &pairs.a_y, matches),
        normalisation(&pairs.b_x, &pairs.b_y, matches),
    );
    let mut moments = SMatrix::<f64, 9, 9>::zeros();
    for &index in matches {
        let (a, b) = pairs.get(index as usize);
        let (a, b) = (from_a * a.to_homogeneous(), from_b * b.to_homogeneous());
        let equation = SVector::<f64, 9>::from_fn(|i, _| b[i / 3] * a[i % 3]);
        moments.ger(1.0, &equation, &equation, 1.0);
    }
    if !moments.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigen = moments.symmetric_eigen();
    let smallest = eigen.eigenvalues.imin();
    let flat = eigen.eigenvectors.column(smallest);
    let f = Matrix3::from_row_iterator(flat.iter().copied());
    let mut svd = f.svd(true, true);
    let least = svd.singular_values.imin();
    svd.singular_values[least] = 0.0;
    let singular = svd.recompose().ok()?;
    let f = from_b.transpose() * singular * from_a;
    (f.norm() > 0.0).then(|| f.normalize())
}

/// Moves the centroid of the points to the origin and their mean distance from it to sqrt 2.
fn normalisation(x: &[f64], y: &[f64], matches: &[u32]) -> Matrix3<f64> {
    let count = matches.len() as f64;
    let mean = |values: &[f64]| matches.iter().map(|&i| values[i as usize]).sum::<f64>() / count;
    let (mean_x, mean_y) = (mean(x), mean(y));
    let distances = matches.iter().map(|&i| {
        let (dx, dy) = (x[i as usize] - mean_x, y[i as usize] - mean_y);
        (dx * dx + dy * dy).sqrt()
    });
    let scale = std::f64::consts::SQRT_2 * count / distances.sum::<f64>().max(f64::MIN_POSITIVE);
    Matrix3::new(
        scale,
        0.0,
        -scale * mean_x,
        0.0,
        scale,
        -scale * mean_y,
        0.0,
        0.0,
        1.0,
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::{RelativePose, essential_from_pose};
    use crate::seed::Seed;

    #[test]
    fn refining_comes_closer_to_the_truth() {
        let truth = RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2),
            direction: UnitVector3::new_normalize(Vector3::new(0.8, 0.1, 0.3)),
        };
        let mut rng = Seed(3).rng();
        let pairs: PointPairs = (0..200)
            .map(|_| {
                let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                let depth = 2.0 + 6.0 * rng.uniform();
                let x =
                    truth.rotation * (a.to_homogeneous() * depth) + truth.direction.into_inner();
                (a, Point2::new(x.x / x.z + 2e-4 * rng.normal(), x.y / x.z))
            })
            .collect();
        let e = essential_from_pose(&truth).normalize();
        let problem = FundamentalProblem { pairs: &pairs };
        let start = (e + Matrix3::from_fn(|i, j| 2e-3 * ((3 * i + j) as f64 - 4.0))).normalize();
        let refined = problem.refine(&start, 1e-4, 2).expect("most are inliers");
        let distance = |f: &Matrix3<f64>| (f - e).norm().min((f + e).norm());
        assert!(refined.determinant().abs() < 1e-12);
        assert!(distance(&refined) < 0.5 * distance(&start));
        assert_eq!(problem.refine(&start, 1e-30, 2), None);
    }
}
