use nalgebra::Point2;

use super::*;
use crate::features::{DescriptorKind, Descriptors, Features, FloatRows, Keypoint};
use crate::image::Size;

/// Features at places, of one size and direction.
fn features(places: &[(f32, f32)]) -> Features {
    let keypoint = |&(x, y): &(f32, f32)| Keypoint {
        at: Point2::new(x, y),
        size: 4.0,
        angle: Some(0.5),
        response: 1.0,
        octave: 0,
    };
    let descriptors = Descriptors::Float(FloatRows::from_vec(1, vec![0.0; places.len()]));
    Features::new(
        Size::new(640, 480),
        places.iter().map(keypoint).collect(),
        descriptors,
    )
}

/// Every third match goes anywhere, the others with a smooth motion; one in four is distinctive.
fn scene(count: u32) -> (Features, Features, Correspondences) {
    let mut rng = Seed(8).rng();
    let mut place = || (640.0 * rng.uniform() as f32, 480.0 * rng.uniform() as f32);
    let (mut a, mut b, mut matches) = (Vec::new(), Vec::new(), Vec::new());
    for index in 0..count {
        let (x, y) = place();
        let anywhere = place();
        a.push((x, y));
        let moved = (0.9 * x + 0.1 * y + 20.0, 1.05 * y - 0.05 * x + 1e-4 * x * y);
        b.push(if index % 3 == 0 { anywhere } else { moved });
        matches.push(Correspondence {
            a: index,
            b: index,
            distance: if index % 4 == 0 { 1.0 } else { 9.5 },
            second: 10.0,
        });
    }
    (features(&a), features(&b), matches)
}

fn select(a: &Features, b: &Features, mut matches: Correspondences) -> Vec<u32> {
    let [a, b] = [a, b].map(|features| View {
        features,
        image: None,
        camera: None,
    });
    let code = Code::new(CodeParams::default()).unwrap();
    code.select(a, b, &mut matches, Seed(1));
    matches.iter().map(|m| m.a).collect()
}

#[test]
fn a_match_without_a_second_neighbour_is_no_seed() {
    let grid: Vec<(f32, f32)> = (0..300)
        .map(|i| (20.0 * (i % 20) as f32 + 9.0, 20.0 * (i / 20) as f32 + 9.0))
        .collect();
    let (a, b) = (features(&grid), features(&[(300.0, 200.0)]));
    let to_the_one = |a| Correspondence {
        a,
        b: 0,
        distance: 1.0,
        second: f32::INFINITY,
    };
    assert_eq!(select(&a, &b, (0..300).map(to_the_one).collect()), [0; 0]);
}

#[test]
fn coherent_matches_stay_also_those_that_are_not_distinctive() {
    let (a, b, matches) = scene(1800);
    let kept = select(&a, &b, matches);
    let right = kept.iter().filter(|&&index| index % 3 != 0).count();
    let wrong = kept.len() - right;
    assert!(right > 1100, "{right} of 1200 right ones kept");
    assert!(wrong < 60, "{wrong} of 600 wrong ones kept");
}

#[test]
fn likelihood_sees_frames_and_motion_sees_places() {
    let (a, mut b, matches) = scene(900);
    // Right ones, not distinctive: with another frame, and at another place.
    let (turned, shifted) = (|&i: &usize| i % 60 == 7, |&i: &usize| i % 60 == 11);
    for (index, keypoint) in b.keypoints.iter_mut().enumerate() {
        if turned(&index) {
            keypoint.angle = Some(2.5);
        }
        if shifted(&index) {
            keypoint.at.x += 60.0;
        }
    }
    let params = CodeParams::default();
    let motions = Motions::new(&a, &b, &matches, &params);
    let seeds = (0..matches.len()).filter(|i| i % 4 == 0).collect();
    let learned = Coherence::learn(&motions, seeds, &params, &mut Seed(3).rng()).unwrap();
    let likely = |i: &usize| learned.accepts(&motions, *i, params.likelihoods[0], 0.0);
    let moved = |i: &usize| learned.accepts(&motions, *i, f64::INFINITY, params.squared_transfer);
    let all = || 0..matches.len();
    assert_eq!(all().filter(turned).filter(likely).count(), 0);
    assert_eq!(all().filter(shifted).filter(moved).count(), 0);
    let others = |i: &usize| !i.is_multiple_of(3) && !turned(i) && !shifted(i);
    let right = all().filter(others).filter(moved).count();
    assert!(right > 500, "{right} of 570");
}

#[test]
fn where_nothing_is_learned_nothing_is_kept() {
    let (a, b, matches) = scene(1800);
    let ambiguous = |m: &Correspondence| Correspondence {
        distance: 9.5,
        ..*m
    };
    let no_seeds = matches.iter().map(ambiguous).collect();
    assert_eq!(select(&a, &b, no_seeds), [0_u32; 0]);
    // Every third match of a scene goes anywhere: seeds of which none is likely.
    let alone = matches.iter().copied().step_by(3).step_by(60);
    assert_eq!(select(&a, &b, alone.collect()), [0_u32; 0]);
}

#[test]
fn few_or_broken_matches_are_no_trouble() {
    // Too few seeds to learn from.
    for count in [0, 1, 2, 5] {
        let (a, b, matches) = scene(count);
        assert_eq!(select(&a, &b, matches), [0_u32; 0], "{count}");
    }
    let (mut a, b, matches) = scene(300);
    a.keypoints[4].at.x = f32::NAN;
    a.keypoints[5].size = 0.0;
    let kept = select(&a, &b, matches);
    assert!(kept.len() > 100, "{}", kept.len());
    assert!(!kept.contains(&4) && !kept.contains(&5));
    let same = features(&[(3.0, 3.0); 50]);
    let (.., matches) = scene(50);
    select(&same, &same, matches);
    let none = Features::new(
        Size::new(0, 0),
        Vec::new(),
        Descriptors::empty(DescriptorKind::Float { dim: 1 }),
    );
    assert!(select(&none, &none, Vec::new()).is_empty());
}

#[test]
fn parameters_out_of_range_are_named() {
    let default = CodeParams::default();
    for (name, params) in [
        (
            "huber",
            CodeParams {
                huber: 0.0,
                ..default
            },
        ),
        (
            "seed_ratio",
            CodeParams {
                seed_ratio: 5.0,
                ..default
            },
        ),
        (
            "seeds",
            CodeParams {
                seeds: usize::MAX,
                ..default
            },
        ),
        (
            "centres",
            CodeParams {
                centres: 2001,
                ..default
            },
        ),
        (
            "likelihoods",
            CodeParams {
                likelihoods: [0.6, f64::NAN],
                ..default
            },
        ),
    ] {
        let message = Code::new(params).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
}
