//! Matches of simulated views, and what they say of poses.

use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

use super::*;
use crate::geometry::{Camera, Distortion, Lens, MatchedPoints};
use crate::robust::{
    EssentialProblem, Hopeless, PoseEstimate, PoseEstimator, Problem, SampleConsensus,
    SampleConsensusParams, presets,
};
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

/// Of what `best` estimates.
fn of_best(points: &MatchedPoints) -> PoseProbabilities {
    of_estimator(presets::best(), points)
}

fn of_estimator(params: SampleConsensusParams, points: &MatchedPoints) -> PoseProbabilities {
    views(points).pose_probabilities(&estimate(params, points).b_from_a)
}

fn estimate(params: SampleConsensusParams, points: &MatchedPoints) -> PoseEstimate {
    let estimator = SampleConsensus::new(params).expect("a preset is in range");
    estimator.estimate(views(points), Seed(1)).expect("a pose")
}

fn views(points: &MatchedPoints) -> TwoViews<'_> {
    TwoViews {
        points,
        camera_a: &CAMERA,
        camera_b: &CAMERA,
    }
}

#[test]
fn matches_that_agree_are_trusted_and_random_ones_are_not() {
    let (good, bad) = (
        of_best(&matches(300, 100, 1.0)),
        of_best(&matches(0, 400, 1.0)),
    );
    assert!(good.right > 0.8 && good.overlap > 0.95, "{good:?}");
    assert!(bad.right <= bad.overlap && bad.overlap < 0.2, "{bad:?}");
}

/// The truth, turned about the vertical axis by some degrees.
fn turned(degrees: f64) -> RelativePose {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
    RelativePose {
        rotation: turn * truth().rotation,
        direction: turn * truth().direction,
    }
}

#[test]
fn a_coarse_pose_is_judged_by_the_one_that_it_leads_to() {
    let points = matches(300, 100, 1.0);
    let right = views(&points).pose_probabilities(&truth());
    let coarse = |degrees| {
        let pairs = views(&points).at_depth_1();
        let near = NearMatches::of(&turned(degrees), &pairs, views(&points).mean_focal());
        // Hardly any more than one in eight: the pose looks like one of wrong matches.
        assert!(near.pairs.len() < 60, "{}", near.pairs.len());
        views(&points).pose_probabilities(&turned(degrees))
    };
    for degrees in [-8.0, -4.0, 4.0, 8.0] {
        let found = coarse(degrees);
        assert!((found.right - right.right).abs() < 0.05, "{found:?}");
        assert!((found.overlap - right.overlap).abs() < 0.01, "{found:?}");
    }
    // It leads to the right one, and so is known to be wrong.
    for degrees in [-12.0, 12.0] {
        let found = coarse(degrees);
        assert!(found.right == 0.0 && found.overlap > 0.95, "{found:?}");
    }
    let points = matches(0, 400, 1.0);
    for degrees in [-8.0, 0.0, 8.0] {
        let found = views(&points).pose_probabilities(&turned(degrees));
        assert!(found.overlap < 0.2, "{found:?}");
    }
}

#[test]
fn a_hopeless_pair_is_given_up_after_a_quarter_of_the_samples() {
    let adaptive = presets::adaptive();
    let quarter = adaptive.max_iterations / 4;
    let noise = 100;
    let samples = |points: &MatchedPoints| estimate(adaptive, points).iterations;
    assert_eq!(samples(&matches(0, 400, 1.0)), noise + quarter);
    // So few that no confidence is reached, and still right.
    let few = matches(60, 400, 1.0);
    assert_eq!(samples(&few), noise + adaptive.max_iterations);
    assert!(of_estimator(adaptive, &few).right > 0.5);
}

#[test]
fn a_search_that_measures_in_the_image_asks_for_the_same_probability() {
    let lens = Distortion {
        k1: -0.28,
        k2: 0.07,
        ..Distortion::default()
    };
    let camera = Camera {
        distortion: Some(Lens::Brown(lens)),
        ..CAMERA
    };
    let views = TwoViews {
        points: &matches(300, 100, 1.0),
        camera_a: &camera,
        camera_b: &camera,
    };
    let pairs = views.at_depth_1_with_covariances();
    assert!(pairs.covariances.is_some());
    let found = pose_probabilities(&pairs, views.mean_focal(), &truth());
    assert_eq!(found, views.pose_probabilities(&truth()));
}

#[test]
fn thousands_of_random_matches_are_no_overlap() {
    // Near the best model there are enough to fill half of the cells, but no more than chance brings. (`best` gives
    // up all models.)
    for wrong in [4_000, 10_000] {
        let found = of_estimator(presets::mlesac_e(), &matches(0, wrong, 1.0));
        assert!(found.overlap < 0.5, "{wrong}: {found:?}");
    }
    let found = of_best(&matches(2_000, 8_000, 1.0));
    assert!(found.overlap > 0.95, "{found:?}");
}

