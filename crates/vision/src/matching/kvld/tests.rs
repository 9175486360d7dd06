use nalgebra::{Point2, Similarity2, Vector2};

use super::gradients::GradientPyramid;
use super::virtual_line::{VirtualLine, Window, levels_for};
use super::*;
use crate::features::{DescriptorKind, Descriptors, Features, Keypoint};
use crate::image::{GrayImage, Size};
use crate::matching::Correspondence;
use crate::seed::Rng;

const SIZE: Size = Size::new(320, 240);

/// Turned by 17 degrees about the corner, enlarged, moved.
fn motion() -> Similarity2<f32> {
    Similarity2::new(Vector2::new(60.0, -15.0), 0.3, 1.1)
}

/// A sum of waves, smooth and the same at no two places.
fn brightness(at: Point2<f32>) -> u8 {
    let waves = (0..24).map(|i| {
        let mut rng = Seed(9).number(i).rng();
        let mut number = || rng.uniform() as f32 - 0.5;
        let (x, y, phase) = (number(), number(), 6.3 * number());
        libm::sinf(0.6 * (x * at.x + y * at.y) + phase)
    });
    (128.0 + 14.0 * waves.sum::<f32>()).clamp(0.0, 255.0) as u8
}

/// The scene in `a` and as `motion` shows it in `b`.
fn images() -> [GrayImage; 2] {
    let image = |from: Similarity2<f32>| {
        GrayImage::from_fn(SIZE, |x, y| {
            brightness(from * Point2::new(x as f32, y as f32))
        })
    };
    [image(Similarity2::identity()), image(motion().inverse())]
}

fn keypoint(at: Point2<f32>, size: f32, angle: f32) -> Keypoint {
    Keypoint {
        at,
        size,
        angle: Some(angle),
        response: 1.0,
        octave: 0,
    }
}

fn random_place(rng: &mut Rng) -> Point2<f32> {
    let mut along = |length: usize| rng.uniform() as f32 * (length - 1) as f32;
    Point2::new(along(SIZE.width), along(SIZE.height))
}

/// Keypoints of `a` and `b`, the first `right` of which follow the motion.
fn keypoints(right: usize, wrong: usize) -> Vec<(Keypoint, Keypoint)> {
    let mut rng = Seed(8).rng();
    let mut pairs = Vec::new();
    while pairs.len() < right {
        let a = random_place(&mut rng);
        let b = motion() * a;
        if b.x >= 0.0 && b.y >= 0.0 && b.x < 319.0 && b.y < 239.0 {
            let angle = 0.3 + 0.1 * rng.normal() as f32;
            let size = 4.4 * (1.0 + 0.1 * rng.normal() as f32);
            pairs.push((keypoint(a, 4.0, 0.0), keypoint(b, size, angle)));
        }
    }
    for _ in 0..wrong {
        let [a, b] = [random_place(&mut rng), random_place(&mut rng)];
        let angle = std::f32::consts::TAU * rng.uniform() as f32;
        pairs.push((keypoint(a, 4.0, 0.0), keypoint(b, 4.0, angle)));
    }
    pairs
}

/// Which of the pairs stay.
fn kept(pairs: &[(Keypoint, Keypoint)]) -> Vec<usize> {
    kept_with(KvldParams::default(), pairs, |_| [0.9, 1.0])
}

/// As [`kept`], for the distances to the nearest and to the second nearest feature of each.
fn kept_with(
    params: KvldParams,
    pairs: &[(Keypoint, Keypoint)],
    distances: fn(u32) -> [f32; 2],
) -> Vec<usize> {
    let images = images();
    let features = |keypoints: Vec<Keypoint>| {
        let mut descriptors = Descriptors::empty(DescriptorKind::Float { dim: 1 });
        if let Descriptors::Float(rows) = &mut descriptors {
            for _ in &keypoints {
                rows.push(&[0.0]);
            }
        }
        Features::new(SIZE, keypoints, descriptors)
    };
    let (a, b): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
    let features = [features(a), features(b)];
    let [a, b] = std::array::from_fn(|i| View {
        features: &features[i],
        image: Some(&images[i]),
        camera: None,
    });
    let mut matches: Correspondences = (0..pairs.len() as u32)
        .map(|i| {
            let [distance, second] = distances(i);
            Correspondence {
                a: i,
                b: i,
                distance,
                second,
            }
        })
        .collect();
    let kvld = Kvld::new(params).unwrap();
    kvld.select(a, b, &mut matches, Seed(0));
    matches.iter().map(|m| m.a as usize).collect()
}

#[test]
fn matches_joined_by_lines_that_look_the_same_stay() {
    let kept = kept(&keypoints(60, 240));
    let right = kept.iter().filter(|&&i| i < 60).count();
    let wrong = kept.len() - right;
    assert!(right >= 54 && wrong <= 6, "{right} right, {wrong} wrong");
}

