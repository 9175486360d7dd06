//! Tests of the checks of a manifest.

use nalgebra::{Isometry3, Matrix3, Point2, Point3, Translation3, UnitQuaternion};

use super::super::answer::is_inside;
use super::super::manifest::BuiltIn;
use super::*;
use crate::datasets::Turn;
use crate::external::Times;

/// A pair of images whose cameras see their middles in the middle.
fn check_pair(size: Size, focal_px: f64, truth: Truth) -> CheckPair {
    let middle = [size.width, size.height].map(|side| side as f64 / 2.0);
    CheckPair {
        pair: [0, 1],
        paths: ["/a.png", "/b.png"].map(PathBuf::from),
        sizes: [size; 2],
        cameras: [Camera::pinhole(focal_px, focal_px, middle[0], middle[1]); 2],
        truth,
    }
}

/// The truth of a camera that moved and turned so, in Euler angles.
fn moved([x, y, z]: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Truth {
    Truth::Pose(Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    ))
}

/// Matches of points in space that two cameras see, without error.
fn rows(pair: &CheckPair) -> Vec<[f32; 5]> {
    let mut rng = Seed(2).rng();
    let mut number = |from: f64, to: f64| from + (to - from) * rng.below(1000) as f64 / 1000.0;
    (0..300)
        .map(|_| {
            let point = Point3::new(number(-2.0, 2.0), number(-1.5, 1.5), number(5.0, 9.0));
            let project = |camera: &Camera, point: Point3<f64>| {
                camera.project(Point2::new(point.x / point.z, point.y / point.z))
            };
            let a = project(&pair.cameras[0], point);
            let b = project(&pair.cameras[1], pair.truth.pose().unwrap() * point);
            [a.x as f32, a.y as f32, b.x as f32, b.y as f32, 0.0]
        })
        .filter(|row| {
            is_inside(row[0], row[1], pair.sizes[0]) && is_inside(row[2], row[3], pair.sizes[1])
        })
        .collect()
}

/// What is said last of these matches.
fn told(pair: &CheckPair, rows: Vec<[f32; 5]>) -> (Verdict, String) {
    let last = all_told(pair, rows).pop().unwrap();
    (last.verdict, last.text)
}

/// All that is said of these matches.
fn all_told(pair: &CheckPair, rows: Vec<[f32; 5]>) -> Vec<Finding> {
    let matched = Matched {
        rows,
        features: None,
        times: Times::default(),
    };
    let mut told = Vec::new();
    judge([(pair, &matched)].into_iter(), &mut |finding| {
        told.push(finding);
    });
    told
}

#[test]
fn copies_of_matches_are_told_and_a_few_are_not() {
    let pair = check_pair(Size::new(640, 480), 500.0, moved([1.0, 0.0, 0.0], [0.0; 3]));
    let rows = rows(&pair);
    // As of keypoints with two orientations.
    let twice = [&rows[..], &rows[..rows.len() / 3]].concat();
    let said = all_told(&pair, twice);
    assert!(matches!(&said[..], [one] if one.verdict == Verdict::Good));
    let said = all_told(&pair, rows.repeat(100));
    assert_eq!(said[0].verdict, Verdict::Doubtful);
    let numbers = format!(
        "of {} matches only {} are different",
        100 * rows.len(),
        rows.len()
    );
    assert!(said[0].text.contains(&numbers), "{}", said[0].text);
}

#[test]
fn without_a_pose_the_homography_judges_and_without_either_nothing_is_certified() {
    let twice = Matrix3::new(2.0, 0.0, 1.0, 0.0, 2.0, 3.0, 0.0, 0.0, 1.0);
    let mut pair = check_pair(Size::new(1280, 960), 1100.0, Truth::Homography(twice));
    let point = |i: u8| [f32::from(i) * 7.0, f32::from(i % 9) * 50.0];
    let right = |i: u8| point(i).map(|x| [x, 2.0 * x]);
    let right = (0..50)
        .map(right)
        .map(|[x, y]| [x[0], y[0], x[1] + 1.0, y[1] + 3.0, 0.0]);
    let right: Vec<[f32; 5]> = right.collect();
    let (verdict, text) = told(&pair, right.clone());
    assert!(
        verdict == Verdict::Good && text.contains("true places"),
        "{text}"
    );
    let exchanged = right.iter().map(|&[xa, ya, xb, yb, q]| [xb, yb, xa, ya, q]);
    let exchanged: Vec<[f32; 5]> = exchanged.collect();
    // A part of them may be near by chance.
    for rows in [exchanged.clone(), [&right[..15], &exchanged[15..]].concat()] {
        let (verdict, text) = told(&pair, rows);
        assert!(
            verdict == Verdict::Wrong && text.contains("a and b"),
            "{text}"
        );
    }
    pair.truth = Truth::Pose(Isometry3::identity());
    let (verdict, text) = told(&pair, right);
    assert!(
        verdict == Verdict::Doubtful && text.contains("nothing says"),
        "{text}"
    );
}

