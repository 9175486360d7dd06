use nalgebra::{Matrix2, Vector2};

use super::*;
use crate::features::extractor_tests::{agreement, assert_odd_images_are_fine, blobs};
use crate::image::Image;
use crate::seed::Seed;

fn dsp_sift(params: DspSiftParams) -> DspSift {
    DspSift::new(params).expect("in range")
}

fn on_ellipses() -> DspSift {
    dsp_sift(DspSiftParams {
        affine_shape: true,
        ..DspSiftParams::default()
    })
}

/// Rows of features, of real values.
fn rows(features: &Features) -> &FloatRows {
    match &features.descriptors {
        Descriptors::Float(rows) => rows,
        Descriptors::Binary(_) => panic!("real values"),
    }
}

/// Blobs of many sizes, seen through a linear map about the middle of the image.
fn mapped_blobs(image_from_scene: Matrix2<f64>) -> GrayImage {
    let size = Size::new(360, 320);
    let middle = Vector2::new(179.5, 159.5);
    let scene_from_image = image_from_scene.try_inverse().expect("regular");
    let mut rng = Seed(7).rng();
    let mut sum = Image::filled(size, 110.0);
    for _ in 0..600 {
        let at = Vector2::new(440.0 * (rng.uniform() - 0.5), 440.0 * (rng.uniform() - 0.5));
        let width = 2.0 + 3.0 * rng.uniform();
        // Not quite round, so that there is a direction.
        let longer = width * (1.0 + 0.5 * rng.uniform());
        let (sin, cos) = libm::sincos(6.3 * rng.uniform());
        let height = 160.0 * (rng.uniform() - 0.4);
        let centre = image_from_scene * at + middle;
        let near = |at: f64, end: usize| {
            // Five times the longest half axis, at most doubled by the map.
            let [first, last] = [at - 75.0, at + 75.0];
            first.max(0.0) as usize..(last.max(0.0) as usize).min(end)
        };
        for y in near(centre.y, size.height) {
            for x in near(centre.x, size.width) {
                let seen = Vector2::new(x as f64, y as f64) - middle;
                let offset = scene_from_image * seen - at;
                let (u, v) = (
                    (cos * offset.x + sin * offset.y) / width,
                    (cos * offset.y - sin * offset.x) / longer,
                );
                let squared = u * u + v * v;
                if squared < 25.0 {
                    sum.set(x, y, sum.at(x, y) + height * libm::exp(-0.5 * squared));
                }
            }
        }
    }
    sum.map(|v| v.clamp(0.0, 255.0) as u8)
}

#[test]
fn one_domain_of_the_keypoints_own_size_is_sift() {
    let image = blobs(0.0);
    let sift = Sift::new(SiftParams::default()).expect("in range");
    let expected = sift.extract(&image);
    let params = DspSiftParams {
        min_domain: 1.0,
        max_domain: 1.0,
        domains: 1,
        root: false,
        ..DspSiftParams::default()
    };
    let features = dsp_sift(params).extract(&image);
    assert_eq!(features.keypoints, expected.keypoints);
    let pairs = rows(&features).data().iter().zip(rows(&expected).data());
    let differing = pairs.clone().filter(|(a, b)| a != b).count();
    // Sums are divided by the scale, which may move a value over the middle between two integers.
    assert!(pairs.clone().all(|(a, b)| (a - b).abs() <= 1.0));
    assert!(differing * 1000 < expected.len() * LENGTH, "{differing}");
    assert!(expected.len() > 100);
}

#[test]
fn a_circle_is_described_by_patches_as_by_layers() {
    let image = blobs(0.0);
    let pooled = dsp_sift(DspSiftParams {
        root: false,
        ..DspSiftParams::default()
    });
    let circles = pooled.extract(&image);
    let mut pass = EllipsePass::new(&pooled, &image);
    for keypoint in &circles.keypoints {
        pass.describe(keypoint, &Ellipse::circle(0.5 * keypoint.size));
    }
    let mut distances = Vec::new();
    for (i, keypoint) in pass.keypoints.iter().enumerate() {
        let twin = circles.keypoints.iter().position(|other| {
            let turn = other.angle.expect("angles") - keypoint.angle.expect("angles");
            (other.at, other.size) == (keypoint.at, keypoint.size) && turn.abs() < 0.2
        });
        if let Some(j) = twin {
            let of_patch = &pass.descriptors[LENGTH * i..][..LENGTH];
            let differences = of_patch.iter().zip(rows(&circles).row(j));
            let squared: f32 = differences.map(|(a, b)| (a - b) * (a - b)).sum();
            distances.push(squared.sqrt() / 512.0);
        }
    }
    distances.sort_by(f32::total_cmp);
    let share = distances.len() as f32 / pass.keypoints.len() as f32;
    let median = distances[distances.len() / 2];
    assert!(
        share > 0.7 && median < 0.12,
        "{share} have twins, at {median}"
    );
}

#[test]
fn features_turn_with_the_image() {
    for (extractor, least) in [
        (dsp_sift(DspSiftParams::default()), 0.7),
        (on_ellipses(), 0.75),
    ] {
        let features = extractor.extract(&blobs(0.0));
        for degrees in [30.0, 90.0, 200.0] {
            let (twins, distance) =
                agreement(&features, &extractor.extract(&blobs(degrees)), degrees);
            assert!(twins > least, "{twins} after {degrees} degrees");
            assert!(distance < 0.08, "{distance} after {degrees} degrees");
        }
    }
}

