//! How likely an estimated pose is right, by the matches alone.
//!
//! Any matches have some best model, also those of two images that show nothing in common. What tells a right one is
//! that many of them lie near its epipolar lines, that they do so all over the images, and that they determine the pose. So
//! four numbers are taken from the distances of all matches from the pose, whatever estimator and threshold found it, and weighed
//! by logistic regression (Cox, "The Regression Analysis of Binary Sequences", Journal of the Royal Statistical
//! Society B 20, 1958):
//!
//! | number | meaning |
//! | --- | --- |
//! | deviation | standard deviation of the pose in degrees, by the near matches and their noise; 0.01 to 180 |
//! | near | 1 and the matches within 2 pixels |
//! | cells | 1 and the cells of a grid of 10 x 10 over the points that have one of these, in the view that has fewer |
//! | all | 1 and the matches |
//!
//! `p = 1 / (1 + exp(-(w_0 + sum w_i ln number_i)))` is the probability that the pose is within 10 degrees of the
//! truth. A low one says that the images have nothing in common or that the matches do not tell; these two cannot be told
//! apart.
//!
//! The weights were fitted to 7756 poses that SIFT, RootSIFT, ORB, AKAZE, KAZE and GMS led to with `ransac-e`, `best` and
//! `adaptive` on the kitchen of 7-Scenes, KITTI 06 and four rendered scenes, each scene of the same weight. Left out by turns, a
//! scene has a Brier score of 0.156 and a calibration error of 0.11 in the mean over five of them. The deviation was taken in
//! after a look at castle and TUM: without it, and with the matches farther off instead, castle's calibration error was 0.27.

use super::TwoViews;
use super::even_sampler::cells_of;
use crate::geometry::{
    PointPairs, RelativePose, essential_from_pose, pose_deviation, squared_sampson_distances,
};

/// Largest angle, of rotation and of translation, between a right pose and the truth, in degrees.
pub const RIGHT_POSE: f64 = 10.0;

/// w_0, and the weights of deviation, near, cells and all.
const WEIGHTS: [f64; 5] = [0.047, -0.964, 2.57, 2.394, -3.801];
/// Distance of near matches in pixels.
const NEAR_PX: f64 = 2.0;
/// Least noise of a match in pixels.
const NOISE_PX: f64 = 0.1;
/// Cells across and down.
const CELLS: u32 = 10;

