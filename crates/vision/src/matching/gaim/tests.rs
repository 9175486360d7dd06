use nalgebra::{Matrix2, Point2, Vector2};

use super::energy::Label;
use super::fusion::Fusion;
use super::*;
use crate::features::{DescriptorKind, Descriptors, FloatRows, Keypoint};
use crate::image::Size;
use crate::matching::Search;
use crate::seed::{Rng, Seed};

const DIM: usize = 6;

/// A feature: place, frame, descriptor.
type Feature = (Vector2<f32>, Matrix2<f32>, [f32; DIM]);

fn features(list: &[Feature]) -> Features {
    let keypoint = |(at, frame, _): &Feature| Keypoint {
        at: Point2::from(*at),
        size: 2.0 * frame.determinant().abs().sqrt(),
        angle: Some(0.0),
        response: 1.0,
        octave: 0,
    };
    let values = list.iter().flat_map(|(.., row)| *row).collect();
    Features::new(
        Size::new(800, 600),
        list.iter().map(keypoint).collect(),
        Descriptors::Float(FloatRows::from_vec(DIM, values)),
    )
    .with_frames(
        (list.iter())
            .map(|(_, m, _)| [m.m11, m.m12, m.m21, m.m22])
            .collect(),
    )
}

fn random_feature(rng: &mut Rng) -> Feature {
    let at = Vector2::new(800.0 * rng.uniform() as f32, 600.0 * rng.uniform() as f32);
    let (angle, size) = (
        std::f32::consts::TAU * rng.uniform() as f32,
        3.0 + 5.0 * rng.uniform() as f32,
    );
    let (sin, cos) = (size * libm::sinf(angle), size * libm::cosf(angle));
    // Descriptors of four kinds: most features look like many others.
    let kind = rng.below(4) as f32;
    let row = [(); DIM].map(|()| kind + 0.1 * rng.normal() as f32);
    (at, Matrix2::new(cos, -sin, sin, cos), row)
}

/// Features moved by an affine map, with noise in everything; every third is replaced by
/// one that does not belong to the other image.
fn scene(count: usize) -> (Features, Features) {
    let mut rng = Seed(21).rng();
    let map = Matrix2::new(0.7, 0.25, -0.2, 0.9);
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for index in 0..count {
        let (at, frame, row) = random_feature(&mut rng);
        a.push((at, frame, row));
        if index % 3 == 0 {
            b.push(random_feature(&mut rng));
            continue;
        }
        let mut noise = |size: f64| (size * rng.normal()) as f32;
        let moved = map * at + Vector2::new(40.0 + noise(0.5), 90.0 + noise(0.5));
        let turn = Matrix2::new(
            1.0 + noise(0.05),
            noise(0.05),
            noise(0.05),
            1.0 + noise(0.05),
        );
        b.push((moved, map * turn * frame, row.map(|v| v + noise(0.05))));
    }
    (features(&a), features(&b))
}

fn run(a: &Features, b: &Features) -> Correspondences {
    let params = GaimParams::default();
    let mut matches = params.labels.search(a, b);
    let [a, b] = [a, b].map(|features| View {
        features,
        image: None,
        camera: None,
    });
    Gaim::new(params)
        .unwrap()
        .select(a, b, &mut matches, Seed(0));
    matches
}

#[test]
fn an_affine_motion_is_found_among_look_alikes_and_outliers() {
    let (a, b) = scene(300);
    let nearest = crate::matching::two_nearest(&a.descriptors, &b.descriptors);
    let right = |matches: &[Correspondence]| {
        let right = |m: &&Correspondence| m.a == m.b && !m.a.is_multiple_of(3);
        matches.iter().filter(right).count()
    };
    let matches = run(&a, &b);
    // Of 200 that can be found.
    assert!(right(&nearest) < 150, "{} by descriptors", right(&nearest));
    assert!(right(&matches) > 180, "{} of 200", right(&matches));
    let wrong = matches.len() - right(&matches);
    assert!(wrong <= 4, "{wrong} wrong");
    assert!(matches.is_sorted_by_key(|m| m.a));
}