#[test]
fn a_match_far_beside_the_image_says_nothing() {
    let points = matches(300, 100, 1.0);
    let good = of_best(&points);
    for far in [10.0, 100.0, 1e9] {
        let mut points = points.clone();
        let at = CAMERA.project(Point2::new(far, far));
        points.push(at, at, 0.5);
        let found = of_best(&points);
        assert!(
            (found.overlap - good.overlap).abs() < 0.01,
            "{far}: {found:?} {good:?}"
        );
        assert!(
            (found.right - good.right).abs() < 0.05,
            "{far}: {found:?} {good:?}"
        );
    }
}

#[test]
fn agreement_in_one_corner_says_less_than_all_over() {
    let (wide, narrow) = (
        of_best(&matches(150, 150, 1.0)),
        of_best(&matches(150, 150, 0.15)),
    );
    assert!(wide.overlap > narrow.overlap + 0.05, "{wide:?} {narrow:?}");
}

/// Matches of a camera that moved so, with noise of 0.3 pixels, and some wrong ones.
fn moved(right: usize, by: RelativePose, baseline: f64) -> MatchedPoints {
    let mut points = matches(right, 100, 1.0);
    let mut rng = Seed(5).rng();
    for i in 0..right {
        let depth = 3.0 + 6.0 * rng.uniform();
        let x = by.rotation * (CAMERA.normalize(points.a[i]).to_homogeneous() * depth)
            + by.direction.into_inner() * baseline;
        let b = CAMERA.project(Point2::new(x.x / x.z, x.y / x.z));
        points.b[i] = Point2::new(b.x + 0.3 * rng.normal(), b.y + 0.3 * rng.normal());
    }
    points
}

#[test]
fn without_parallax_there_is_overlap_and_no_direction() {
    let turned = RelativePose {
        rotation: UnitQuaternion::from_euler_angles(0.0, 0.05, 0.0),
        direction: UnitVector3::new_normalize(Vector3::x()),
    };
    for right in [100, 1_000, 10_000] {
        let found = of_best(&moved(right, turned, 0.0));
        assert!(found.overlap > 0.95, "{right}: {found:?}");
        assert!(found.right < 0.2, "{right}: {found:?}");
        let found = of_best(&moved(right, turned, 0.5));
        assert!(found.right > 0.8, "{right}: {found:?}");
    }
}

#[test]
fn a_step_forward_is_a_direction_though_matches_near_the_epipole_have_no_parallax() {
    let forward = RelativePose {
        rotation: UnitQuaternion::identity(),
        direction: UnitVector3::new_normalize(Vector3::z()),
    };
    let found = of_best(&moved(300, forward, 0.3));
    assert!(found.right > 0.8, "{found:?}");
}

#[test]
fn chance_explains_few_matches_and_not_many() {
    // 400 wrong matches have 4 near by chance 0.01, and the best of many models some more.
    assert!(significance(12, 400, 0.01) < 0.0);
    assert!(significance(60, 400, 0.01) > 10.0);
    // 20 choose 10 is 184,756, 10 choose 5 is 252: 15 * 184756 * 252 * 1e-5.
    let alarms = 15.0 * 184_756.0 * 252.0 * 1e-5;
    let expected = -f64::log10(alarms);
    assert!((significance(10, 20, 0.1) - expected).abs() < 1e-9);
}

#[test]
fn no_matches_and_broken_ones_have_a_probability() {
    for count in [0, 1, 5, 50] {
        let points = MatchedPoints {
            a: vec![Point2::new(f64::NAN, 1.0); count],
            b: vec![Point2::new(1.0, f64::INFINITY); count],
            ambiguity: vec![0.0; count],
            ..MatchedPoints::default()
        };
        let found = views(&points).pose_probabilities(&truth());
        assert!((0.0..0.5).contains(&found.overlap), "{found:?}");
        assert!((0.0..0.5).contains(&found.right), "{found:?}");
    }
}

fn sideways() -> RelativePose {
    RelativePose {
        rotation: UnitQuaternion::identity(),
        direction: UnitVector3::new_normalize(Vector3::x()),
    }
}

