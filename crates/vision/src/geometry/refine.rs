//! Refinement of a relative pose: the least robust sum of squared Sampson distances.
//!
//! Levenberg, "A Method for the Solution of Certain Non-Linear Problems in Least Squares",
//! Quarterly of Applied Mathematics 2, 1944; Marquardt, "An Algorithm for Least-Squares Estimation of
//! Nonlinear Parameters", SIAM Journal 11, 1963. Losses: Huber, Ronchetti, "Robust Statistics", 2nd
//! edition, 2009; as iteratively reweighted least squares.
//!
//! A pose has five degrees of freedom. A step moves it on its tangent space: the rotation by a
//! vector `w` (Cayley's map, `R <- R q(1, w / 2)`, which needs no trigonometry), the direction along
//! two vectors perpendicular to it. The residual of a match is its signed Sampson distance.
//!
//! | constant | value | source |
//! | --- | --- | --- |
//! | `FIRST_DAMPING` | 1e-3, times the diagonal | Marquardt |
//! | `DAMPING_FACTOR` | 10 | Marquardt |
//! | `SMALLEST_STEP` | 1e-9 rad | ours |

use nalgebra::{Matrix3, Matrix5, Quaternion, UnitQuaternion, UnitVector3, Vector3, Vector5};

use super::epipolar::row_major;
use super::{PointPairs, RelativePose, essential_from_pose, squared_sampson_distances};
use crate::simd;

pub(super) const FIRST_DAMPING: f64 = 1e-3;
pub(super) const LARGEST_DAMPING: f64 = 1e6;
pub(super) const DAMPING_FACTOR: f64 = 10.0;
const SMALLEST_STEP: f64 = 1e-9;

/// What a residual r costs, with c the scale of the loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Loss {
    /// `min(r^2, c^2)`: outliers have no influence.
    Truncated,
    /// `c^2 log(1 + r^2 / c^2)`: the influence of outliers fades.
    Cauchy,
}

impl Loss {
    pub(super) fn cost(self, squared: &[f64], limit: f64) -> f64 {
        match self {
            // `min` ignores NaN.
            Self::Truncated => squared.iter().map(|r| r.min(limit)).sum(),
            Self::Cauchy => (squared.iter())
                .filter(|r| r.is_finite())
                .map(|r| limit * libm::log1p(r / limit))
                .sum(),
        }
    }

    /// Weights of the squared residuals, in their place.
    pub(super) fn weigh(self, squared: &mut [f64], limit: f64) {
        for r in squared {
            *r = match self {
                Self::Truncated => f64::from(u8::from(*r <= limit)),
                Self::Cauchy if r.is_finite() => limit / (limit + *r),
                Self::Cauchy => 0.0,
            };
        }
    }
}

/// The pose after at most `max_steps` steps from `start`: never one that costs more. The scale of
/// the `loss` is given squared, in the squared unit of the points.
pub fn refine_pose(
    start: &RelativePose,
    pairs: &PointPairs,
    loss: Loss,
    squared_scale: f64,
    max_steps: usize,
) -> RelativePose {
    let mut residuals = vec![0.0; pairs.len()];
    let mut trial = vec![0.0; pairs.len()];
    let squared = |pose: &RelativePose, out: &mut [f64]| {
        squared_sampson_distances(&essential_from_pose(pose), pairs, 0..pairs.len(), out);
        loss.cost(out, squared_scale)
    };
    let mut pose = *start;
    let mut cost = squared(&pose, &mut residuals);
    let mut damping = FIRST_DAMPING;
    let mut equations = None;
    for _ in 0..max_steps {
        let (normal, gradient) = *equations.get_or_insert_with(|| {
            loss.weigh(&mut residuals, squared_scale);
            normal_equations(&pose, pairs, &residuals)
        });
        let mut damped: Matrix5<f64> = normal;
        for i in 0..5 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let Some(cholesky) = damped.cholesky() else {
            break;
        };
        let step: Vector5<f64> = -cholesky.solve(&gradient);
        let moved = step_from(&pose, &step);
        let moved_cost = squared(&moved, &mut trial);
        if moved_cost < cost {
            (pose, cost) = (moved, moved_cost);
            std::mem::swap(&mut residuals, &mut trial);
            equations = None;
            damping /= DAMPING_FACTOR;
        } else {
            damping *= DAMPING_FACTOR;
        }
        // The damping bounds the number of vain trials. A step of NaN is none.
        let moves = step.norm() > SMALLEST_STEP;
        if !moves || damping > LARGEST_DAMPING {
            break;
        }
    }
    pose
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

/// `J^T W J` and `J^T W r` for the weights W.
fn normal_equations(
    pose: &RelativePose,
    pairs: &PointPairs,
    weights: &[f64],
) -> (Matrix5<f64>, Vector5<f64>) {
    let rotation: Matrix3<f64> = *pose.rotation.to_rotation_matrix().matrix();
    let essential = essential_from_pose(pose);
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let [r0, r1, r2] = axes.map(|axis| essential * axis.cross_matrix());
    let [t0, t1] = tangent(&pose.direction).map(|t| t.cross_matrix() * rotation);
    let sums = simd::sampson_normal_equations(
        &row_major(&essential),
        &[r0, r1, r2, t0, t1].map(|d| row_major(&d)),
        [&pairs.a_x, &pairs.a_y, &pairs.b_x, &pairs.b_y],
        weights,
    );
    let mut normal = Matrix5::zeros();
    let mut next = 0;
    for i in 0..5 {
        for j in 0..=i {
            normal[(i, j)] = sums[next];
            normal[(j, i)] = sums[next];
            next += 1;
        }
    }
    (normal, Vector5::from_column_slice(&sums[15..]))
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
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
        let pose = disturbed(0.05);
        let signed = |pose: &RelativePose, i: usize| {
            let e = essential_from_pose(pose);
            let (a, b) = pairs.get(i);
            let (line, back) = (e * a.to_homogeneous(), e.transpose() * b.to_homogeneous());
            let lines = line.xy().norm_squared() + back.xy().norm_squared();
            b.to_homogeneous().dot(&line) / lines.sqrt()
        };
        for i in 0..pairs.len() {
            let mut weights = vec![0.0; pairs.len()];
            weights[i] = 1.0;
            let (normal, gradient) = normal_equations(&pose, &pairs, &weights);
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
