use nalgebra::Point2;

use super::*;
use crate::geometry::{corner_error, transfer};
use crate::robust::{Score, presets};

const SIZE: (usize, usize) = (640, 480);

fn truth() -> Matrix3<f64> {
    Matrix3::new(0.9, 0.2, 30.0, -0.25, 1.1, 80.0, 3e-4, -1e-4, 1.0).normalize()
}

fn error(estimate: &HomographyEstimate) -> f64 {
    corner_error(&estimate.b_from_a, &truth(), SIZE)
}

/// Matches of which the first `right` are, with so many pixels of noise in both images; wrong ones are the
/// more ambiguous.
fn matches(right: usize, wrong: usize, noise: f64, seed: u64) -> MatchedPoints {
    let mut rng = Seed(seed).rng();
    let mut points = MatchedPoints::default();
    for i in 0..right + wrong {
        let mut pixel = || Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
        let (a, anywhere) = (pixel(), pixel());
        let b = transfer(&truth(), a);
        let mut noisy = |at: Point2<f64>| at.map(|x| x + noise * rng.normal());
        let (a, b) = (noisy(a), noisy(b));
        let is_right = i < right;
        let ambiguity = (rng.uniform() as f32) * if is_right { 0.8 } else { 1.0 };
        points.push(a, if is_right { b } else { anywhere }, ambiguity);
    }
    points
}

/// Both presets, and the worst corner error that they may have with half a pixel of noise.
fn presets() -> [(HomographyConsensus, f64); 2] {
    [(presets::ransac_h(), 2.0), (presets::best_h(), 0.5)]
        .map(|(params, worst)| (HomographyConsensus::new(params).expect("a preset"), worst))
}

#[test]
fn the_homography_is_found_among_wrong_matches() {
    for (estimator, worst) in presets() {
        for seed in 0..5 {
            let points = matches(150, 150, 0.5, seed);
            let found = estimator
                .estimate(&points, Seed(seed))
                .expect("a homography");
            assert!(error(&found) < worst, "{seed}: {}", error(&found));
            let right = found.inliers.iter().filter(|&&i| i < 150).count();
            assert!(right > 140 && found.inliers.len() <= right + 4, "{right}");
            assert!(found.inliers.is_sorted());
        }
    }
}

#[test]
fn one_in_five_is_enough() {
    for (estimator, worst) in presets() {
        let points = matches(60, 240, 0.3, 9);
        let found = estimator.estimate(&points, Seed(1)).expect("a homography");
        assert!(error(&found) < worst, "{}", error(&found));
    }
}

#[test]
fn exact_matches_give_the_exact_homography() {
    for (estimator, _) in presets() {
        for count in [4, 5, 30] {
            let found = estimator.estimate(&matches(count, 0, 0.0, 3), Seed(2));
            let found = found.expect("a homography");
            assert!(error(&found) < 1e-6, "{count}: {}", error(&found));
            assert_eq!(found.inliers.len(), count);
            let norm = found.b_from_a.norm();
            assert!((norm - 1.0).abs() < 1e-12 && found.b_from_a.determinant() > 0.0);
        }
    }
}

#[test]
fn what_determines_nothing_has_none() {
    let on_a_line = |i: u32| Point2::new(f64::from(i), 2.0 * f64::from(i));
    let one = |_| Point2::new(3.0, 4.0);
    let nowhere = |_| Point2::new(f64::NAN, f64::INFINITY);
    let places: [&dyn Fn(u32) -> Point2<f64>; 3] = [&on_a_line, &one, &nowhere];
    for (estimator, _) in presets() {
        for place in places {
            let points: Vec<_> = (0..40).map(place).collect();
            let points = MatchedPoints::new(points.clone(), points, vec![0.5; 40]);
            let found = estimator.estimate(&points, Seed(1));
            assert!(matches!(found, Err(NoModel::NoSupport { .. })), "{found:?}");
        }
        let few = estimator.estimate(&matches(3, 0, 0.0, 1), Seed(1));
        let reason = NoModel::TooFewMatches {
            found: 3,
            needed: 4,
        };
        assert_eq!(few, Err(reason));
    }
}

#[test]
fn a_reflection_is_refused_where_it_is_known_to_be_none() {
    let mut points = matches(50, 0, 0.0, 4);
    for b in &mut points.b {
        b.x = 640.0 - b.x;
    }
    let [(either, _), (one_side, _)] = presets();
    let found = either
        .estimate(&points, Seed(1))
        .expect("a mirror is a homography");
    assert!(found.b_from_a.determinant() < 0.0 && found.inliers.len() == 50);
    let found = one_side.estimate(&points, Seed(1));
    assert!(found.is_err_and(|none| matches!(none, NoModel::NoSupport { .. })));
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    for (estimator, _) in presets() {
        let points = matches(80, 80, 0.5, 6);
        let found = estimator.estimate(&points, Seed(7));
        assert_eq!(found, estimator.estimate(&points, Seed(7)));
        let stopped = estimator.estimate_until(&points, Seed(7), &|_| true);
        let nothing = NoModel::NoSupport {
            found: 0,
            needed: 4,
        };
        assert_eq!(stopped, Err(nothing));
    }
}