#[test]
fn in_images_of_another_size_the_matches_are_the_same() {
    let enlarged = |features: &Features, scale: f32| {
        let keypoint = |keypoint: &Keypoint| Keypoint {
            at: keypoint.at * scale,
            size: keypoint.size * scale,
            ..*keypoint
        };
        let size = [features.size.width, features.size.height];
        let [width, height] = size.map(|length| (length as f32 * scale) as usize);
        let keypoints = features.keypoints.iter().map(keypoint).collect();
        let frames = (0..features.len()).map(|index| features.frame(index).map(|v| v * scale));
        Features::new(
            Size::new(width, height),
            keypoints,
            features.descriptors.clone(),
        )
        .with_frames(frames.collect())
    };
    let (a, b) = scene(150);
    let matches = run(&a, &b);
    assert!(matches.len() > 80, "{}", matches.len());
    // Powers of two change no digit.
    for scale in [0.125, 8.0] {
        assert_eq!(
            run(&enlarged(&a, scale), &enlarged(&b, scale)),
            matches,
            "{scale}"
        );
    }
    // As in the paper, a pixel is one of an image with a diagonal of 1000 pixels.
    assert_eq!([pixel(&a), pixel(&enlarged(&a, 0.5))], [1.0, 0.5]);
}

#[test]
fn candidates_are_the_nearest_of_different_places() {
    let mut rng = Seed(3).rng();
    let node = random_feature(&mut rng);
    // Two hundred features in pairs at one place, in no order of distance.
    let others: Vec<Feature> = (0..200_u32)
        .map(|index| {
            let value = (index * 77 % 200) as f32;
            let at = Vector2::new((index / 2 % 20) as f32 * 30.0, (index / 40) as f32 * 30.0);
            (at, node.1, node.2.map(|v| v + value))
        })
        .collect();
    let params = CandidateLabels {
        labels: 3,
        ..CandidateLabels::default()
    };
    let (a, b) = (features(&[node]), features(&others));
    let found = params.search(&a, &b);
    let values: Vec<u32> = found.iter().map(|m| m.b * 77 % 200).collect();
    // 0 and 77 share a place, and so do 78 and 1.
    assert_eq!(values[..2], [0, 1]);
    assert_eq!(found.len(), 3);
    assert_eq!(found[0].second, found[1].distance);
    assert_eq!(found[2].second, found[0].distance);
}

#[test]
fn candidates_keep_their_distance_from_each_other_as_if_each_were_compared_with_each() {
    let mut rng = Seed(8).rng();
    let node = random_feature(&mut rng);
    for (round, apart_px) in [0.1, 1.0, 5.0, 40.0, 2000.0, 1e30, 1e-30]
        .into_iter()
        .cycle()
        .enumerate()
        .take(28)
    {
        // On whole pixels distances are often exactly the limit; some places are no numbers, or far away.
        let mut others: Vec<Feature> = (0..700).map(|_| random_feature(&mut rng)).collect();
        for (index, (at, ..)) in others.iter_mut().enumerate() {
            if round % 2 == 0 {
                *at = at.map(f32::round) - Vector2::new(300.0, 200.0);
            }
            match index % 50 {
                0 => at.x = f32::NAN,
                1 => at.y = f32::INFINITY,
                2 => at.x = -1e30,
                _ => {}
            }
        }
        let (a, b) = (features(&[node]), features(&others));
        let params = |labels, apart_px| CandidateLabels {
            labels,
            apart_px,
            ..CandidateLabels::default()
        };
        let taken = |params: CandidateLabels| -> Vec<u32> {
            params.of(&[0], &a, &b).iter().map(|m| m.b).collect()
        };
        // As many blocks as with more labels than features, so that each is its own.
        let apart = (apart_px * pixel(&b)) as f32;
        let mut expected: Vec<u32> = Vec::new();
        for index in taken(params(1000, 0.0)) {
            let place = |index: u32| b.keypoints[index as usize].at;
            let is_near =
                |&other: &u32| (place(other) - place(index)).norm_squared() < apart * apart;
            if !expected.iter().any(is_near) {
                expected.push(index);
            }
        }
        assert_eq!(taken(params(1000, apart_px)), expected, "{apart_px}");
        expected.truncate(200);
        assert_eq!(taken(params(200, apart_px)), expected, "{apart_px}");
    }
}