#[test]
fn two_features_that_are_both_equal_to_one_are_as_ambiguous_as_can_be() {
    let pairs = keypoints(60, 60);
    for count in 1..6 {
        let params = KvldParams {
            max_neighbours: count,
            least_neighbours: count,
            ..KvldParams::default()
        };
        let kept = |distances| kept_with(params, &pairs, distances);
        let alike = kept(|i| [if i % 3 == 0 { 1.0 } else { 0.5 }, 1.0]);
        let equal = kept(|i| if i % 3 == 0 { [0.0; 2] } else { [0.5, 1.0] });
        assert_eq!(equal, alike, "{count}");
    }
}

#[test]
fn chance_keeps_next_to_nothing() {
    let kept = kept(&keypoints(0, 300));
    assert!(kept.len() < 10, "{}", kept.len());
}

#[test]
fn the_motion_alone_does_not_suffice() {
    // As above, but b shows the scene elsewhere: geometry agrees, lines do not.
    let elsewhere: Vec<_> = (keypoints(60, 0).into_iter())
        .map(|(a, mut b)| {
            b.at += Vector2::new(-25.0, 20.0);
            (a, b)
        })
        .collect();
    let kept = kept(&elsewhere);
    assert!(kept.len() < 10, "{}", kept.len());
}

#[test]
fn of_matches_at_one_place_one_stays() {
    let mut pairs = keypoints(50, 0);
    let rival = keypoint(pairs[3].1.at + Vector2::new(2.0, 0.0), 4.4, 0.3);
    pairs.push((pairs[3].0, rival));
    pairs.push(pairs[7]);
    let kept = kept(&pairs);
    let of = |group: [usize; 2]| kept.iter().filter(|i| group.contains(i)).count();
    assert_eq!((of([3, 50]), of([7, 51])), (1, 1));
}

#[test]
fn few_broken_and_crowded_matches_are_no_trouble() {
    assert!(kept(&[]).is_empty());
    assert!(kept(&keypoints(1, 0)).is_empty());
    let nowhere = keypoint(Point2::new(f32::NAN, f32::INFINITY), f32::NAN, f32::NAN);
    let zero = keypoint(Point2::new(3.0, 4.0), 0.0, 0.0);
    let mut pairs = keypoints(50, 0);
    pairs.extend([(nowhere, nowhere), (zero, zero), (nowhere, zero)]);
    assert!(kept(&pairs).iter().all(|&i| i < 50));
    assert!(kept(&vec![(zero, zero); 50_000]).is_empty());
}

#[test]
fn a_line_is_known_again_and_told_from_others() {
    let [a, b] = images().map(|image| GradientPyramid::new(&image, levels_for(400.0)));
    let window = Window::new();
    let (p, q) = (Point2::new(60.0, 70.0), Point2::new(150.0, 120.0));
    let line = VirtualLine::new(&a, &window, p, q).unwrap();
    let same = VirtualLine::new(&b, &window, motion() * p, motion() * q).unwrap();
    let back = VirtualLine::new(&a, &window, q, p).unwrap();
    assert!(line.distance(&line) < 1e-6);
    assert!(line.distance(&same) < 0.25, "{}", line.distance(&same));
    assert!(line.distance(&back) > 0.4, "{}", line.distance(&back));
    assert_eq!(line.distance(&back), back.distance(&line));
}

#[test]
fn lines_without_contrast_are_not_described() {
    let flat = GradientPyramid::new(&GrayImage::filled(SIZE, 77), 4);
    let (p, q) = (Point2::new(60.0, 70.0), Point2::new(150.0, 120.0));
    assert!(VirtualLine::new(&flat, &Window::new(), p, q).is_none());
    assert!(VirtualLine::new(&flat, &Window::new(), p, p).is_none());
    let none = GradientPyramid::new(&GrayImage::filled(Size::new(3, 3), 77), 4);
    assert!(VirtualLine::new(&none, &Window::new(), p, q).is_none());
}

#[test]
fn parameters_out_of_range_are_named() {
    let default = KvldParams::default();
    for (name, params) in [
        (
            "max_distance",
            KvldParams {
                max_distance: f32::NAN,
                ..default
            },
        ),
        (
            "inlier_rate",
            KvldParams {
                inlier_rate: 0.0,
                ..default
            },
        ),
        (
            "least_share",
            KvldParams {
                least_share: 1.5,
                ..default
            },
        ),
        (
            "least_neighbours",
            KvldParams {
                least_neighbours: 0,
                ..default
            },
        ),
        (
            "at most `max_neighbours`, 2",
            KvldParams {
                max_neighbours: 2,
                ..default
            },
        ),
    ] {
        let message = Kvld::new(params).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
}