#[cfg(feature = "serde")]
#[test]
fn flat_names_that_do_not_act_are_refused() {
    use crate::robust::Settings;

    for params in [presets::ransac_h(), presets::best_h()] {
        let all = params.settings();
        assert_eq!(HomographyParams::default().with(all), Ok(params));
        let cheirality = Settings {
            cheirality: Some(true),
            ..Settings::default()
        };
        assert!(params.with(cheirality).is_err());
    }
}

#[test]
fn likelihoods_of_distances_from_lines_are_refused() {
    let params = HomographyParams {
        score: Score::Mlesac { threshold_px: 3.0 },
        ..HomographyParams::default()
    };
    let refused = HomographyConsensus::new(params);
    assert!(refused.is_err_and(|error| error.to_string().contains("mlesac")));
}

#[test]
fn noise_of_distances_from_lines_is_refused() {
    let with = |noise_iterations| {
        HomographyConsensus::new(HomographyParams {
            score: Score::EvenMarginal {
                threshold_px: 2.0,
                noise_iterations,
                cells: 10,
                turns: false,
                sprt: true,
            },
            ..HomographyParams::default()
        })
    };
    assert!(with(100).is_err_and(|error| error.to_string().contains("noise_iterations")));
    let found = with(0)
        .expect("a threshold that is given")
        .estimate(&matches(80, 80, 0.5, 6), Seed(1));
    assert!(error(&found.expect("a homography")) < 3.0);
}

#[test]
fn what_lies_beyond_the_horizon_is_no_inlier_of_any() {
    // Points with x above 320 are behind, and all are where the homography takes them.
    let h = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0 / 320.0, 0.0, 1.0);
    let places = (0..60).map(|i| Point2::new(f64::from(37 * i % 640), f64::from(53 * i % 480)));
    let (a, b): (Vec<_>, Vec<_>) = places.map(|a| (a, transfer(&h, a))).unzip();
    let in_front = a.iter().filter(|a| a.x < 320.0).count();
    let points = MatchedPoints::new(a.clone(), b, vec![0.5; 60]);
    for final_refinement in [None, HomographyParams::default().final_refinement] {
        let params = HomographyParams {
            final_refinement,
            ..HomographyParams::default()
        };
        let estimator = HomographyConsensus::new(params).expect("allowed parameters");
        let found = estimator.estimate(&points, Seed(1)).expect("a homography");
        assert!(found.inliers.iter().all(|&i| a[i as usize].x < 320.0));
        assert!(found.inliers.len() >= in_front - 1, "{in_front}");
    }
}

/// From a rough homography the distances are too large, and so is the scale of Cauchy's loss that follows from them.
#[test]
fn the_second_refinement_takes_its_scale_from_the_first() {
    let mut points = matches(150, 0, 0.1, 5);
    // Nearly right ones, all off to the same side, pull the more the larger the scale is.
    for b in points.b.iter_mut().take(40) {
        b.x += 1.2;
    }
    let pairs = points.in_pixels();
    let problem = HomographyProblem {
        pairs: &pairs,
        one_side: true,
    };
    let squared_threshold = 4.0;
    let estimator = HomographyConsensus::new(presets::best_h()).expect("a preset");
    let finished = |model: Matrix3<f64>| {
        let mut residuals = vec![0.0; pairs.len()];
        problem.squared_residuals(&model, 0..pairs.len(), &mut residuals);
        let inliers = inliers_within(&residuals, squared_threshold);
        let support = crate::robust::Support {
            quality: 0.0,
            inliers: inliers.len(),
            squared_threshold,
        };
        let found = Consensus {
            model,
            support,
            inliers,
            samples: 1,
        };
        estimator.finish(&problem, found).0
    };
    // The best that the loss can do: its scale follows from its own result.
    let best = (0..20).fold(truth(), |model, _| finished(model));
    let off = |model: &Matrix3<f64>| corner_error(model, &best, SIZE);
    let reach = estimator.params.score.reach() * squared_threshold;
    let mut residuals = vec![0.0; pairs.len()];
    let mut all = Vec::new();
    for (right, down) in [(1.1, 0.0), (-1.1, 0.0), (0.0, 1.1), (0.0, -1.1)] {
        let moved = Matrix3::new(1.0, 0.0, right, 0.0, 1.0, down, 0.0, 0.0, 1.0);
        let rough = moved * truth();
        problem.squared_residuals(&rough, 0..pairs.len(), &mut residuals);
        let inliers = inliers_within(&residuals, squared_threshold);
        let scale = squared_cauchy_scale(&residuals, &inliers, DistanceFrom::Point);
        let near = pairs.chosen(&inliers_within(&residuals, reach));
        let once = refine_homography(
            &rough,
            &near,
            Loss::Cauchy,
            scale.min(squared_threshold),
            25,
        );
        all.push([off(&rough), off(&once), off(&finished(rough))]);
    }
    assert!(
        all.iter().all(|[_, once, twice]| *twice < 0.5 * once),
        "{all:?}"
    );
}