#[test]
fn only_what_was_seen_without_simulation_is_a_node() {
    let mut rng = Seed(4).rng();
    let mut list: Vec<Feature> = (0..6).map(|_| random_feature(&mut rng)).collect();
    list[2].1 *= Matrix2::new(1.0, 0.4, 0.0, 1.0);
    let seen = features(&list);
    // Circles of an image that was resampled to another aspect are ellipses, without simulation.
    for size in [(800, 600), (1242, 376), (480, 640)] {
        let size = Size::new(size.0, size.1);
        let all = seen.clone().in_pixels_of(seen.size, size);
        let nodes: Vec<u32> = (CandidateLabels::default().search(&all, &all).iter())
            .map(|m| m.a)
            .collect();
        assert!(!nodes.contains(&2) && nodes.contains(&3), "{size}");
    }
}

/// A small problem with nodes, candidates and frames at random.
fn random_problem(trial: u64, nodes: usize, labels: usize) -> Problem {
    let mut rng = Seed(31).number(trial).rng();
    let place = |rng: &mut Rng| Vector2::new(10.0 * rng.uniform(), 10.0 * rng.uniform());
    let at: Vec<Vector2<f64>> = (0..nodes).map(|_| place(&mut rng)).collect();
    let mut label = |p: usize| {
        // Often near to where the node itself is, so that candidates can agree.
        let near = rng.below(3) == 0;
        let other = place(&mut rng);
        Label {
            at: if near { at[p] + 0.05 * other } else { other },
            b_from_a: Matrix2::from_fn(|i, j| f64::from(u8::from(i == j)) + 0.2 * rng.normal()),
            unary: i64::from(rng.below(3000)),
            index: 0,
        }
    };
    let labels = (0..nodes)
        .map(|p| (0..labels).map(|_| label(p)).collect())
        .collect();
    Problem {
        neighbours: graph::neighbours(&at, 3),
        nodes: at,
        labels,
        truncation: 0.4,
        collision: 0.3,
    }
}

#[test]
fn moves_never_raise_the_cost() {
    for trial in 0..40 {
        let problem = random_problem(trial, 30, 6);
        let mut rng = Seed(32).number(trial).rng();
        let mut fusion = Fusion::new(&problem, vec![0; 30]);
        let mut cost = problem.cost(&fusion.choice);
        for _ in 0..30 {
            let proposal: Vec<(usize, usize)> = (0..30)
                .filter(|p| p % 5 != trial as usize % 5)
                .map(|p| (p, rng.below(6) as usize))
                .collect();
            let changed = fusion.fuse(&proposal);
            let now = problem.cost(&fusion.choice);
            assert!(now <= cost && (changed || now == cost), "{cost} to {now}");
            cost = now;
        }
        assert!(cost < problem.cost(&[0; 30]), "nothing was gained");
    }
}

#[test]
fn small_problems_are_mostly_solved_to_the_optimum() {
    let (mut optimal, trials) = (0, 60);
    for trial in 0..trials {
        let problem = random_problem(100 + trial, 6, 4);
        let found = problem.cost(&moves::solve(&problem, 3));
        let all = (0..4_usize.pow(6)).map(|code| {
            let choice: Vec<usize> = (0..6).map(|p| code / 4_usize.pow(p) % 4).collect();
            problem.cost(&choice)
        });
        let least = all.min().expect("there are choices");
        assert!(found >= least);
        optimal += u32::from(found == least);
    }
    assert!(
        u64::from(optimal) * 10 >= trials * 9,
        "{optimal} of {trials}"
    );
}