#[test]
fn the_noise_is_that_of_near_matches_beyond_a_sample_and_a_tenth_of_a_pixel_at_least() {
    // Of a step to the side the distance is that of the rows, over the root of two.
    let off_by = |pixels: [f64; 15]| -> PointPairs {
        let rows = (0..).zip(pixels).map(|(i, off)| {
            let y = 0.02 * f64::from(i);
            let off = off * 2.0_f64.sqrt() / 600.0;
            (Point2::new(0.1, y), Point2::new(0.3, y + off))
        });
        rows.collect()
    };
    let mut pixels = [0.9; 15];
    pixels[10..].fill(2.1);
    let near = NearMatches::of(&sideways(), &off_by(pixels), 600.0);
    assert_eq!(near.indices, (0..10).collect::<Vec<u32>>());
    let expected = 0.9 * (10.0_f64 / 5.0).sqrt();
    assert!(
        (near.noise * 600.0 - expected).abs() < 1e-9,
        "{}",
        near.noise * 600.0
    );
    let exact = NearMatches::of(&sideways(), &off_by([0.0; 15]), 600.0);
    assert!((exact.noise * 600.0 - 0.1).abs() < 1e-12);
}

#[test]
fn the_chance_is_the_share_of_the_points_within_reach_of_a_diagonal() {
    let (x, y) = ([0.0, 0.8, 0.4], [0.6, 0.0, 0.1]);
    // A strip of 0.02 along 1.0, of 0.8 x 0.6.
    assert!((chance_near(&x, &y, 0.01) - 0.02 / 0.48).abs() < 1e-12);
    assert_eq!(chance_near(&x, &y, 0.3), 0.5);
    assert_eq!(chance_near(&x[..1], &y[..1], 0.01), 0.5);
}

#[test]
fn the_usual_parallax_is_up_to_twice_the_median_and_what_noise_adds() {
    // Turned by 0.3 about the y axis, points on the axis of a are seen at that angle and their parallax.
    let pose = RelativePose {
        rotation: UnitQuaternion::from_euler_angles(0.0, 0.3, 0.0),
        ..sideways()
    };
    let degrees = [3.0, 6.06, 0.5, 6.04, 1.0_f64];
    let pairs: PointPairs = (degrees.iter())
        .map(|parallax| (0.3 + parallax.to_radians()).tan())
        .map(|x| (Point2::origin(), Point2::new(x, 0.0)))
        .collect();
    let (usual, mean_square) = of_usual_parallax(&pose, &pairs);
    assert_eq!(usual, pairs.chosen(&[0, 2, 3, 4]));
    let squares = 3.0_f64.powi(2) + 0.5_f64.powi(2) + 6.04_f64.powi(2) + 1.0;
    let expected = squares / 4.0 * 1.0_f64.to_radians().powi(2);
    assert!(
        (mean_square / expected - 1.0).abs() < 1e-9,
        "{mean_square} {expected}"
    );
}

#[test]
fn the_probabilities_follow_from_the_numbers_of_the_table() {
    let mut points = matches(200, 40, 1.0);
    // Near the pose, and at a tenth of the depth of the others: no usual parallax.
    for i in 0..6 {
        let a = Point2::new(100.0 + 70.0 * f64::from(i), 90.0);
        let x = truth().rotation * (CAMERA.normalize(a).to_homogeneous() * 0.6)
            + truth().direction.into_inner();
        points.push(a, CAMERA.project(Point2::new(x.x / x.z, x.y / x.z)), 0.5);
    }
    let pairs = views(&points).at_depth_1();
    let mut squared = vec![0.0; pairs.len()];
    let essential = essential_from_pose(&truth());
    squared_sampson_distances(&essential, &pairs, 0..pairs.len(), &mut squared);
    let near: Vec<u32> = (0..246)
        .filter(|&i| squared[i as usize].sqrt() * 600.0 <= 2.0)
        .collect();
    let sum: f64 = near.iter().map(|&i| squared[i as usize]).sum();
    let noise = (sum / (near.len() - 5) as f64).sqrt();

    let extent = |of: &[f64]| {
        let least = of.iter().copied().fold(f64::INFINITY, f64::min);
        (
            least,
            of.iter().copied().fold(f64::NEG_INFINITY, f64::max) - least,
        )
    };
    let of_view = |x: &[f64], y: &[f64]| {
        let ((left, width), (top, height)) = (extent(x), extent(y));
        let cell =
            |at: f64, least: f64, length: f64| ((10.0 * (at - least) / length) as u32).min(9);
        let cells: std::collections::BTreeSet<(u32, u32)> = (near.iter())
            .map(|&i| (x[i as usize], y[i as usize]))
            .map(|(x, y)| (cell(x, left, width), cell(y, top, height)))
            .collect();
        let reach = 2.0 * 2.0 / 600.0;
        (
            cells.len() as f64,
            reach * width.hypot(height) / (width * height),
        )
    };
    let (a, b) = (
        of_view(&pairs.a_x, &pairs.a_y),
        of_view(&pairs.b_x, &pairs.b_y),
    );
    assert!(a.0 != b.0 && a.1 != b.1, "{a:?} {b:?}");
    let significance = significance(near.len(), 246, a.1.max(b.1));
    let logistic = |logit: f64| 1.0 / (1.0 + (-logit).exp());
    let cells = a.0.min(b.0);
    let overlap = logistic(
        OVERLAP[0] + OVERLAP[1] * (1.0 + significance).ln() + OVERLAP[2] * (1.0 + cells).ln(),
    );

    let (usual, mean_square) = of_usual_parallax(&truth(), &pairs.chosen(&near));
    assert!(usual.len() + 6 <= near.len());
    let of_scene = 1.0 - 2.0 * 4.0 * noise * noise / mean_square;
    let deviation =
        pose_deviation(&truth(), &usual, noise, of_scene) * 180.0 / std::f64::consts::PI;
    let square_pixels = noise * noise * 600.0 * 600.0;
    let precise =
        logistic(PRECISE[0] + PRECISE[1] * deviation.ln() + PRECISE[2] * square_pixels.ln());

    let found = pose_probabilities(&pairs, 600.0, &truth());
    assert!(
        (found.overlap - overlap).abs() < 1e-9,
        "{found:?} {overlap}"
    );
    assert!(
        (found.right - overlap * precise).abs() < 1e-9,
        "{found:?} {precise}"
    );
}

