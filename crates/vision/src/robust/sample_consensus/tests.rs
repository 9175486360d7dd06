//! Two synthetic views of every difficult kind, and every combination of parts.

use nalgebra::{Point2, Rotation3, UnitQuaternion, UnitVector3, Vector3};

use super::*;
use crate::geometry::{Camera, Distortion, Lens, MatchedPoints, RelativePose};
use crate::robust::{EarlyStop, FinalRefinement, Sampler, Score, presets};

const CAMERA: Camera = Camera::pinhole(600.0, 610.0, 320.0, 240.0);

type Matches = (Vec<Point2<f64>>, Vec<Point2<f64>>);

fn truth() -> RelativePose {
    RelativePose {
        rotation: UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(
            0.05, -0.15, 0.02,
        )),
        direction: UnitVector3::new_normalize(Vector3::new(0.9, 0.1, 0.3)),
    }
}

/// Matches of points at the depths that `depth` gives, in baselines, with noise in pixels, and
/// then wrong ones.
fn matches(right: usize, wrong: usize, noise: f64, depth: impl Fn(f64, f64) -> f64) -> Matches {
    matches_of(7, right, wrong, noise, depth)
}

/// [`matches`] drawn from this seed.
fn matches_of(
    seed: u64,
    right: usize,
    wrong: usize,
    noise: f64,
    depth: impl Fn(f64, f64) -> f64,
) -> Matches {
    let mut rng = Seed(seed).rng();
    (0..right + wrong)
        .map(|i| {
            let a = Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
            let ray = CAMERA.normalize(a);
            let x = truth().rotation * (ray.to_homogeneous() * depth(ray.x, rng.uniform()))
                + truth().direction.into_inner();
            let b = CAMERA.project(Point2::new(x.x / x.z, x.y / x.z));
            let mut off = || noise * rng.normal();
            let b = Point2::new(b.x + off(), b.y + off());
            let anywhere = Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
            (a, if i < right { b } else { anywhere })
        })
        .unzip()
}

fn deep(_: f64, uniform: f64) -> f64 {
    3.0 + 6.0 * uniform
}

fn estimate(
    params: SampleConsensusParams,
    (a, b): &Matches,
    seed: u64,
) -> Result<PoseEstimate, NoModel> {
    let views = TwoViews {
        points: &MatchedPoints::new(a.clone(), b.clone(), vec![0.5; a.len()]),
        camera_a: &CAMERA,
        camera_b: &CAMERA,
    };
    SampleConsensus::new(params)
        .expect("allowed parameters")
        .estimate(views, Seed(seed))
}

fn every_combination() -> impl Iterator<Item = SampleConsensusParams> {
    let (threshold_px, sprt) = (1.0, true);
    let scores = [
        Score::InlierCount { threshold_px, sprt },
        Score::Msac { threshold_px, sprt },
        Score::EvenMsac {
            threshold_px,
            cells: 10,
            turns: false,
            sprt,
        },
        Score::EvenMarginal {
            threshold_px,
            noise_iterations: 100,
            cells: 10,
            turns: false,
            sprt,
        },
        Score::Magsac { threshold_px, sprt },
        Score::Mlesac { threshold_px },
    ];
    let samplers = [
        Sampler::Uniform,
        Sampler::Prosac { horizon: 200_000 },
        Sampler::Spread { cells: 20 },
    ];
    scores.into_iter().flat_map(move |score| {
        samplers
            .into_iter()
            .map(move |sampler| SampleConsensusParams {
                score,
                sampler,
                ..SampleConsensusParams::default()
            })
    })
}

fn degrees(found: &Result<PoseEstimate, NoModel>) -> f64 {
    let found = found.as_ref().expect("a pose");
    found.b_from_a.error(&truth()).max().to_degrees()
}

#[test]
fn every_combination_finds_the_pose_among_noise_and_outliers() {
    for params in every_combination() {
        for (wrong, limit) in [(0, 1.0), (150, 1.5), (300, 3.0)] {
            let found = estimate(params, &matches(150, wrong, 0.3, deep), 1);
            assert!(
                degrees(&found) < limit,
                "{params:?} {wrong} {}",
                degrees(&found)
            );
        }
    }
}

