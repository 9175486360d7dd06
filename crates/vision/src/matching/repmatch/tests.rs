use nalgebra::Point2;

use super::*;
use crate::features::{DescriptorKind, Descriptors, Features, FloatRows, Keypoint};
use crate::matching::Correspondence;

const WIDTH: f32 = 640.0;
const HEIGHT: f32 = 480.0;

fn features(places: Vec<Point2<f32>>) -> Features {
    let descriptors = Descriptors::Float(FloatRows::from_vec(1, vec![0.0; places.len()]));
    let keypoint = |at| Keypoint {
        at,
        size: 4.0,
        angle: Some(0.0),
        response: 1.0,
        octave: 0,
    };
    let keypoints = places.into_iter().map(keypoint).collect();
    Features::new(
        Size::new(WIDTH as usize, HEIGHT as usize),
        keypoints,
        descriptors,
    )
}

/// A street seen by a camera that moves sideways: displacements along rows, by depth. On the left
/// half one match in three is distinctive, on the right half, which is nearer and where facades
/// repeat, none is. Every third match goes anywhere.
fn street(count: u32) -> (Features, Features, Correspondences) {
    let mut rng = Seed(5).rng();
    let mut place = || Point2::new(WIDTH * rng.uniform() as f32, HEIGHT * rng.uniform() as f32);
    let (mut a, mut b, mut matches) = (Vec::new(), Vec::new(), Vec::new());
    for index in 0..count {
        let (from, anywhere) = (place(), place());
        a.push(from);
        let depth = 1.0 + 0.5 * from.y / HEIGHT + 0.3 * libm::sinf(from.x / 90.0);
        let nearer = if from.x > 0.5 * WIDTH { 80.0 } else { 0.0 };
        let to = Point2::new(from.x - 40.0 / depth - nearer, from.y);
        b.push(if index % 3 == 0 { anywhere } else { to });
        let distinctive = index % 3 == 1 && from.x < 0.5 * WIDTH;
        matches.push(Correspondence {
            a: index,
            b: index,
            distance: if distinctive { 1.0 } else { 9.5 },
            second: 10.0,
        });
    }
    (features(a), features(b), matches)
}

fn selected(params: RepMatchParams, scene: &(Features, Features, Correspondences)) -> Vec<u32> {
    let camera = Camera::pinhole(600.0, 600.0, 320.0, 240.0);
    selected_with(Some(&camera), params, scene)
}

fn selected_with(
    camera: Option<&Camera>,
    params: RepMatchParams,
    (a, b, matches): &(Features, Features, Correspondences),
) -> Vec<u32> {
    let [a, b] = [a, b].map(|features| View {
        features,
        image: None,
        camera,
    });
    let mut matches = matches.clone();
    let repmatch = RepMatch::new(params).unwrap();
    repmatch.select(a, b, &mut matches, Seed(2));
    matches.iter().map(|m| m.a).collect()
}

#[test]
fn repeated_structure_is_recovered_along_the_epipolar_lines() {
    let scene = street(2400);
    let on_the_right = |kept: &[u32]| {
        let right_half = |&&i: &&u32| scene.0.keypoints[i as usize].at.x > 0.6 * WIDTH;
        kept.iter()
            .filter(|&&i| i % 3 != 0)
            .filter(right_half)
            .count()
    };
    let code = selected(
        RepMatchParams {
            rounds: 0,
            ..RepMatchParams::default()
        },
        &scene,
    );
    let kept = selected(RepMatchParams::default(), &scene);
    let wrong = kept.iter().filter(|&&i| i % 3 == 0).count();
    let (before, after) = (on_the_right(&code), on_the_right(&kept));
    assert!(after > 560 && after > 2 * before, "{before}, then {after}");
    assert!(wrong < 12, "{wrong} wrong ones kept");
}

#[test]
fn without_cameras_the_matches_of_code_stay() {
    let scene = street(1500);
    let code = RepMatchParams {
        rounds: 0,
        ..RepMatchParams::default()
    };
    let (code, unknown) = (
        selected(code, &scene),
        selected_with(None, RepMatchParams::default(), &scene),
    );
    assert_eq!(code, unknown);
    assert_ne!(code, selected(RepMatchParams::default(), &scene));
}

#[test]
fn matches_off_their_epipolar_lines_are_dropped() {
    let mut scene = street(1500);
    // Within what coherence allows, but 6 pixels above the row.
    for keypoint in scene.1.keypoints.iter_mut().skip(10).step_by(60) {
        keypoint.at.y -= 6.0;
    }
    let kept = selected(RepMatchParams::default(), &scene);
    assert!(kept.len() > 700, "{}", kept.len());
    assert!(kept.iter().all(|index| index % 60 != 10));
}

#[test]
fn few_or_broken_matches_are_no_trouble() {
    // Too few seeds to learn from.
    for count in [0, 1, 6, 7, 12] {
        let scene = street(count);
        let kept = selected(RepMatchParams::default(), &scene);
        assert_eq!(kept, [0_u32; 0], "{count}");
    }
    let mut scene = street(900);
    scene.0.keypoints[4].at.x = f32::NAN;
    scene.1.keypoints[5].size = 0.0;
    let kept = selected(RepMatchParams::default(), &scene);
    assert!(kept.len() > 300, "{}", kept.len());
    assert!(!kept.contains(&4) && !kept.contains(&5));
    let place = || vec![Point2::new(3.0, 3.0); 200];
    let (.., matches) = street(200);
    selected(
        RepMatchParams::default(),
        &(features(place()), features(place()), matches),
    );
    let none = Features::new(
        Size::new(0, 0),
        Vec::new(),
        Descriptors::empty(DescriptorKind::Float { dim: 1 }),
    );
    let scene = (none.clone(), none, Vec::new());
    assert!(selected(RepMatchParams::default(), &scene).is_empty());
}

#[test]
fn parameters_out_of_range_are_named() {
    let default = RepMatchParams::default();
    for (name, params) in [
        (
            "rounds",
            RepMatchParams {
                rounds: 11,
                ..default
            },
        ),
        (
            "max_epipolar",
            RepMatchParams {
                max_epipolar: 0.0,
                ..default
            },
        ),
        (
            "likelihood",
            RepMatchParams {
                likelihood: f64::NAN,
                ..default
            },
        ),
    ] {
        let message = RepMatch::new(params).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
}
