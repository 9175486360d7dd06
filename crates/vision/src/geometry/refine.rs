//! Refinement of a relative pose: minimises a robust sum of squared Sampson distances.
//!
//! A pose has five degrees of freedom. A step moves it on its tangent space: the rotation by a vector `w`
//! (Cayley's map, `R <- R q(1, w / 2)`, which needs no trigonometry), and the direction of translation along
//! two vectors perpendicular to it. The residual of a match is its signed Sampson distance. Steps are those of
//! Levenberg and Marquardt, in radians.

use nalgebra::{Matrix3, Matrix5, Quaternion, UnitQuaternion, UnitVector3, Vector3, Vector5};

use super::epipolar::row_major;
use super::levenberg_marquardt::{LeastSquares, Loss, NormalEquations, minimise};
use super::{
    Covariances, PointPairs, RelativePose, essential_from_pose, squared_sampson_distances,
};
use crate::simd;

/// The pose after at most `max_steps` steps from `start`. Its cost is never larger than that of `start`. The
/// scale of the `loss` is given squared, in the squared unit of the points.
pub fn refine_pose(
    start: &RelativePose,
    pairs: &PointPairs,
    loss: Loss,
    squared_scale: f64,
    max_steps: usize,
) -> RelativePose {
    minimise(
        &SampsonDistances(pairs),
        *start,
        loss,
        squared_scale,
        max_steps,
    )
}

/// Estimates how far a pose may be from the truth, in radians of rotation and direction together, from the
/// matches. Suppose that each match has noise of standard deviation `noise`, in the unit of the points. Then
/// the least-squares pose has the covariance `noise^2 (J^T J)^-1` (Hartley, Zisserman, "Multiple View
/// Geometry", 2004, result 5.10). Its largest eigenvalue is the variance along the direction that the matches
/// determine least. A pose that was not refined also differs from the least-squares pose, by about a
/// Gauss-Newton step, `(J^T J)^-1 J^T r`. The result is the root of the sum of this variance and the squared
/// length of this step. It is at most `UNKNOWN`, which is also the result if the matches do not determine the
/// pose.
///
/// What `J^T J` says of the direction of translation counts by the share `of_scene`, 0 to 1: the rest is no parallax of the
/// scene but noise, which the caller can tell.
pub(crate) fn pose_deviation(
    pose: &RelativePose,
    pairs: &PointPairs,
    noise: f64,
    of_scene: f64,
) -> f64 {
    /// The largest possible value: no angle can be less certain.
    const UNKNOWN: f64 = std::f64::consts::PI;
    let weights = vec![1.0; pairs.len()];
    let NormalEquations {
        matrix: information,
        gradient,
    } = normal_equations(pose, pairs, &weights);
    // Matches so far out that sums of squares overflow tell nothing, and the search for eigenvalues of numbers
    // that are not finite would never end.
    if !information.iter().all(|x| x.is_finite()) {
        return UNKNOWN;
    }
    let scale = Vector5::from_fn(|k, _| if k < 3 { 1.0 } else { of_scene.sqrt() });
    let counted = Matrix5::from_fn(|k, l| information[(k, l)] * (scale[k] * scale[l]));
    let least = counted.symmetric_eigenvalues().min();
    let step = information
        .cholesky()
        .map(|factors| factors.solve(&gradient));
    match step {
        Some(step) if least > 0.0 => libm::hypot(noise / least.sqrt(), step.norm()).min(UNKNOWN),
        _ => UNKNOWN,
    }
}

/// The Sampson distances of matches under a relative pose.
struct SampsonDistances<'a>(&'a PointPairs);

impl LeastSquares<5> for SampsonDistances<'_> {
    type Model = RelativePose;

    fn len(&self) -> usize {
        self.0.len()
    }

    fn squared_residuals(&self, pose: &RelativePose, out: &mut [f64]) {
        squared_sampson_distances(&essential_from_pose(pose), self.0, 0..self.0.len(), out);
    }

    fn normal_equations(&self, pose: &RelativePose, weights: &[f64]) -> Option<NormalEquations<5>> {
        Some(normal_equations(pose, self.0, weights))
    }

    fn moved(&self, pose: &RelativePose, step: &Vector5<f64>) -> RelativePose {
        step_from(pose, step)
    }
}

