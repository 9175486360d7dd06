//! Tests that hold for every extractor: covariance with turns, and odd images.

use super::{Descriptors, Extractor, Features};
use crate::image::{GrayImage, Image, Size};
use crate::seed::Seed;

/// Side of the test images.
const SIDE: usize = 360;

/// Blocks of 17 x 13 pixels in many shades, none of them quite even.
pub(super) fn uneven_blocks() -> GrayImage {
    GrayImage::from_fn(Size::new(340, 220), |x, y| {
        let block = ((37 * (x / 17) + 101 * (y / 13)) ^ (13 * (x / 17) * (y / 13))) % 256;
        (block * 7 / 8 + (31 * x + 17 * y + x * y) % 32) as u8
    })
}

/// Blobs of many sizes, drawn where a turn by `degrees` about the centre puts them.
pub(super) fn blobs(degrees: f64) -> GrayImage {
    let size = Size::new(SIDE, SIDE);
    let centre = 0.5 * (SIDE as f64 - 1.0);
    let (sin, cos) = libm::sincos(degrees.to_radians());
    let mut rng = Seed(11).rng();
    let mut sum = Image::filled(size, 128.0);
    for _ in 0..700 {
        let [u, v] = [0, 1].map(|_| 1.4 * SIDE as f64 * (rng.uniform() - 0.5));
        let width = 2.0 + 7.0 * rng.uniform() * rng.uniform();
        let longer = width * (1.0 + rng.uniform());
        let height = 120.0 * (rng.uniform() - 0.5);
        let (x, y) = (centre + cos * u - sin * v, centre + sin * u + cos * v);
        let near = |at: f64| {
            let [start, end] = [at - 5.0 * longer, at + 5.0 * longer];
            start.max(0.0) as usize..(end.max(0.0) as usize).min(SIDE)
        };
        for row in near(y) {
            for column in near(x) {
                let (dx, dy) = (column as f64 - x, row as f64 - y);
                let (a, b) = (
                    (cos * dx + sin * dy) / width,
                    (cos * dy - sin * dx) / longer,
                );
                let value = height * libm::exp(-0.5 * (a * a + b * b));
                sum.set(column, row, sum.at(column, row) + value);
            }
        }
    }
    sum.map(|v| v.clamp(0.0, 255.0) as u8)
}

/// How well two sets of features agree when the first is turned by `degrees` about the centre:
/// the share of keypoints of the first with a twin (1 pixel, 10 % in size, 12 degrees, since round
/// blobs have no sharp direction), and the median distance of the descriptors of twins, as a share of all bits or of the norm.
pub(super) fn agreement(a: &Features, b: &Features, degrees: f64) -> (f64, f64) {
    let centre = 0.5 * (SIDE as f32 - 1.0);
    let (sin, cos) = libm::sincosf(degrees.to_radians() as f32);
    let mut looked_at = 0;
    let mut distances = Vec::new();
    for (i, k) in a.keypoints.iter().enumerate() {
        let (x, y) = (k.at.x - centre, k.at.y - centre);
        // Whose surroundings lie in both images.
        if (x * x + y * y).sqrt() > 0.5 * SIDE as f32 - 8.0 * k.size {
            continue;
        }
        looked_at += 1;
        let (x, y) = (cos * x - sin * y + centre, sin * x + cos * y + centre);
        let angle = k.angle.expect("features have angles") + degrees.to_radians() as f32;
        let twin = b.keypoints.iter().position(|other| {
            let distance = (other.at.x - x).hypot(other.at.y - y);
            let turn = (other.angle.expect("features have angles") - angle).to_degrees();
            let turn = (turn + 540.0).rem_euclid(360.0) - 180.0;
            distance < 1.0 && (other.size / k.size - 1.0).abs() < 0.1 && turn.abs() < 12.0
        });
        if let Some(twin) = twin {
            distances.push(descriptor_distance(a, i, b, twin));
        }
    }
    assert!(looked_at > 30, "the test sees keypoints, not {looked_at}");
    distances.sort_by(f64::total_cmp);
    (
        distances.len() as f64 / f64::from(looked_at),
        distances[distances.len() / 2],
    )
}

fn descriptor_distance(a: &Features, i: usize, b: &Features, j: usize) -> f64 {
    match (&a.descriptors, &b.descriptors) {
        (Descriptors::Float(a), Descriptors::Float(b)) => {
            let pairs = a.row(i).iter().zip(b.row(j));
            let squared: f32 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
            let norm: f32 = a.row(i).iter().map(|v| v * v).sum();
            f64::from(squared / norm).sqrt()
        }
        (Descriptors::Binary(a), Descriptors::Binary(b)) => {
            let pairs = a.row(i).iter().zip(b.row(j));
            let differing: u32 = pairs.map(|(a, b)| (a ^ b).count_ones()).sum();
            f64::from(differing) / a.bits() as f64
        }
        _ => panic!("descriptors of one kind"),
    }
}

/// Tiny and empty images, black, white and a single bright pixel have no features; noise of any
/// shape, and blobs, give the same valid ones each time. How many they give is returned.
pub(super) fn assert_odd_images_are_fine(extractor: &dyn Extractor) -> usize {
    for (width, height) in [(0, 0), (0, 9), (9, 0), (1, 1), (2, 3), (3, 200), (20, 20)] {
        for value in [0, 255] {
            let image = GrayImage::filled(Size::new(width, height), value);
            assert!(extractor.extract(&image).is_empty(), "{width}x{height}");
        }
    }
    let black = GrayImage::filled(Size::new(150, 130), 0);
    assert!(extractor.extract(&black).is_empty());
    let mut rng = Seed(12).rng();
    let mut found = 0;
    let sizes = [(5, 5), (47, 31), (120, 33), (33, 120), (161, 97)];
    let noise = sizes.map(|(width, height)| {
        GrayImage::from_fn(Size::new(width, height), |_, _| rng.below(256) as u8)
    });
    // Detectors of blobs find few in noise.
    let blobs = GrayImage::from_fn(Size::new(161, 97), |x, y| {
        let wave = |v: usize, length: f32| libm::sinf(v as f32 / length);
        (128.0 + 100.0 * wave(x, 5.0) * wave(y, 4.0) + 20.0 * wave(x + y, 19.0)) as u8
    });
    for noise in noise.into_iter().chain([blobs]) {
        let (width, height) = (noise.width(), noise.height());
        let features = extractor.extract(&noise);
        found += features.len();
        assert_eq!(features.descriptors.kind(), extractor.kind());
        assert_eq!(features, extractor.extract(&noise), "the same each time");
        for keypoint in &features.keypoints {
            let angle = keypoint.angle.expect("features have angles");
            assert!((0.0..core::f32::consts::TAU).contains(&angle));
            assert!(keypoint.size > 0.0 && keypoint.response.is_finite());
            assert!((-1.0..=width as f32).contains(&keypoint.at.x));
            assert!((-1.0..=height as f32).contains(&keypoint.at.y));
        }
        if let Descriptors::Float(rows) = &features.descriptors {
            assert!(rows.data().iter().all(|v| v.is_finite()));
        }
    }
    found
}
