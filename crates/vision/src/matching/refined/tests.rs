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

/// Of a standard deviation of 0.6 of half a window, which is 7 samples.
#[test]
fn weights_are_a_gaussian_about_the_middle() {
    let weights = Weights::new().0;
    let sum: f32 = weights.as_flattened().iter().sum();
    assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    for (row, line) in weights.iter().enumerate() {
        for (column, weight) in line.iter().take(15).enumerate() {
            let squared = (row as f64 - 7.0).powi(2) + (column as f64 - 7.0).powi(2);
            let expected = libm::exp(-squared / (2.0 * 4.2 * 4.2));
            let found = f64::from(weight / weights[7][7]);
            assert!((found - expected).abs() < 1e-5, "{row} {column}: {found}");
        }
        assert!(line[15..].iter().all(|&weight| weight == 0.0));
    }
}

/// Seven samples to each side in both images, and in `a` another one for the gradients.
#[test]
fn a_match_stays_where_a_window_reaches_beyond_its_image() {
    let (a, _) = first();
    let found = |at: (f64, f64), shift: (f64, f64)| {
        let shift = Vector2::new(shift.0, shift.1);
        let b = seen(Matrix2::identity(), shift, 127.0, 1.0);
        let at = Point2::new(at.0, at.1);
        let found = aligned(
            &Weights::new(),
            [&a, &b],
            [at, at + shift],
            turned(0.0, 1.0),
        );
        assert!(found.is_none_or(|found| (found - at - shift).norm() < 0.1));
        found.is_some()
    };
    // The pixels of the image lie from 0 to 119 and from 0 to 109.
    for (inside, outside, shift) in [
        // Near the border of `a`.
        ((8.1, 50.0), (7.9, 50.0), (40.0, 0.0)),
        ((110.9, 50.0), (111.1, 50.0), (-40.0, 0.0)),
        ((60.0, 8.1), (60.0, 7.9), (0.0, 40.0)),
        ((60.0, 100.9), (60.0, 101.1), (0.0, -40.0)),
        // Near the border of `b`.
        ((48.0, 50.0), (46.8, 50.0), (-40.0, 0.0)),
        ((71.0, 50.0), (72.2, 50.0), (40.0, 0.0)),
        ((60.0, 48.0), (60.0, 46.8), (0.0, -40.0)),
        ((60.0, 61.0), (60.0, 62.2), (0.0, 40.0)),
    ] {
        assert!(found(inside, shift) && !found(outside, shift), "{inside:?}");
    }
}

/// Each pixel of a piece is the sum of the pixels about it, weighted by a Gaussian of 0.6 samples that is cut at 2.5
/// deviations, where the image is mirrored about its outermost pixels.
#[test]
fn a_piece_is_smoothed_for_the_distance_of_its_samples() {
    let image = first().0;
    let mirrored = |at: isize, length: usize| {
        let last = length as isize - 1;
        (last - (last - at.abs()).abs()) as usize
    };
    for (at, apart) in [
        (Point2::new(58.3, 51.8), 1.0),
        (Point2::new(5.2, 103.9), 1.0),
        (Point2::new(114.1, 6.0), 2.5),
    ] {
        let reach = 9.0;
        let piece = window::Piece::about(&image, at, reach, apart).expect("it is in the image");
        let sigma = 0.6 * apart;
        let radius = (2.5 * sigma).ceil() as isize;
        let weight = |offset: isize| libm::exp(-((offset * offset) as f64) / (2.0 * sigma * sigma));
        let sum: f64 = (-radius..=radius).map(weight).sum();
        let mut compared = 0;
        for y in 0..SIZE.height {
            for x in 0..SIZE.width {
                let place = Point2::new(x as f64, y as f64);
                if (place - at).abs().max() > reach {
                    continue;
                }
                let mut expected = 0.0;
                for down in -radius..=radius {
                    for right in -radius..=radius {
                        let column = mirrored(x as isize + right, SIZE.width);
                        let row = mirrored(y as isize + down, SIZE.height);
                        expected += weight(down) * weight(right) / (sum * sum)
                            * f64::from(image.at(column, row));
                    }
                }
                let [column, row] = piece.inside(place);
                let found = piece.pixels[row as usize * piece.stride + column as usize];
                assert!(
                    (f64::from(found) - expected).abs() < 0.01,
                    "{place} about {at}"
                );
                compared += 1;
            }
        }
        assert!(compared > 150, "{compared}");
    }
}

#[test]
fn a_piece_has_what_lies_between_its_pixels_and_those_are_of_the_image() {
    let image = first().0;
    let has = |at: (f64, f64), place: (f64, f64)| {
        let piece = window::Piece::about(&image, Point2::new(at.0, at.1), 9.0, 1.0);
        let piece = piece.expect("it is in the image");
        piece.has(piece.inside(Point2::new(place.0, place.1)))
    };
    // From 49 to 68 and from 42 to 61: nine to either side, and the pixel after.
    let middle = (58.5, 51.5);
    assert!(has(middle, (49.0, 42.0)) && has(middle, (67.9, 60.9)));
    for outside in [(48.9, 50.0), (68.1, 50.0), (58.0, 41.9), (58.0, 61.1)] {
        assert!(!has(middle, outside), "{outside:?}");
    }
    // The image of 120 x 110 pixels ends at 119 and 109.
    for (at, inside, outside) in [
        ((4.0, 50.0), (0.0, 50.0), (-0.1, 50.0)),
        ((115.0, 50.0), (118.9, 50.0), (119.1, 50.0)),
        ((50.0, 4.0), (50.0, 0.0), (50.0, -0.1)),
        ((50.0, 105.0), (50.0, 108.9), (50.0, 109.1)),
    ] {
        assert!(has(at, inside) && !has(at, outside), "{at:?}");
    }
    for nowhere in [(-20.0, 50.0), (50.0, 130.0), (f64::NAN, 50.0)] {
        let at = Point2::new(nowhere.0, nowhere.1);
        assert!(window::Piece::about(&image, at, 9.0, 1.0).is_none(), "{at}");
    }
}
