//! Where a camera is on the body to which it is fixed, such as a depth camera, an inertial sensor or the hand of a robot.
//!
//! Park, Martin, "Robot Sensor Calibration: Solving AX = XB on the Euclidean Group", IEEE Transactions on Robotics and
//! Automation 10(5), 717-721, 1994, state the problem and solve it for whole motions. Here the length of what the camera
//! moved is not known.
//!
//! *How it works.* With `X = camera_from_body` a motion `B` of the body is the motion `A = X B X^-1` of the camera:
//!
//! ```text
//! R_A = R_X R_B R_X^T,    t_A = R_X t_B + t_X - R_A t_X
//! ```
//!
//! 1. `R_X` turns the axis of `R_B` to that of `R_A`, and, where `t_X` is short beside what the body moved, the direction of
//!    `t_B` to that of `t_A`. The rotation that does this best follows from a singular value decomposition.
//! 2. From there, and also from no rotation at all, `X` is refined: it minimises the squared differences of rotations and
//!    directions, with Cauchy's loss, since some estimates are wrong. The better end is taken; of equally good ones, which
//!    there are where motions do not determine `X`, the one that began without a rotation.

use nalgebra::{
    Isometry3, Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, UnitVector3,
    Vector3, Vector6,
};

use super::RelativePose;
use super::levenberg_marquardt::{LeastSquares, Loss, NormalEquations, minimise};

/// Steps of the refinement; more change nothing.
const MAX_STEPS: usize = 50;

/// Costs that differ by less than this share of the squared scale are equal.
const EQUAL: f64 = 1e-3;

/// Step of the numeric derivatives, in radians and in the unit of what the body moved.
const DELTA: f64 = 1e-6;

/// `camera_from_body`, from motions of the body and estimates of those of the camera, each `b_from_a`; `None` without any.
/// An estimate that is off by more than about `scale` radians counts less and less.
///
/// The translation has the unit of the body's translations. It is not determined where the body only moves without
/// turning, and the rotation neither where it moves along one line.
pub fn camera_from_body(
    motions: &[(Isometry3<f64>, RelativePose)],
    scale: f64,
) -> Option<Isometry3<f64>> {
    let loss = Loss::Cauchy;
    let problem = Motions(motions);
    let ends = [UnitQuaternion::identity(), turn(motions)?].map(|turn| {
        let start = Isometry3::from_parts(Translation3::identity(), turn);
        let end = minimise(&problem, start, loss, scale * scale, MAX_STEPS);
        let mut squared = vec![0.0; motions.len()];
        problem.squared_residuals(&end, &mut squared);
        let (_, cost) = loss.cost(&squared, scale * scale);
        (cost, end)
    });
    let [(cost, end), (turned_cost, turned_end)] = ends;
    let is_better = turned_cost < cost - EQUAL * scale * scale;
    Some(if is_better { turned_end } else { end })
}

/// The rotation that best turns axes and directions of the body's motions to those of the camera's.
fn turn(motions: &[(Isometry3<f64>, RelativePose)]) -> Option<UnitQuaternion<f64>> {
    let mut sum = Matrix3::zeros();
    for (body, camera) in motions {
        sum += camera.direction.into_inner() * direction(body).transpose();
        sum += camera.rotation.scaled_axis() * body.rotation.scaled_axis().transpose();
    }
    let svd = (!motions.is_empty()).then(|| sum.svd(true, true))?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let handedness = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, handedness)) * v_t;
    let rotation = Rotation3::from_matrix_unchecked(rotation);
    Some(UnitQuaternion::from_rotation_matrix(&rotation))
}

/// The direction in which the motion leads; zero if it does not.
fn direction(motion: &Isometry3<f64>) -> Vector3<f64> {
    let direction = RelativePose::direction_of(&motion.translation.vector);
    direction.map_or_else(Vector3::zeros, UnitVector3::into_inner)
}

/// Motions of the body, and estimates of those of the camera.
struct Motions<'a>(&'a [(Isometry3<f64>, RelativePose)]);

/// The rotation and the direction of a camera's motion less the estimated ones.
fn residual(
    (body, camera): &(Isometry3<f64>, RelativePose),
    camera_from_body: &Isometry3<f64>,
) -> Vector6<f64> {
    let moved = camera_from_body * body * camera_from_body.inverse();
    let turned = (camera.rotation.inverse() * moved.rotation).scaled_axis();
    let led = direction(&moved) - camera.direction.into_inner();
    Vector6::from_iterator(turned.iter().chain(&led).copied())
}