impl TwoViews<'_> {
    /// The probability that a pose is right, [within 10 degrees](RIGHT_POSE) of the truth, as these matches tell:
    /// calibrated on scenes of many kinds, whatever estimated it.
    ///
    /// # Panics
    /// If the lists of the matches have different lengths.
    pub fn confidence(&self, b_from_a: &RelativePose) -> f64 {
        let (pairs, focal) = (self.at_depth_1(), self.mean_focal());
        let mut squared = vec![0.0; pairs.len()];
        let essential = essential_from_pose(b_from_a);
        squared_sampson_distances(&essential, &pairs, 0..pairs.len(), &mut squared);
        let limit = (NEAR_PX / focal) * (NEAR_PX / focal);
        let is_near: Vec<bool> = squared.iter().map(|&squared| squared <= limit).collect();
        let near: PointPairs = (0..pairs.len())
            .filter(|&i| is_near[i])
            .map(|i| pairs.get(i))
            .collect();
        let sum: f64 = (squared.iter().zip(&is_near))
            .filter(|(_, is_near)| **is_near)
            .map(|(squared, _)| squared)
            .sum();
        // Five of the residuals went into the pose.
        let freedom = near.len().saturating_sub(5).max(1);
        let noise = (sum / freedom as f64).sqrt().max(NOISE_PX / focal);
        let occupied = |x: &[f64], y: &[f64]| {
            let mut cells: Vec<u64> = (cells_of(x, y, CELLS).into_iter().zip(&is_near))
                .filter(|(_, is_near)| **is_near)
                .map(|(cell, _)| cell)
                .collect();
            cells.sort_unstable();
            cells.dedup();
            cells.len()
        };
        let cells = occupied(&pairs.a_x, &pairs.a_y).min(occupied(&pairs.b_x, &pairs.b_y));
        let deviation = pose_deviation(b_from_a, &near, noise).to_degrees();
        let one_more = |count: usize| count as f64 + 1.0;
        let numbers = [
            deviation.max(1e-2),
            one_more(near.len()),
            one_more(cells),
            one_more(pairs.len()),
        ];
        let [constant, weights @ ..] = WEIGHTS;
        let logit = (weights.iter().zip(numbers)).fold(constant, |sum, (weight, number)| {
            sum + weight * libm::log(number)
        });
        1.0 / (1.0 + libm::exp(-logit))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::{Camera, MatchedPoints};
    use crate::robust::{PoseEstimator, SampleConsensus, presets};
    use crate::seed::Seed;

    const CAMERA: Camera = Camera::pinhole(600.0, 600.0, 320.0, 240.0);

    fn truth() -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.02, -0.1, 0.01),
            direction: UnitVector3::new_normalize(Vector3::new(0.9, 0.1, 0.2)),
        }
    }

    /// Right matches in a window of this share of the image, and wrong ones anywhere.
    fn matches(right: usize, wrong: usize, window: f64) -> MatchedPoints {
        let mut rng = Seed(3).rng();
        let mut points = MatchedPoints::default();
        for i in 0..right + wrong {
            let part = if i < right { window } else { 1.0 };
            let a = Point2::new(640.0 * part * rng.uniform(), 480.0 * part * rng.uniform());
            let depth = 3.0 + 6.0 * rng.uniform();
            let x = truth().rotation * (CAMERA.normalize(a).to_homogeneous() * depth)
                + truth().direction.into_inner();
            let mut b = CAMERA.project(Point2::new(x.x / x.z, x.y / x.z));
            b.x += 0.3 * rng.normal();
            b.y += 0.3 * rng.normal();
            if i >= right {
                b = Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
            }
            points.a.push(a);
            points.b.push(b);
            points.ambiguity.push(0.5);
        }
        points
    }

    /// The confidence in what `best` estimates.
    fn confidence(points: &MatchedPoints) -> f64 {
        let views = TwoViews {
            points,
            camera_a: &CAMERA,
            camera_b: &CAMERA,
        };
        let estimator = SampleConsensus::new(presets::best()).expect("a preset is in range");
        let estimate = estimator.estimate(views, Seed(1)).expect("a pose");
        views.confidence(&estimate.b_from_a)
    }

    #[test]
    fn matches_that_agree_are_trusted_and_random_ones_are_not() {
        let (good, bad) = (
            confidence(&matches(300, 100, 1.0)),
            confidence(&matches(0, 400, 1.0)),
        );
        assert!(good > 0.9 && bad < 0.2, "{good} {bad}");
    }

    #[test]
    fn agreement_in_one_corner_says_less_than_all_over() {
        let (wide, narrow) = (
            confidence(&matches(150, 150, 1.0)),
            confidence(&matches(150, 150, 0.15)),
        );
        assert!(wide > narrow + 0.05, "{wide} {narrow}");
    }

    #[test]
    fn no_matches_and_broken_ones_have_a_probability() {
        for count in [0, 1, 5] {
            let points = MatchedPoints {
                a: vec![Point2::new(f64::NAN, 1.0); count],
                b: vec![Point2::new(1.0, f64::INFINITY); count],
                ambiguity: vec![0.0; count],
            };
            let views = TwoViews {
                points: &points,
                camera_a: &CAMERA,
                camera_b: &CAMERA,
            };
            let p = views.confidence(&truth());
            assert!((0.0..0.5).contains(&p), "{p}");
        }
    }
}