#[test]
fn features_grow_with_the_image() {
    let extractor = dsp_sift(DspSiftParams::default());
    let small = extractor.extract(&mapped_blobs(Matrix2::identity()));
    let large = extractor.extract(&mapped_blobs(Matrix2::identity() * 1.6));
    let middle = Vector2::new(179.5_f32, 159.5);
    let mut distances = Vec::new();
    for (i, keypoint) in small.keypoints.iter().enumerate() {
        let at = (keypoint.at.coords - middle) * 1.6 + middle;
        let twin = large.keypoints.iter().position(|other| {
            let turn = other.angle.expect("angles") - keypoint.angle.expect("angles");
            (other.at.coords - at).norm() < 1.5
                && (other.size / keypoint.size / 1.6 - 1.0).abs() < 0.1
                && turn.abs() < 0.1
        });
        if let Some(j) = twin {
            let differences = rows(&small).row(i).iter().zip(rows(&large).row(j));
            distances.push(
                differences
                    .map(|(a, b)| (a - b) * (a - b))
                    .sum::<f32>()
                    .sqrt(),
            );
        }
    }
    distances.sort_by(f32::total_cmp);
    assert!(distances.len() > 40, "{} twins", distances.len());
    assert!(
        distances[distances.len() / 2] < 0.15,
        "{}",
        distances[distances.len() / 2]
    );
}

#[test]
fn ellipses_follow_a_shear_and_their_descriptors_stay() {
    let map = Matrix2::new(1.0, 0.7, 0.0, 0.75);
    let extractor = on_ellipses();
    let a = extractor.extract(&mapped_blobs(Matrix2::identity()));
    let b = extractor.extract(&mapped_blobs(map));
    let circles = dsp_sift(DspSiftParams::default());
    let of_circles = [Matrix2::identity(), map].map(|map| circles.extract(&mapped_blobs(map)));
    let (map, middle) = (map.cast::<f32>(), Vector2::new(179.5_f32, 159.5));
    let ellipse = |features: &Features, i: usize| {
        let [xx, xy, yx, yy] = features.frame(i);
        let frame = Matrix2::new(xx, xy, yx, yy);
        frame * frame.transpose()
    };
    // Distances to the nearest neighbour's place, of ellipses and of circles.
    let right = |a: &Features, b: &Features| {
        let (mut seen, mut right) = (0, 0);
        for (i, keypoint) in a.keypoints.iter().enumerate() {
            let at = map * (keypoint.at.coords - middle) + middle;
            if !(30.0..330.0).contains(&at.x) || !(30.0..290.0).contains(&at.y) {
                continue;
            }
            seen += 1;
            let distance = |j: &usize| {
                let pairs = rows(a).row(i).iter().zip(rows(b).row(*j));
                pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
            };
            let nearest = (0..b.len()).min_by(|i, j| distance(i).total_cmp(&distance(j)));
            let nearest = nearest.expect("features");
            right += usize::from((b.keypoints[nearest].at.coords - at).norm() < 3.0);
        }
        right as f32 / seen as f32
    };
    let [with, without] = [right(&a, &b), right(&of_circles[0], &of_circles[1])];
    assert!(
        with > without + 0.05,
        "{with} right with ellipses, {without} without"
    );
    // Ellipses of keypoints at one place and of one size agree.
    let mut differences = Vec::new();
    for i in 0..a.len() {
        let at = map * (a.keypoints[i].at.coords - middle) + middle;
        let expected = map * ellipse(&a, i) * map.transpose();
        let twin = (0..b.len()).find(|&j| {
            let growth = ellipse(&b, j).determinant() / expected.determinant();
            (b.keypoints[j].at.coords - at).norm() < 1.0 && (growth.sqrt() - 1.0).abs() < 0.2
        });
        if let Some(j) = twin {
            let found = ellipse(&b, j);
            let shape = |of: Matrix2<f32>| of / of.determinant().sqrt();
            differences.push((shape(found) - shape(expected)).norm() / shape(expected).norm());
        }
    }
    differences.sort_by(f32::total_cmp);
    assert!(differences.len() > 30, "{} twins", differences.len());
    let median = differences[differences.len() / 2];
    assert!(median < 0.15, "ellipses differ by {median}");
}

#[test]
fn any_image_is_taken() {
    assert!(assert_odd_images_are_fine(&dsp_sift(DspSiftParams::default())) > 0);
    assert!(assert_odd_images_are_fine(&on_ellipses()) > 0);
    let edge = GrayImage::from_fn(Size::new(120, 90), |x, _| if x < 60 { 20 } else { 230 });
    assert_eq!(on_ellipses().extract(&edge), on_ellipses().extract(&edge));
}

#[test]
fn the_farthest_sizes_are_taken() {
    let image = blobs(0.0);
    for affine_shape in [false, true] {
        let params = DspSiftParams {
            min_domain: 0.01,
            max_domain: 10.0,
            domains: 3,
            affine_shape,
            ..DspSiftParams::default()
        };
        let features = dsp_sift(params).extract(&image);
        assert!(features.len() > 100);
        assert!(rows(&features).data().iter().all(|v| v.is_finite()));
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let default = DspSiftParams::default();
    let with = |change: fn(&mut DspSiftParams)| {
        let mut params = default;
        change(&mut params);
        DspSift::new(params).expect_err("refused").to_string()
    };
    for (message, name) in [
        (with(|p| p.min_domain = 0.0), "min_domain"),
        (with(|p| p.min_domain = f32::NAN), "min_domain"),
        (with(|p| p.max_domain = 0.1), "max_domain"),
        (with(|p| p.max_domain = f32::INFINITY), "max_domain"),
        (with(|p| p.domains = 0), "domains"),
        (with(|p| p.domains = usize::MAX), "domains"),
        (with(|p| p.sift.sigma = 0.0), "sigma"),
    ] {
        assert!(message.starts_with(&format!("`{name}` is ")), "{message}");
    }
}
