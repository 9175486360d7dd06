//! How keypoints turned and grew between the images, compared with what a pose predicts.
//!
//! A right match shows one patch of the scene twice. A pose and the two points tell where the patch is, and so roughly
//! how it must turn and grow from one view to the other (see `patch_change` of the geometry). A detector measures both,
//! each on its own image, so a wrong match agrees only by chance. Each match gets a trust of
//!
//! ```text
//! 1 / (1 + (error of turn / TURN)^2) * 1 / (1 + (error of growth / GROWTH)^2)
//! ```
//!
//! that is, the shape of Cauchy's density: measured orientations and scales have long tails, and the patch need not face
//! the cameras as assumed. Unlike the trust by the turn that most matches share (see `turns`), this one depends on
//! the model, so it is used where few models are compared.
//!
//! Barath, Kukelova, "Homography from Two Orientation- and Scale-Covariant Features", ICCV 2019, derive what orientations
//! and scales say of a homography; there they give samples of fewer points.
//!
//! | symbol | constant | value | source |
//! | --- | --- | --- | --- |
//! | | `TURN` | 30 degrees | tuned on the kitchen of 7-Scenes and four rendered scenes, 20 to 45 |
//! | | `GROWTH` | 0.5, a factor of 1.65 | the same, 0.35 to 0.8 |

use std::f64::consts::{PI, TAU};

use crate::geometry::{PatchChange, PatchChanges, PointPairs, RelativePose};

const TURN: f64 = PI / 6.0;
const GROWTH: f64 = 0.5;

/// What is known of the keypoints of each match beside their points; see
/// [`MatchedPoints`](crate::geometry::MatchedPoints).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeypointChanges {
    /// By how much the keypoint of `b` is turned against that of `a`, in radians.
    pub turns: Option<Vec<f32>>,
    /// The natural logarithm of how many times as large the keypoint of `b` is, where both are measured at depth 1.
    pub growths: Option<Vec<f32>>,
}

impl KeypointChanges {
    /// How far match `index` is trusted if its patch changes like this, from 0 to 1.
    fn trust(&self, index: usize, predicted: PatchChange) -> f64 {
        let at = |column: &Option<Vec<f32>>| column.as_ref().map(|column| f64::from(column[index]));
        let cauchy = |error: f64, scale: f64| 1.0 / (1.0 + (error / scale) * (error / scale));
        let of_turn = at(&self.turns).map_or(1.0, |turn| {
            let off = (turn - predicted.turn).rem_euclid(TAU);
            cauchy(off.min(TAU - off), TURN)
        });
        let of_growth =
            at(&self.growths).map_or(1.0, |growth| cauchy(growth - predicted.growth, GROWTH));
        of_turn * of_growth
    }