#[test]
fn most_wrong_matches_are_survived_given_time() {
    let params = SampleConsensusParams {
        max_iterations: 20_000,
        ..SampleConsensusParams::default()
    };
    let found = estimate(params, &matches(60, 180, 0.2, deep), 1);
    assert!(degrees(&found) < 3.0, "{}", degrees(&found));
    // Among 95 % wrong matches there may be no telling; but the search ends.
    let few = SampleConsensusParams::default();
    let found = estimate(few, &matches(10, 190, 0.2, deep), 1).expect("some pose");
    assert_eq!(found.iterations, few.max_iterations);
}

#[test]
fn a_plane_is_no_obstacle() {
    for params in every_combination() {
        let plane = |x: f64, _: f64| 5.0 / (1.0 + 0.4 * x);
        let found = estimate(params, &matches(200, 50, 0.1, plane), 2).expect("a pose");
        // A plane allows two poses, so only the agreement tells.
        let right = found.inliers.iter().filter(|&&i| i < 200).count();
        assert!(right >= 195, "{params:?} {right}");
    }
}

#[test]
fn the_rotation_is_found_where_there_is_no_translation_to_speak_of() {
    for params in every_combination() {
        let far = |_: f64, uniform: f64| 1e4 + 1e5 * uniform;
        let params = SampleConsensusParams {
            max_depth: f64::INFINITY,
            ..params
        };
        let found = estimate(params, &matches(200, 20, 0.2, far), 2).expect("a pose");
        let error = found.b_from_a.error(&truth());
        assert!(
            error.rotation.to_degrees() < 0.5,
            "{params:?} {}",
            error.rotation
        );
    }
}

#[test]
fn refinement_improves_the_pose() {
    let matches = matches(200, 100, 0.5, deep);
    let plain = SampleConsensusParams {
        local_steps: 0,
        final_refinement: None,
        ..SampleConsensusParams::default()
    };
    let mean = |params| {
        let errors = (0..5).map(|seed| degrees(&estimate(params, &matches, seed)));
        errors.sum::<f64>() / 5.0
    };
    let (plain, refined) = (mean(plain), mean(SampleConsensusParams::default()));
    assert!(refined < 0.7 * plain, "{refined} {plain}");
}

#[test]
fn giving_up_early_and_the_order_of_matches_change_no_inliers_of_an_easy_problem() {
    let (mut a, mut b) = matches(150, 150, 0.2, deep);
    let inliers = |sprt, matches: &Matches| {
        let params = SampleConsensusParams {
            score: Score::Msac {
                threshold_px: 1.0,
                sprt,
            },
            ..SampleConsensusParams::default()
        };
        estimate(params, matches, 3).expect("a pose").inliers
    };
    let with = inliers(true, &(a.clone(), b.clone()));
    assert!(with.is_sorted());
    let right = with.iter().filter(|&&i| i < 150).count();
    assert!(right > 140 && with.len() < right + 15, "{with:?}");
    let without = inliers(false, &(a.clone(), b.clone()));
    let common = with.iter().filter(|i| without.contains(i)).count();
    assert!(common + 5 > with.len(), "{common} of {}", with.len());
    a.reverse();
    b.reverse();
    let reversed = inliers(true, &(a, b));
    let common = with
        .iter()
        .filter(|&&i| reversed.contains(&(299 - i)))
        .count();
    assert!(common + 5 > with.len(), "{common} of {}", with.len());
}

