//! Which chosen candidates to keep as matches: those found again on the way back from `b` to `a`, and those
//! that move as the matches around them do.

use nalgebra::{Matrix3, Matrix3x2, Point2, Vector2, Vector3};

use super::graph::neighbours;

/// Groups places so that each is within `radius` of the first place of its group. Places are taken in their
/// order, and a place that fits no group starts a new one. Returns for each place the index of the first place
/// of its group.
pub(super) fn clusters(places: &[Point2<f32>], radius: f64) -> Vec<usize> {
    let mut founders: Vec<usize> = Vec::new();
    (0..places.len())
        .map(|index| {
            let near = |&founder: &usize| {
                f64::from((places[founder] - places[index]).norm_squared()) <= radius * radius
            };
            founders.iter().copied().find(near).unwrap_or_else(|| {
                founders.push(index);
                index
            })
        })
        .collect()
}

/// For each of the matches from `a` to `b`, whether it follows a smooth deformation: an affine motion that is
/// fitted robustly to its [`neighbours`] must map it to within `tolerance`. Matches that do not are
/// left out of the next fit; there are `rounds` fits.
pub(super) fn smooth(
    a: &[Vector2<f64>],
    b: &[Vector2<f64>],
    count: usize,
    tolerance: f64,
    rounds: usize,
) -> Vec<bool> {
    let mut kept: Vec<usize> = (0..a.len()).collect();
    for _ in 0..rounds {
        let places: Vec<Vector2<f64>> = kept.iter().map(|&i| a[i]).collect();
        let around = neighbours(&places, count);
        let follows = |index: usize| {
            let i = kept[index];
            let near: Vec<[Vector2<f64>; 2]> = (around[index].iter())
                .map(|&j| kept[j as usize])
                .map(|j| [a[j] - a[i], b[j] - b[i]])
                .collect();
            offset(&near, tolerance).is_some_and(|offset| offset.norm() <= tolerance)
        };
        let next: Vec<usize> = (0..kept.len())
            .filter(|&index| follows(index))
            .map(|index| kept[index])
            .collect();
        if next.len() == kept.len() {
            break;
        }
        kept = next;
    }
    let mut is_kept = vec![false; a.len()];
    for i in kept {
        is_kept[i] = true;
    }
    is_kept
}

/// Steps of reweighting.
const STEPS: usize = 10;

/// The place to which the affine motion of the pairs maps the origin; `None` if they determine none. Residuals
/// far above `tolerance` have almost no weight (Geman and McClure).
fn offset(pairs: &[[Vector2<f64>; 2]], tolerance: f64) -> Option<Vector2<f64>> {
    let mut weights = vec![1.0; pairs.len()];
    let mut motion = Matrix3x2::zeros();
    let size = pairs.iter().map(|[a, _]| a.norm()).fold(0.0, f64::max);
    for _ in 0..STEPS {
        let mut normal =
            Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)) * (1e-6 * size * size);
        let mut right = Matrix3x2::zeros();
        for ([a, b], &weight) in pairs.iter().zip(&weights) {
            let row = Vector3::new(a.x, a.y, 1.0);
            normal += weight * row * row.transpose();
            right += weight * row * b.transpose();
        }
        motion = normal.cholesky()?.solve(&right);
        for ([a, b], weight) in pairs.iter().zip(&mut weights) {
            let taken = motion.transpose() * Vector3::new(a.x, a.y, 1.0);
            let squared = (taken - b).norm_squared() / (tolerance * tolerance);
            *weight = 1.0 / ((1.0 + squared) * (1.0 + squared));
        }
    }
    Some(motion.row(2).transpose())
}