#[test]
fn few_or_broken_features_are_no_trouble() {
    for (count_a, count_b) in [(0, 0), (0, 3), (3, 0), (1, 1), (1, 5), (5, 1), (2, 2)] {
        let mut rng = Seed(41).rng();
        let mut list = |count: usize| {
            let list: Vec<Feature> = (0..count).map(|_| random_feature(&mut rng)).collect();
            features(&list)
        };
        let (a, b) = (list(count_a), list(count_b));
        assert!(run(&a, &b).len() <= count_a.min(count_b));
    }
    let (mut a, mut b) = scene(200);
    a.keypoints[4].at.x = f32::NAN;
    b.keypoints[7].at.y = f32::INFINITY;
    a.frames.as_mut().unwrap()[5] = [0.0; 4];
    b.frames.as_mut().unwrap()[8] = [f32::NAN; 4];
    let matches = run(&a, &b);
    assert!(matches.len() > 80, "{}", matches.len());
    assert!(
        matches
            .iter()
            .all(|m| ![4, 5].contains(&m.a) && ![7, 8].contains(&m.b))
    );
    let same = features(&[(Vector2::zeros(), Matrix2::identity(), [0.0; DIM]); 60]);
    run(&same, &same);
    let none = Descriptors::empty(DescriptorKind::Float { dim: DIM });
    let none = Features::new(Size::new(0, 0), Vec::new(), none);
    assert!(run(&none, &none).is_empty());
}

#[test]
fn distances_of_any_size_overflow_nowhere() {
    let mut rng = Seed(8).rng();
    let list: Vec<Feature> = (0..60).map(|_| random_feature(&mut rng)).collect();
    let scaled = |scale: f32| {
        let list: Vec<Feature> = (list.iter())
            .map(|(at, frame, row)| (*at, *frame, row.map(|value| scale * value)))
            .collect();
        run(&features(&list), &features(&list)).len()
    };
    let kept = scaled(1.0);
    assert!(kept > 30, "{kept}");
    for scale in [1e14, 1e18] {
        assert_eq!(scaled(scale), kept, "{scale}");
    }
}

#[test]
fn costs_of_pairs_overflow_nowhere() {
    let (a, b) = scene(60);
    let [view_a, view_b] = [&a, &b].map(|features| View {
        features,
        image: None,
        camera: None,
    });
    let with = |truncation| {
        Gaim::new(GaimParams {
            truncation,
            ..GaimParams::default()
        })
    };
    let mut matches = CandidateLabels::default().search(&a, &b);
    (with(1e4).expect("the largest")).select(view_a, view_b, &mut matches, Seed(0));
    assert!(!matches.is_empty());
    for truncation in [1.1e4, 1e300] {
        let message = with(truncation).unwrap_err().to_string();
        assert!(message.contains("truncation"), "{message}");
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let default = GaimParams::default();
    for (name, params) in [
        (
            "nodes",
            GaimParams {
                labels: CandidateLabels {
                    nodes: 0,
                    ..default.labels
                },
                ..default
            },
        ),
        (
            "labels",
            GaimParams {
                labels: CandidateLabels {
                    labels: 1 << 60,
                    ..default.labels
                },
                ..default
            },
        ),
        (
            "truncation",
            GaimParams {
                truncation: f64::NAN,
                ..default
            },
        ),
        (
            "unary_weight",
            GaimParams {
                unary_weight: 1e300,
                ..default
            },
        ),
        (
            "rounds",
            GaimParams {
                rounds: 0,
                ..default
            },
        ),
        (
            "cluster_px",
            GaimParams {
                cluster_px: -1.0,
                ..default
            },
        ),
    ] {
        let message = Gaim::new(params).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
    let CandidateLabels {
        nodes,
        labels,
        apart_px,
    } = default.labels;
    assert_eq!(
        CandidateLabels::new(nodes, labels, apart_px),
        Ok(default.labels)
    );
    for (name, refused) in [
        ("nodes", CandidateLabels::new(0, labels, apart_px)),
        ("labels", CandidateLabels::new(nodes, 0, apart_px)),
        ("apart_px", CandidateLabels::new(nodes, labels, f64::NAN)),
    ] {
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
}