#[test]
fn degenerate_matches_do_no_harm() {
    let point = Point2::new(100.0, 200.0);
    let line: Vec<_> = (0..40)
        .map(|i| Point2::new(f64::from(i), 2.0 * f64::from(i)))
        .collect();
    let nan = vec![Point2::new(f64::NAN, 1.0); 40];
    for params in every_combination() {
        for points in [
            vec![],
            vec![point; 4],
            vec![point; 40],
            line.clone(),
            nan.clone(),
        ] {
            let found = estimate(params, &(points.clone(), points.clone()), 1);
            if points.len() < 5 {
                let found_few = points.len();
                let too_few = NoModel::TooFewMatches {
                    found: found_few,
                    needed: 5,
                };
                assert_eq!(found, Err(too_few));
            } else if let Ok(found) = found {
                assert!(found.b_from_a.direction.iter().all(|x| x.is_finite()));
            }
        }
        let (mut a, mut b) = matches(150, 0, 0.1, deep);
        (a[7].x, b[9].y) = (f64::NAN, f64::INFINITY);
        // Each match twice.
        a.extend_from_within(..);
        b.extend_from_within(..);
        let found = estimate(params, &(a, b), 1);
        assert!(degrees(&found) < 1.0, "{params:?} {}", degrees(&found));
    }
}

#[test]
fn stopping_at_once_finds_nothing_and_stopping_later_takes_no_more_samples() {
    let (a, b) = matches(20, 180, 0.3, deep);
    let views = TwoViews {
        points: &MatchedPoints::new(a, b, vec![0.0; 200]),
        camera_a: &CAMERA,
        camera_b: &CAMERA,
    };
    let estimator = SampleConsensus::new(SampleConsensusParams::default()).expect("defaults");
    assert!(estimator.estimate_until(views, Seed(1), &|_| true).is_err());
    let found = estimator.estimate_until(views, Seed(1), &|samples| samples >= 60);
    assert!(found.is_ok_and(|found| found.iterations == 60));
    // The samples that tell the noise count too.
    let adaptive = SampleConsensus::new(presets::adaptive()).expect("a preset is in range");
    for most in [60, 160] {
        let found = adaptive.estimate_until(views, Seed(1), &|samples| samples >= most);
        let found = found.expect("the model that tells the noise is one");
        assert_eq!(found.iterations, most);
        assert!(found.inliers.len() >= 5, "{}", found.inliers.len());
    }
    // One more sample is no reason to forget the best of those that told the noise.
    let [before, after] = [100, 101].map(|most| {
        let found = adaptive.estimate_until(views, Seed(1), &|samples| samples >= most);
        found.expect("a pose").inliers
    });
    assert_eq!(before, after);
    let endless = SampleConsensusParams {
        max_iterations: usize::MAX,
        ..presets::adaptive()
    };
    let endless = SampleConsensus::new(endless).expect("no limit is in range");
    let found = endless.estimate_until(views, Seed(1), &|samples| samples >= 160);
    assert!(found.is_ok_and(|found| found.iterations == 160));
}