#[test]
fn a_dataset_that_turns_images_is_refused() {
    let mut sequence = rendered::sequence(&scenes()[0]);
    sequence.frames[1].turn = Turn::Half;
    let folder = tempfile::tempdir().unwrap();
    let text = "name = 'x'\ncommand = ['no-such-program']\n";
    let path = folder.path().join("x.toml");
    let manifest = Manifest::parse(&path, text, &BuiltIn::default()).unwrap();
    let log = Log::open(&folder.path().join("x.log")).unwrap();
    let error = check(manifest, log, Some(&sequence), &mut |_| {}).unwrap_err();
    assert!(error.to_string().contains("turns the image"), "{error}");
}

#[test]
fn a_mistake_is_named_though_most_points_lie_near_their_lines() {
    // A small image and a short way to the side: at half their size all points are within 5 pixels of their lines.
    let pair = check_pair(
        Size::new(320, 240),
        275.0,
        moved([0.4, 0.02, 0.02], [0.01, 0.006, 0.004]),
    );
    let right = rows(&pair);
    assert_eq!(told(&pair, right.clone()).0, Verdict::Good);
    let half = |x: f32| f32::midpoint(x, 0.5) - 0.5;
    let halves: Vec<[f32; 5]> = (right.iter())
        .map(|row| [half(row[0]), half(row[1]), half(row[2]), half(row[3]), 0.0])
        .collect();
    assert!(Judged::of(&pair, &halves).unwrap().distances().share_near() > 0.9);
    let (verdict, text) = told(&pair, halves);
    assert!(
        verdict == Verdict::Wrong && text.contains("half of the size"),
        "{text}"
    );
}

#[test]
fn one_mistake_explains_all_pairs() {
    let pair = |shift: f64| {
        check_pair(
            Size::new(640, 480),
            550.0,
            moved([shift, 0.3, 0.2], [0.05, 0.2 * shift, 0.2]),
        )
    };
    let pairs = [pair(0.3), pair(-0.8)];
    let matched = pairs.each_ref().map(|pair| Matched {
        rows: (rows(pair).iter())
            .map(|&[xa, ya, xb, yb, q]| [xb, yb, xa, ya, q])
            .collect(),
        features: None,
        times: Times::default(),
    });
    let mut told = Vec::new();
    judge(pairs.iter().zip(&matched), &mut |finding| {
        told.push(finding);
    });
    assert_eq!(told.len(), 2);
    for Finding { verdict, text } in told {
        assert_eq!(verdict, Verdict::Wrong, "{text}");
        assert!(text.contains("a and b were exchanged"), "{text}");
    }
}

#[test]
fn the_usual_mistakes_are_named() {
    let pair = check_pair(
        Size::new(1280, 960),
        1100.0,
        moved([1.0, 0.3, 0.4], [0.05, 0.2, 0.3]),
    );
    let right = rows(&pair);
    let told = |change: &dyn Fn([f32; 5]) -> [f32; 5]| {
        told(&pair, right.iter().map(|&row| change(row)).collect())
    };
    assert_eq!(told(&|row| row).0, Verdict::Good);
    let (verdict, text) = told(&|[xa, ya, xb, yb, q]| [ya, xa, yb, xb, q]);
    assert!(
        verdict == Verdict::Wrong && text.contains("x and y"),
        "{text}"
    );
    let (verdict, text) = told(&|[xa, ya, xb, yb, q]| [xb, yb, xa, ya, q]);
    assert!(
        verdict == Verdict::Wrong && text.contains("a and b"),
        "{text}"
    );
    let half = |x: f32| f32::midpoint(x, 0.5) - 0.5;
    let (verdict, text) =
        told(&|row| [half(row[0]), half(row[1]), half(row[2]), half(row[3]), 0.0]);
    assert!(
        verdict == Verdict::Wrong && text.contains("resized to 640"),
        "{text}"
    );
    let (verdict, text) = told(&|row| [row[0], row[1], right[0][2], right[0][3], 0.0]);
    assert!(
        verdict == Verdict::Doubtful && text.contains("1 different point"),
        "{text}"
    );
    let (verdict, text) = told(&|row| [row[0], row[1], row[1], row[0], 0.0]);
    assert!(
        verdict == Verdict::Doubtful && text.contains("original"),
        "{text}"
    );
}
