use nalgebra::{Point2, Vector2};

use super::*;
use crate::features::{Sift, SiftParams};
use crate::matching::Pipeline;

const SIZE: Size = Size::new(120, 110);

/// The grey level of a scene at a place: waves of many directions and lengths, which never repeat.
fn scene(at: Point2<f64>) -> f64 {
    let wave = |i: i32| {
        let (y, x) = libm::sincos(f64::from(i) * 2.4);
        let length = 2.2 * 1.23_f64.powi(i);
        12.0 * libm::sin((x * at.x + y * at.y) / length + f64::from(i * i))
    };
    (0..10).map(wave).sum()
}

/// What a camera sees of the scene through an affine map from the scene, with a brightness and a contrast.
fn seen(map: Matrix2<f64>, shift: Vector2<f64>, brightness: f64, contrast: f64) -> GrayImage {
    let back = map.try_inverse().expect("it has an inverse");
    GrayImage::from_fn(SIZE, |x, y| {
        let at = back * (Vector2::new(x as f64, y as f64) - shift);
        (brightness + contrast * scene(Point2::from(at))).round() as u8
    })
}

fn turned(degrees: f64, scale: f64) -> Matrix2<f64> {
    let (sin, cos) = libm::sincos(degrees.to_radians());
    Matrix2::new(cos, -sin, sin, cos) * scale
}

/// The image of the scene itself, and a place in it.
fn first() -> (GrayImage, Point2<f64>) {
    let image = seen(Matrix2::identity(), Vector2::zeros(), 127.0, 1.0);
    (image, Point2::new(58.3, 51.8))
}

/// The map, and where it takes the place of the first image: about the middle.
fn moved_by(map: Matrix2<f64>) -> (Vector2<f64>, Point2<f64>) {
    let at = Point2::new(61.4, 54.7);
    (at - map * first().1, at)
}

#[test]
fn a_moved_point_is_found_again_whatever_the_light_and_the_view() {
    let (a, at_a) = first();
    let stretched = Matrix2::new(1.2, 0.25, -0.1, 0.9);
    for map in [
        turned(0.0, 1.0),
        turned(37.0, 1.0),
        turned(-160.0, 1.6),
        turned(80.0, 0.7),
        stretched,
    ] {
        let (shift, truth) = moved_by(map);
        let b = seen(map, shift, 110.0, 0.6);
        for (x, y) in [(0.0, 0.0), (1.1, 0.4), (-0.7, 1.0), (0.2, -1.2)] {
            // What keypoints say of the map is not exact either.
            let about = turned(6.0, 1.1) * map;
            let at_b = truth + Vector2::new(x, y) * map.determinant().sqrt().min(1.0);
            let found = aligned(&Weights::new(), [&a, &b], [at_a, at_b], about);
            let error = (found.expect("texture") - truth).norm();
            assert!(error < 0.06, "{map}: {error} px from ({x}, {y})");
        }
    }
}

#[test]
fn a_match_stays_where_nothing_tells_its_place() {
    let (a, at) = first();
    let same = turned(0.0, 1.0);
    let flat = GrayImage::filled(SIZE, 90);
    let other = seen(turned(0.0, 0.4), Vector2::new(3.0, 8.0), 127.0, 1.0);
    let edge = GrayImage::from_fn(SIZE, |x, y| if 2 * x + 3 * y > 280 { 200 } else { 50 });
    let find = |b: &GrayImage, at_b, map| aligned(&Weights::new(), [&a, b], [at, at_b], map);
    assert!(find(&a, at, same).is_some());
    assert_eq!(find(&flat, at, same), None);
    assert_eq!(find(&other, at, same), None);
    assert_eq!(find(&edge, Point2::new(53.0, 58.0), same), None);
    let border = Point2::new(6.0, 50.0);
    assert_eq!(find(&a, border, same), None);
    assert_eq!(find(&a, Point2::new(f64::NAN, 50.0), same), None);
    for map in [
        turned(0.0, 4.1),
        turned(0.0, 0.24),
        Matrix2::new(1.0, 0.0, 0.0, -1.0),
        Matrix2::new(40.0, 0.0, 0.0, 0.1),
        Matrix2::zeros(),
        Matrix2::from_element(f64::NAN),
    ] {
        assert_eq!(find(&a, at, map), None, "{map}");
    }
    // Two and a half pixels are farther than a match is moved.
    assert_eq!(find(&a, at + Vector2::new(2.6, 0.0), same), None);
}

#[test]
fn images_of_any_size_are_looked_at() {
    for (width, height) in [(0, 0), (1, 1), (1, 40), (15, 15), (17, 16), (40, 3)] {
        let image = GrayImage::from_fn(Size::new(width, height), |x, y| (x * y % 251) as u8);
        let at = Point2::new(width as f64 / 2.0, height as f64 / 2.0);
        for map in [turned(0.0, 1.0), turned(45.0, 3.9), turned(10.0, 0.3)] {
            let found = aligned(&Weights::new(), [&image, &image], [at, at], map);
            assert!(found.is_none_or(|found| (found - at).norm() < 10.0));
        }
    }
}

#[test]
fn the_matches_of_a_matcher_stay_the_same_but_lie_at_better_places() {
    let sift = || {
        let sift = Sift::new(SiftParams::default()).expect("defaults");
        Box::new(Pipeline::of_features(sift)) as Box<dyn Matcher>
    };
    let map = turned(12.0, 1.15);
    let (shift, _) = moved_by(map);
    let (a, b) = (first().0, seen(map, shift, 120.0, 0.8));
    let plain = sift().match_images(&a, &b, None, Seed(1)).expect("points");
    let refined = Refined::new(sift());
    let moved = refined.match_images(&a, &b, None, Seed(1)).expect("points");
    assert!(refined.uses_pixels() && plain.len() > 20, "{}", plain.len());
    assert_eq!(
        (&plain.a, &plain.ambiguity, &plain.turns),
        (&moved.a, &moved.ambiguity, &moved.turns)
    );
    let errors = |points: &MatchedPoints| {
        let ends = points.a.iter().zip(&points.b);
        let mut errors: Vec<f64> = ends
            .map(|(a, b)| (map * a.coords + shift - b.coords).norm())
            .collect();
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    let (before, after) = (errors(&plain), errors(&moved));
    assert!(
        after < 0.05 && 2.0 * after < before,
        "{before} to {after} px"
    );

    let (features_a, features_b) = (
        refined.extract(&a).expect("it cannot fail"),
        refined.extract(&b).expect("it cannot fail"),
    );
    let view = |features| View {
        features,
        image: None,
        camera: None,
    };
    let without = refined.place(view(&features_a), view(&features_b), &[]);
    assert!(without.unwrap_err().0.contains("pixels"));
}