/// Two directions perpendicular to a direction and to each other.
fn tangent(direction: &UnitVector3<f64>) -> [Vector3<f64>; 2] {
    let d = direction.into_inner();
    let smallest = (1..3).fold(
        0,
        |best, i| if d[i].abs() < d[best].abs() { i } else { best },
    );
    let first = d.cross(&Vector3::ith(smallest, 1.0)).normalize();
    [first, d.cross(&first)]
}

fn step_from(pose: &RelativePose, step: &Vector5<f64>) -> RelativePose {
    let turn = Quaternion::new(1.0, step[0] / 2.0, step[1] / 2.0, step[2] / 2.0);
    let [u, v] = tangent(&pose.direction);
    RelativePose {
        rotation: UnitQuaternion::new_normalize(
            pose.rotation.into_inner() * UnitQuaternion::new_normalize(turn).into_inner(),
        ),
        direction: UnitVector3::new_normalize(
            pose.direction.into_inner() + u * step[3] + v * step[4],
        ),
    }
}

fn normal_equations(
    pose: &RelativePose,
    pairs: &PointPairs,
    weights: &[f64],
) -> NormalEquations<5> {
    let rotation: Matrix3<f64> = *pose.rotation.to_rotation_matrix().matrix();
    let essential = essential_from_pose(pose);
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let [r0, r1, r2] = axes.map(|axis| essential * axis.cross_matrix());
    let [t0, t1] = tangent(&pose.direction).map(|t| t.cross_matrix() * rotation);
    let essential = row_major(&essential);
    let directions = [r0, r1, r2, t0, t1].map(|d| row_major(&d));
    let (a_x, a_y, b_x, b_y) = (
        &pairs.a_x[..],
        &pairs.a_y[..],
        &pairs.b_x[..],
        &pairs.b_y[..],
    );
    let sums = match &pairs.covariances {
        None => {
            let points = [a_x, a_y, b_x, b_y];
            simd::sampson_normal_equations(&essential, &directions, points, weights)
        }
        Some(Covariances {
            a: [a0, a1, a2],
            b: [b0, b1, b2],
        }) => {
            let points = [a_x, a_y, b_x, b_y, a0, a1, a2, b0, b1, b2];
            simd::tangent_sampson_normal_equations(&essential, &directions, points, weights)
        }
    };
    NormalEquations::from_sums(&sums)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::geometry::{Distortion, Lens};
    use crate::seed::Seed;

    fn truth() -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.2, 0.05),
            direction: UnitVector3::new_normalize(Vector3::new(0.8, 0.1, 0.3)),
        }
    }

    /// Matches of a scene at 3 to 7 baselines with this noise, and then wrong ones.
    fn matches(right: usize, wrong: usize, noise: f64) -> PointPairs {
        let mut rng = Seed(4).rng();
        (0..right + wrong)
            .map(|i| {
                let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                let depth = 3.0 + 4.0 * rng.uniform();
                let x = truth().rotation * (a.to_homogeneous() * depth)
                    + truth().direction.into_inner();
                let mut off = |at: f64| at + noise * rng.normal();
                let b = Point2::new(off(x.x / x.z), off(x.y / x.z));
                let anywhere = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                (a, if i < right { b } else { anywhere })
            })
            .collect()
    }

    fn disturbed(by: f64) -> RelativePose {
        step_from(&truth(), &Vector5::new(by, -by, by, -by, by))
    }

    #[test]
    fn exact_matches_give_the_exact_pose() {
        for loss in [Loss::Truncated, Loss::Cauchy] {
            let found = refine_pose(&disturbed(0.02), &matches(50, 0, 0.0), loss, 1e-2, 20);
            assert!(found.error(&truth()).max() < 1e-7, "{loss:?}");
        }
    }

    #[test]
    fn the_deviation_is_that_of_estimates() {
        let noise = 1e-3;
        let pairs = matches(200, 0, noise);
        let stated = pose_deviation(&truth(), &pairs, noise, 1.0);
        let found = refine_pose(&truth(), &pairs, Loss::Truncated, 1.0, 20);
        let off = found.error(&truth()).max();
        assert!(off < 3.0 * stated && off > 0.1 * stated, "{off} {stated}");
        let fewer: PointPairs = (0..50).map(|i| pairs.get(i)).collect();
        let ratio = pose_deviation(&truth(), &fewer, noise, 1.0) / stated;
        assert!(
            (1.4..3.0).contains(&ratio),
            "a quarter of the matches, half as sure: {ratio}"
        );
        let quarter = pose_deviation(&truth(), &pairs, noise, 0.25) / stated;
        assert!(
            (1.5..2.0).contains(&quarter),
            "a quarter of the direction, and of the rotation all: {quarter}"
        );
        let nothing = pose_deviation(&truth(), &pairs, noise, 0.0);
        assert!((nothing - std::f64::consts::PI).abs() < 1e-12);
    }

    #[test]
    fn a_pose_that_is_not_refined_is_as_far_off_as_a_step_takes_it() {
        let (pairs, start) = (matches(200, 0, 0.0), disturbed(0.01));
        let stated = pose_deviation(&start, &pairs, 1e-6, 1.0);
        let error = start.error(&truth());
        let off = error.rotation.hypot(error.translation);
        assert!((stated / off - 1.0).abs() < 0.1, "{stated} {off}");
    }

    #[test]
    fn no_matches_tell_nothing() {
        let stated = pose_deviation(&truth(), &PointPairs::default(), 1e-3, 1.0);
        assert!((stated - std::f64::consts::PI).abs() < 1e-12);
    }

    #[test]
    fn matches_beyond_all_bounds_tell_nothing_and_end() {
        for far in [1e90, 1e160, 1e300, f64::INFINITY, f64::NAN] {
            let at = Point2::new(far, 1.0);
            let pairs: PointPairs = [(at, at); 3].into_iter().collect();
            let stated = pose_deviation(&truth(), &pairs, 1e-3, 1.0);
            assert!(
                stated > 0.0 && stated <= std::f64::consts::PI,
                "{far}: {stated}"
            );
        }
    }

    #[test]
    fn wrong_matches_are_resisted() {
        let pairs = matches(200, 200, 1e-3);
        for loss in [Loss::Truncated, Loss::Cauchy] {
            let found = refine_pose(&disturbed(0.003), &pairs, loss, 9e-6, 20);
            assert!(found.error(&truth()).max() < 6e-3, "{loss:?}");
        }
    }

    #[test]
    fn derivatives_are_those_of_the_distance() {
        let pairs = matches(3, 4, 1e-2);
        check_derivatives(&pairs);
        let lens = Lens::Brown(Distortion {
            k1: -0.3,
            k2: 0.05,
            p1: 0.01,
            p2: -0.02,
            k3: 0.0,
        });
        check_derivatives(&PointPairs {
            covariances: Covariances::of_lenses(pairs.iter(), Some(&lens), Some(&lens)),
            ..pairs
        });
    }

    fn check_derivatives(pairs: &PointPairs) {
        let pose = disturbed(0.05);
        let signed = |pose: &RelativePose, i: usize| {
            let e = essential_from_pose(pose);
            let (a, b) = pairs.get(i);
            let squared = {
                let mut out = [0.0];
                squared_sampson_distances(&e, pairs, i..i + 1, &mut out);
                out[0]
            };
            let algebraic = b.to_homogeneous().dot(&(e * a.to_homogeneous()));
            algebraic.signum() * squared.sqrt()
        };
        for i in 0..pairs.len() {
            let mut weights = vec![0.0; pairs.len()];
            weights[i] = 1.0;
            let NormalEquations {
                matrix: normal,
                gradient,
            } = normal_equations(&pose, pairs, &weights);
            for k in 0..5 {
                let step = Vector5::ith(k, 1e-6);
                let slope = (signed(&step_from(&pose, &step), i)
                    - signed(&step_from(&pose, &-step), i))
                    / 2e-6;
                assert!((normal[(k, k)] - slope * slope).abs() < 1e-6);
                assert!((gradient[k] - slope * signed(&pose, i)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn what_is_not_finite_has_no_influence_and_nothing_stays_where_it_is() {
        let mut pairs = matches(50, 0, 0.0);
        pairs.a_x[3] = f64::NAN;
        pairs.b_y[7] = f64::INFINITY;
        for loss in [Loss::Truncated, Loss::Cauchy] {
            let found = refine_pose(&disturbed(0.02), &pairs, loss, 1e-2, 20);
            assert!(found.error(&truth()).max() < 1e-7, "{loss:?}");
            let start = disturbed(0.02);
            let nothing = PointPairs::default();
            assert_eq!(refine_pose(&start, &nothing, loss, 1e-2, 20), start);
        }
    }
}
