//! The matrix that fits many matches best in the algebraic sense, and its repetition over the inliers of each result:
//! the linear part of the eight-point algorithm (see [`fundamental_problem`](super::fundamental_problem)).
//!
//! Hartley, "In Defense of the Eight-Point Algorithm", PAMI 19(6), 1997; Hartley, Zisserman,
//! "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 4.4.
//!
//! The points of each image are moved and scaled so that equations are well conditioned. Each match
//! gives a linear equation in the nine entries of the matrix; the unit vector that violates all of
//! them least is the eigenvector of the smallest eigenvalue of their moments.

use nalgebra::{Matrix3, SMatrix, SVector};

use super::Problem;
use super::consensus::inliers_within;
use crate::geometry::{PointPairs, normalisation};

/// Most matches that a local optimisation uses.
const REFIT_MATCHES: usize = 2000;

/// Calls `fit` with the inliers of the `model`, then with the inliers of its result, and so on, `steps` times.
/// `None` if there are fewer than `least` inliers, or if `fit` finds no model.
pub(super) fn refit<P: Problem>(
    problem: &P,
    model: &P::Model,
    squared_threshold: f64,
    steps: usize,
    least: usize,
    fit: impl Fn(&[u32]) -> Option<P::Model>,
) -> Option<P::Model> {
    let mut residuals = vec![0.0; problem.len()];
    let mut refined = None;
    for _ in 0..steps {
        let from = refined.as_ref().unwrap_or(model);
        problem.squared_residuals(from, 0..problem.len(), &mut residuals);
        let inliers = inliers_within(&residuals, squared_threshold);
        if inliers.len() < least {
            return None;
        }
        refined = Some(fit(&thinned(&inliers, REFIT_MATCHES))?);
    }
    refined
}

/// At most `most` of the numbers, evenly spread over the list.
fn thinned(numbers: &[u32], most: usize) -> Vec<u32> {
    let step = numbers.len().div_ceil(most).max(1);
    numbers.iter().copied().step_by(step).collect()
}

/// A matrix between normalised coordinates, and the transformations of the points of both images to these.
pub(super) struct Normalised {
    pub(super) matrix: Matrix3<f64>,
    pub(super) from_a: Matrix3<f64>,
    pub(super) from_b: Matrix3<f64>,
}

/// The matrix that violates the equations `b^T M a = 0` of the `matches` least.
pub(super) fn least_violating(pairs: &PointPairs, matches: &[u32]) -> Option<Normalised> {
    let points = |x: &[f64], y: &[f64]| {
        normalisation(matches.iter().map(|&i| (x[i as usize], y[i as usize])))
    };
    let from_a = points(&pairs.a_x, &pairs.a_y);
    let from_b = points(&pairs.b_x, &pairs.b_y);
    let mut moments = SMatrix::<f64, 9, 9>::zeros();
    for &index in matches {
        let (a, b) = pairs.get(index as usize);
        let (a, b) = (from_a * a.to_homogeneous(), from_b * b.to_homogeneous());
        // Of the entries row after row.
        let equation = SVector::<f64, 9>::from_fn(|i, _| b[i / 3] * a[i % 3]);
        moments.ger(1.0, &equation, &equation, 1.0);
    }
    if !moments.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigen = moments.symmetric_eigen();
    let flat = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    Some(Normalised {
        matrix: Matrix3::from_row_iterator(flat.iter().copied()),
        from_a,
        from_b,
    })
}