    /// How far each of the matches `near` is trusted under a pose, given the depths of these matches in view `a`. A
    /// match whose patch view `b` would see from behind is not trusted at all.
    pub(super) fn trust_in<'a>(
        &'a self,
        b_from_a: &'a RelativePose,
        pairs: &'a PointPairs,
        near: &'a [u32],
        depths_a: &'a [f64],
    ) -> impl Iterator<Item = f64> + 'a {
        let changes = PatchChanges::under(b_from_a);
        (near.iter().zip(depths_a)).map(move |(&index, &depth)| {
            let index = index as usize;
            (changes.at(pairs.get(index).0, depth))
                .map_or(0.0, |predicted| self.trust(index, predicted))
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::{Camera, MatchedPoints};
    use crate::robust::{
        Geometry, PoseEstimator, SampleConsensus, SampleConsensusParams, TwoViews, presets,
    };
    use crate::seed::{Rng, Seed};

    #[test]
    fn trust_falls_with_either_error_and_is_whole_where_nothing_is_known() {
        let predicted = PatchChange {
            turn: 0.1,
            growth: -0.2,
        };
        let trust = |turn: Option<f32>, growth: Option<f32>| {
            let changes = KeypointChanges {
                turns: turn.map(|turn| vec![turn]),
                growths: growth.map(|growth| vec![growth]),
            };
            changes.trust(0, predicted)
        };
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-6, "{found}");
        near(trust(None, None), 1.0);
        near(trust(Some(0.1), Some(-0.2)), 1.0);
        // An error as large as the scale halves it; whole circles are none.
        near(trust(Some((0.1 + TURN) as f32), None), 0.5);
        near(trust(Some((0.1 - TURN + TAU) as f32), Some(0.3)), 0.25);
        near(trust(Some((0.1 + TURN - TAU) as f32), None), 0.5);
        near(trust(None, Some(0.8)), 0.2);
        assert!(trust(Some(f32::NAN), None).is_nan());
    }

    fn pose(roll: f64, direction: [f64; 3]) -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.02, -0.05, roll),
            direction: UnitVector3::new_normalize(Vector3::from(direction)),
        }
    }

    const CAMERAS: [Camera; 2] = [
        Camera::pinhole(600.0, 600.0, 320.0, 240.0),
        Camera::pinhole(900.0, 900.0, 320.0, 240.0),
    ];

    /// Adds matches of this pose, and the changes of their keypoints that it predicts.
    fn add(
        points: &mut MatchedPoints,
        of: &RelativePose,
        count: usize,
        rng: &mut Rng,
    ) -> Vec<[f32; 2]> {
        let changes = PatchChanges::under(of);
        (0..count)
            .map(|_| {
                let a = Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
                let (ray, depth) = (CAMERAS[0].normalize(a), 2.0 + 4.0 * rng.uniform());
                let x = of.rotation * (ray.to_homogeneous() * depth) + of.direction.into_inner();
                let b = CAMERAS[1].project(Point2::new(x.x / x.z, x.y / x.z));
                let noise = Vector3::from_fn(|_, _| 0.3 * rng.normal());
                points.push(a, b + noise.xy(), 0.5);
                let change = changes.at(ray, depth).expect("it is seen");
                // The focal length of b is 1.5 times that of a.
                [change.turn as f32, (change.growth + 1.5_f64.ln()) as f32]
            })
            .collect()
    }

    #[test]
    fn keypoints_choose_between_two_poses_with_about_as_many_matches() {
        let rng = &mut Seed(3).rng();
        let (wrong, right) = (pose(0.9, [0.7, 0.2, 0.4]), pose(0.0, [0.9, -0.2, -0.5]));
        let mut points = MatchedPoints::default();
        add(&mut points, &wrong, 110, rng);
        // All keypoints change as those of the second pose.
        let changes = add(&mut points, &right, 90, rng);
        let column = |of: usize| {
            let values = (0..points.len()).map(|i| changes[i % changes.len()][of]);
            Some(values.collect::<Vec<f32>>())
        };
        let error = |hypotheses: usize, points: &MatchedPoints| {
            let adaptive = presets::adaptive();
            let params = SampleConsensusParams {
                geometry: Geometry::Essential {
                    cheirality: true,
                    plane_poses: true,
                    tangent_sampson: false,
                    hypotheses,
                    hopeless: 0.0,
                },
                ..adaptive
            };
            let estimator = SampleConsensus::new(params).expect("in range");
            let views = TwoViews {
                points,
                camera_a: &CAMERAS[0],
                camera_b: &CAMERAS[1],
            };
            let found = estimator.estimate(views, Seed(1)).expect("a pose");
            found.b_from_a.error(&right).max().to_degrees()
        };
        let known = |turns: bool, growths: bool| {
            (points.clone().with_turns(column(0).filter(|_| turns)))
                .with_growths(column(1).filter(|_| growths))
        };
        assert!(error(1, &known(true, true)) > 20.0);
        assert!(error(8, &known(true, true)) < 3.0);
        assert!(error(8, &known(true, false)) < 3.0);
        // Nothing is known, so the one with more matches wins.
        assert!(error(8, &known(false, false)) > 20.0);
    }

    #[test]
    fn what_would_be_seen_from_behind_is_not_trusted() {
        let pairs = [(Point2::new(0.1, 0.0), Point2::origin()); 2]
            .into_iter()
            .collect();
        let trust = |turn: f64| -> Vec<f64> {
            let pose = RelativePose {
                rotation: UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn),
                direction: UnitVector3::new_normalize(Vector3::x()),
            };
            let changes = KeypointChanges::default();
            changes
                .trust_in(&pose, &pairs, &[0, 1], &[-1.0, f64::INFINITY])
                .collect()
        };
        assert_eq!(trust(0.1), [1.0; 2]);
        assert_eq!(trust(PI), [0.0; 2]);
    }
}