#[test]
fn parameters_out_of_range_are_named() {
    let default = SampleConsensusParams::default();
    let early_stop = |confidence, min_iterations| {
        Some(EarlyStop {
            confidence,
            min_iterations,
        })
    };
    let score = |threshold_px, cells| Score::EvenMsac {
        threshold_px,
        cells,
        turns: false,
        sprt: false,
    };
    let final_refinement = |steps| {
        let loss = Loss::Truncated;
        Some(FinalRefinement { loss, steps })
    };
    let wrong = [
        (
            "confidence",
            SampleConsensusParams {
                early_stop: early_stop(1.0, 0),
                ..default
            },
        ),
        (
            "min_iterations",
            SampleConsensusParams {
                early_stop: early_stop(0.9, 1001),
                ..default
            },
        ),
        (
            "threshold_px",
            SampleConsensusParams {
                score: score(f64::NAN, 10),
                ..default
            },
        ),
        (
            "score_cells",
            SampleConsensusParams {
                score: score(1.0, 0),
                ..default
            },
        ),
        (
            "max_iterations",
            SampleConsensusParams {
                max_iterations: 0,
                ..default
            },
        ),
        (
            "local_steps",
            SampleConsensusParams {
                local_steps: 1001,
                ..default
            },
        ),
        (
            "final_steps",
            SampleConsensusParams {
                final_refinement: final_refinement(1001),
                ..default
            },
        ),
        (
            "prosac_horizon",
            SampleConsensusParams {
                sampler: Sampler::Prosac { horizon: 0 },
                ..default
            },
        ),
        (
            "cells",
            SampleConsensusParams {
                sampler: Sampler::Spread { cells: 0 },
                ..default
            },
        ),
        (
            "max_depth",
            SampleConsensusParams {
                max_depth: 0.0,
                ..default
            },
        ),
    ];
    for (name, params) in wrong {
        let message = SampleConsensus::new(params).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
}

#[test]
fn no_threshold_need_be_chosen_where_the_noise_is_estimated() {
    let (cells, sprt) = (10, true);
    for noise in [0.1, 0.4, 1.5, 2.5] {
        let scenes: Vec<Matches> = (0..20)
            .map(|seed| matches_of(seed, 200, 200, noise, deep))
            .collect();
        let error = |score, params| {
            let params = SampleConsensusParams { score, ..params };
            let errors = scenes
                .iter()
                .map(|matches| degrees(&estimate(params, matches, 1)));
            errors.sum::<f64>() / scenes.len() as f64
        };
        let fixed = [0.5, 1.0, 2.0, 4.0].map(|threshold_px| {
            let score = Score::EvenMsac {
                threshold_px,
                cells,
                turns: false,
                sprt,
            };
            error(score, presets::best())
        });
        let adaptive = [0.5, 1.0, 2.0, 4.0].map(|threshold_px| {
            let score = Score::EvenMarginal {
                threshold_px,
                noise_iterations: 100,
                cells,
                turns: true,
                sprt,
            };
            error(score, presets::adaptive())
        });
        let worst = |errors: [f64; 4]| errors.into_iter().fold(0.0, f64::max);
        let least = adaptive.into_iter().fold(f64::MAX, f64::min);
        assert!(
            worst(adaptive) < 1.6 * least,
            "the guess does not matter: {noise} {adaptive:?}"
        );
        if noise > 1.0 {
            assert!(
                worst(adaptive) < 0.75 * worst(fixed),
                "a threshold that is wrong does: {noise} {adaptive:?} {fixed:?}"
            );
        }
    }
}

/// 400 matches, in a scene of its own for each `seed`: the share that is right, and how many of these are on one plane.
fn of_a_plane(
    seed: u64,
    right: f64,
    on_the_plane: f64,
    camera: &Camera,
) -> (MatchedPoints, RelativePose) {
    let mut rng = Seed(seed).rng();
    let mut direction = || UnitVector3::new_normalize(Vector3::from_fn(|_, _| rng.normal()));
    let (axis, direction) = (direction(), direction());
    let pose = RelativePose {
        rotation: UnitQuaternion::from_axis_angle(&axis, 0.3 * rng.uniform()),
        direction,
    };
    let slope = [0.5 * rng.normal(), 0.3 * rng.normal()];
    let mut points = MatchedPoints::default();
    while points.len() < 400 {
        let mut anywhere = || Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
        let (a, elsewhere) = (anywhere(), anywhere());
        let ray = camera.normalize(a);
        let wall = 5.0 / (1.0 + slope[0] * ray.x + slope[1] * ray.y);
        let before_or_behind = 0.4 + 0.8 * rng.uniform();
        let is_on_it = rng.uniform() < on_the_plane;
        let depth = if is_on_it {
            wall
        } else {
            wall * before_or_behind
        };
        let x = pose.rotation * (ray.to_homogeneous() * depth) + pose.direction.into_inner();
        let b = camera.project(Point2::new(x.x / x.z, x.y / x.z));
        let seen = depth > 0.0 && x.z > 0.1 && (0.0..640.0).contains(&b.x);
        if !(seen && (0.0..480.0).contains(&b.y)) {
            continue;
        }
        let is_right = rng.uniform() < right;
        let b = if is_right { b } else { elsewhere };
        let mut off =
            |p: Point2<f64>| Point2::new(p.x + 0.7 * rng.normal(), p.y + 0.7 * rng.normal());
        let (a, b) = (off(a), off(b));
        let ambiguity = 0.55 + 0.15 * rng.normal() + if is_right { 0.0 } else { 0.2 };
        points.push(a, b, ambiguity.clamp(0.0, 0.8) as f32);
    }
    (points, pose)
}

fn essential(plane_poses: bool, tangent_sampson: bool) -> Geometry {
    Geometry::Essential {
        cheirality: true,
        plane_poses,
        tangent_sampson,
        hypotheses: 1,
        hopeless: 0.0,
    }
}

/// Errors of `best` in degrees, ascending, of so many such pairs.
fn errors_of_planes(pairs: u64, right: f64, on_the_plane: f64, plane_poses: bool) -> Vec<f64> {
    let best = SampleConsensusParams {
        geometry: essential(plane_poses, false),
        ..presets::best()
    };
    errors_of(best, pairs, &CAMERA, right, on_the_plane)
}

/// The same of an estimator with at most 1000 samples.
fn errors_of(
    params: SampleConsensusParams,
    pairs: u64,
    camera: &Camera,
    right: f64,
    on_the_plane: f64,
) -> Vec<f64> {
    let params = SampleConsensusParams {
        max_iterations: 1000,
        ..params
    };
    let estimator = SampleConsensus::new(params).expect("allowed parameters");
    let mut errors: Vec<f64> = (0..pairs)
        .map(|seed| {
            let (points, truth) = of_a_plane(seed, right, on_the_plane, camera);
            let views = TwoViews {
                points: &points,
                camera_a: camera,
                camera_b: camera,
            };
            let found = estimator.estimate(views, Seed(seed)).expect("a pose");
            found.b_from_a.error(&truth).max().to_degrees()
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn the_poses_of_a_plane_are_tried_where_nearly_everything_is_on_it() {
    let [without, with] = [false, true].map(|tried| errors_of_planes(40, 0.33, 0.95, tried));
    let right = |errors: &[f64]| errors.iter().filter(|&&error| error < 3.0).count();
    assert!(right(&with) > right(&without), "{without:?} {with:?}");
    assert!(with[20] < 0.8 * without[20], "{without:?} {with:?}");
}

#[test]
#[ignore = "measures; run with --release --ignored --nocapture"]
fn how_much_the_poses_of_a_plane_help() {
    for (right, on_the_plane) in [
        (0.7, 0.5),
        (0.7, 0.9),
        (0.7, 0.97),
        (0.3, 0.5),
        (0.3, 0.9),
        (0.3, 0.97),
    ] {
        let cells = [false, true].map(|tried| {
            let errors = errors_of_planes(200, right, on_the_plane, tried);
            let within = errors.iter().filter(|&&error| error < 5.0).count();
            format!("{within}, {:.2}°", errors[100])
        });
        println!("| {right} | {on_the_plane} | {} | {} |", cells[0], cells[1]);
    }
}

/// Mean errors of `best` in degrees under a wide lens, with distances at depth 1 and in units of the image.
fn errors_under_a_wide_lens(pairs: u64, right: f64, threshold_px: f64) -> [f64; 2] {
    let camera = Camera {
        distortion: Some(Lens::Brown(Distortion {
            k1: -0.28,
            k2: 0.07,
            ..Distortion::default()
        })),
        ..Camera::pinhole(450.0, 450.0, 320.0, 240.0)
    };
    [false, true].map(|tangent_sampson| {
        let best = SampleConsensusParams {
            geometry: essential(false, tangent_sampson),
            score: Score::EvenMsac {
                threshold_px,
                cells: 10,
                turns: false,
                sprt: true,
            },
            ..presets::best()
        };
        errors_of(best, pairs, &camera, right, 0.0)
            .iter()
            .sum::<f64>()
            / pairs as f64
    })
}

#[test]
fn where_no_match_is_wrong_distances_in_the_image_give_better_poses() {
    let [at_depth_1, in_the_image] = errors_under_a_wide_lens(100, 1.0, 2.0);
    assert!(in_the_image < at_depth_1, "{in_the_image} {at_depth_1}");
}

#[test]
#[ignore = "measures; run with --release --ignored --nocapture"]
fn how_much_distances_in_the_image_help() {
    for right in [1.0, 0.7, 0.3] {
        for threshold_px in [1.0, 1.5, 2.0] {
            let [at_depth_1, in_the_image] = errors_under_a_wide_lens(1000, right, threshold_px);
            println!(
                "{right} right, {threshold_px} px: {at_depth_1:.3} and {in_the_image:.3} degrees"
            );
        }
    }
}