#[test]
fn whether_there_is_overlap_does_not_depend_on_which_image_is_the_first() {
    for (right, wrong, window) in [(200, 40, 1.0), (60, 200, 0.5), (20, 100, 0.3)] {
        let points = matches(right, wrong, window);
        let turned = MatchedPoints {
            a: points.b.clone(),
            b: points.a.clone(),
            ..points.clone()
        };
        let inverse = truth().rotation.inverse();
        let a_from_b = RelativePose {
            rotation: inverse,
            direction: -(inverse * truth().direction),
        };
        let found = views(&points).pose_probabilities(&truth());
        let from_b = views(&turned).pose_probabilities(&a_from_b);
        assert!(
            (found.overlap - from_b.overlap).abs() < 1e-9,
            "{found:?} {from_b:?}"
        );
        assert!(
            (found.right - from_b.right).abs() < 0.02,
            "{found:?} {from_b:?}"
        );
    }
}

#[test]
fn beside_the_other_pose_of_a_plane_a_pose_is_half_as_likely() {
    let pose = RelativePose {
        rotation: UnitQuaternion::from_euler_angles(0.05, -0.1, 0.02),
        direction: UnitVector3::new_normalize(Vector3::new(0.3, 0.2, 0.9)),
    };
    let of_plane = |share_on_it: f64| {
        let mut rng = Seed(4).rng();
        let mut points = MatchedPoints::default();
        for i in 0..300 {
            let a = Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
            let ray = CAMERA.normalize(a).to_homogeneous();
            let plane = 4.0 / ray.dot(&Vector3::new(0.3, -0.2, 1.0));
            let is_on_it = f64::from(i) < 300.0 * share_on_it;
            let depth = if is_on_it { plane } else { 0.6 * plane };
            let x = pose.rotation * (ray * depth) + pose.direction.into_inner();
            let b = CAMERA.project(Point2::new(x.x / x.z, x.y / x.z));
            let b = Point2::new(b.x + 0.3 * rng.normal(), b.y + 0.3 * rng.normal());
            points.push(a, b, 0.5);
        }
        let alone = pose_probabilities(&views(&points).at_depth_1(), 600.0, &pose);
        (alone, views(&points).pose_probabilities(&pose))
    };
    let (alone, found) = of_plane(1.0);
    assert!(alone.right > 0.5, "{alone:?}");
    assert_eq!(found.overlap, alone.overlap);
    assert!(
        (found.right - alone.right / 2.0).abs() < 1e-12,
        "{found:?} {alone:?}"
    );
    let (alone, found) = of_plane(0.8);
    assert!(
        (found.right - alone.right).abs() < 1e-3,
        "{found:?} {alone:?}"
    );
}

#[test]
fn a_pose_is_hopeless_that_is_hardly_right_though_the_images_overlap() {
    let turned = RelativePose {
        rotation: UnitQuaternion::from_euler_angles(0.0, 0.05, 0.0),
        direction: UnitVector3::new_normalize(Vector3::x()),
    };
    let is_hopeless = |baseline: f64, below: f64| {
        let pairs = views(&moved(300, turned, baseline)).at_depth_1();
        let problem = EssentialProblem {
            pairs: &pairs,
            cheirality: true,
            plane_poses: false,
            changes: None,
            hopeless: Some(Hopeless {
                below,
                pixels: 600.0,
            }),
        };
        let found = pose_probabilities(&pairs, 600.0, &turned);
        assert!(found.overlap > 0.9, "{found:?}");
        let squared_threshold = (1.0_f64 / 600.0).powi(2);
        problem.is_hopeless(Some((&essential_from_pose(&turned), squared_threshold)))
    };
    assert!(is_hopeless(0.0, 0.3));
    assert!(!is_hopeless(0.5, 0.3));
}