impl LeastSquares<6> for Motions<'_> {
    type Model = Isometry3<f64>;

    fn len(&self) -> usize {
        self.0.len()
    }

    fn squared_residuals(&self, model: &Isometry3<f64>, out: &mut [f64]) {
        for (out, motion) in out.iter_mut().zip(self.0) {
            *out = residual(motion, model).norm_squared();
        }
    }

    fn normal_equations(
        &self,
        model: &Isometry3<f64>,
        weights: &[f64],
    ) -> Option<NormalEquations<6>> {
        let moved: [Isometry3<f64>; 6] = std::array::from_fn(|number| {
            let step = Vector6::ith(number, DELTA);
            self.moved(model, &step)
        });
        let mut equations = NormalEquations {
            // What the motions do not determine stays as it is.
            matrix: SMatrix::identity() * 1e-9,
            gradient: SVector::zeros(),
        };
        for (motion, weight) in self.0.iter().zip(weights) {
            let here = residual(motion, model);
            let columns = moved.map(|moved| (residual(motion, &moved) - here) / DELTA);
            let jacobian = SMatrix::<f64, 6, 6>::from_columns(&columns);
            equations.matrix += jacobian.transpose() * jacobian * *weight;
            equations.gradient += jacobian.transpose() * here * *weight;
        }
        Some(equations)
    }

    /// Turned by the first three numbers, and moved by the others.
    fn moved(&self, model: &Isometry3<f64>, step: &SVector<f64, 6>) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(model.translation.vector + step.fixed_rows::<3>(3)),
            UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0)) * model.rotation,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    /// Motions of a body and, of each third, a wrong estimate of that of the camera.
    fn motions(camera_from_body: &Isometry3<f64>) -> Vec<(Isometry3<f64>, RelativePose)> {
        let mut rng = Seed(5).rng();
        let mut vector =
            |length: f64| Vector3::from_fn(|_, _| length * (2.0 * rng.uniform() - 1.0));
        let motion = |number: usize| {
            let body = Isometry3::new(vector(1.0), vector(0.5));
            let camera = match number % 3 {
                0 => Isometry3::new(vector(1.0), vector(0.5)),
                _ => camera_from_body * body * camera_from_body.inverse(),
            };
            let camera = RelativePose::from_isometry(&camera).expect("it moves");
            (body, camera)
        };
        (0..40).map(motion).collect()
    }

    #[test]
    fn a_camera_is_found_on_its_body_though_estimates_are_wrong() {
        let far = Vector3::new(0.4, -0.3, 0.2);
        for (place, turn) in [
            (Vector3::zeros(), Vector3::zeros()),
            (far, Vector3::new(0.1, -0.05, 0.02)),
            // The axes of a robot.
            (
                far,
                2.0 * std::f64::consts::FRAC_PI_3 * Vector3::new(1.0, -1.0, 1.0).normalize(),
            ),
            (Vector3::zeros(), Vector3::new(0.0, 3.0, 0.0)),
        ] {
            let there = Isometry3::new(place, turn);
            let found = camera_from_body(&motions(&there), 0.05).expect("there are motions");
            let off = found.rotation.angle_to(&there.rotation);
            assert!(off < 2e-3, "{turn:?}: turned by {off}");
            let off = (found.translation.vector - place).norm();
            assert!(off < 5e-3, "{place:?}: {off} away");
        }
        assert!(camera_from_body(&[], 0.05).is_none());
    }

    #[test]
    fn where_nothing_turns_directions_tell_the_rotation() {
        let there = Isometry3::new(Vector3::zeros(), Vector3::new(0.1, 0.3, -0.2));
        let mut straight = motions(&there);
        for (body, camera) in &mut straight {
            body.rotation = UnitQuaternion::identity();
            let moved = there * *body * there.inverse();
            *camera = RelativePose::from_isometry(&moved).expect("it moves");
        }
        let found = camera_from_body(&straight, 0.05).expect("there are motions");
        assert!(found.rotation.angle_to(&there.rotation) < 1e-6);
        assert!(found.translation.vector.iter().all(|x| x.is_finite()));
    }

    #[test]
    fn along_one_line_the_least_turn_is_taken() {
        let there = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.1, 0.0));
        let along = |length: f64| {
            let body = Isometry3::translation(length, 0.0, 0.0);
            let camera = RelativePose {
                rotation: UnitQuaternion::identity(),
                direction: UnitVector3::new_normalize(there * body.translation.vector),
            };
            (body, camera)
        };
        let line = [1.0, -2.0, 3.0].map(along);
        let found = camera_from_body(&line, 0.05).expect("there are motions");
        assert!(found.rotation.angle_to(&there) < 1e-6, "{found}");
    }
}
