use core::f32::consts::{FRAC_PI_2, TAU};

use super::*;
use crate::features::extractor_tests::uneven_blocks;
use crate::image::Size;
use crate::seed::Seed;

fn sift() -> Sift {
    Sift::new(SiftParams::default()).expect("the defaults are in range")
}

/// Bright Gaussian blobs `(x, y, standard deviation)` on grey.
fn blobs(size: Size, blobs: &[(f64, f64, f64)]) -> GrayImage {
    GrayImage::from_fn(size, |x, y| {
        let light: f64 = blobs
            .iter()
            .map(|&(bx, by, s)| {
                let (dx, dy) = (x as f64 - bx, y as f64 - by);
                150.0 * libm::exp(-(dx * dx + dy * dy) / (2.0 * s * s))
            })
            .sum();
        (60.0 + light).min(255.0).round() as u8
    })
}

/// Smooth random texture: blobs at random places, away from the border.
fn texture(size: Size) -> GrayImage {
    const MARGIN: f64 = 25.0;
    let mut rng = Seed(11).rng();
    let list: Vec<_> = (0..60)
        .map(|_| {
            let x = MARGIN + rng.uniform() * (size.width as f64 - 2.0 * MARGIN);
            let y = MARGIN + rng.uniform() * (size.height as f64 - 2.0 * MARGIN);
            (x, y, 1.5 + 4.0 * rng.uniform())
        })
        .collect();
    blobs(size, &list)
}

fn noise(size: Size) -> GrayImage {
    let mut rng = Seed(12).rng();
    GrayImage::from_fn(size, |_, _| rng.below(256) as u8)
}

#[test]
fn a_blob_is_found_at_its_place_and_scale() {
    for (x, y, s) in [(40.0, 50.0, 4.0), (45.25, 40.5, 6.0), (50.5, 47.75, 2.5)] {
        let keypoints = sift().detect(&blobs(Size::new(100, 96), &[(x, y, s)]));
        let best = keypoints
            .iter()
            .max_by(|a, b| a.response.total_cmp(&b.response));
        let best = best.expect("one blob, at least one keypoint");
        assert!((f64::from(best.at.x) - x).abs() < 0.05, "{best:?}");
        assert!((f64::from(best.at.y) - y).abs() < 0.05, "{best:?}");
        // A difference of Gaussians of blurs t and k t answers most at t sqrt(k) = s; the image
        // is assumed to have been blurred by 0.5 more than it was.
        let scale = f64::from(best.size) / 2.0;
        let expected = s / libm::pow(2.0, 1.0 / 6.0);
        assert!(
            (scale / expected - 1.0).abs() < 0.05,
            "{scale} for {expected}"
        );
    }
}

/// For each layer, how many keypoints cv2.SIFT_create() of OpenCV 4.14.0 finds, and of the strongest x and y (less the quarter
/// of a pixel by which OpenCV's are too large), size, angle in degrees and response.
#[test]
fn keypoints_of_all_layers_are_those_of_opencv() {
    let expected: [(i16, usize, [f32; 5]); 12] = [
        (
            -2,
            77,
            [
                168.326_81,
                37.157_32,
                2.019_381_5,
                266.060_58,
                0.082_435_094,
            ],
        ),
        (
            -1,
            46,
            [150.838_7, 27.130_894, 2.515_697_5, 357.606_66, 0.074_059_19],
        ),
        (
            0,
            71,
            [82.157_486, 118.898_9, 3.423_320_5, 91.024_08, 0.068_300_17],
        ),
        (
            1,
            96,
            [240.095_1, 41.147_877, 4.197_725, 187.585_75, 0.065_351_93],
        ),
        (
            2,
            65,
            [155.689_21, 35.325_81, 4.748_607_6, 273.275_3, 0.070_588_395],
        ),
        (
            3,
            16,
            [199.349_1, 138.597_27, 6.086_443_4, 14.068_108, 0.052_392_44],
        ),
        (
            4,
            24,
            [125.529_724, 45.344_685, 8.643_561, 94.147_705, 0.067_732_47],
        ),
        (
            5,
            64,
            [127.689_316, 58.316_788, 9.943_7, 99.235_46, 0.103_702_94],
        ),
        (
            6,
            34,
            [127.189_31, 162.960_53, 12.793_511, 181.608_1, 0.093_630_71],
        ),
        (
            7,
            9,
            [
                247.852_95,
                47.498_177,
                14.524_554,
                219.216_52,
                0.070_497_595,
            ],
        ),
        (
            8,
            6,
            [88.988_884, 35.661_8, 20.298_864, 129.331_83, 0.062_175_78],
        ),
        (
            9,
            5,
            [230.291, 26.649_397, 24.826_689, 155.123, 0.063_937_11],
        ),
    ];
    let keypoints = sift().detect(&uneven_blocks());
    let counts: usize = expected.iter().map(|layer| layer.1).sum();
    assert_eq!(keypoints.len(), counts);
    for (layer, count, numbers) in expected {
        let of_layer = || keypoints.iter().filter(|k| k.octave == layer);
        assert_eq!(of_layer().count(), count, "layer {layer}");
        let is_found = of_layer().any(|k| {
            let angle = k.angle.expect("SIFT assigns orientations").to_degrees();
            let found = [k.at.x, k.at.y, k.size, angle, k.response];
            let mut both = found.iter().zip(numbers);
            both.all(|(found, number)| (found / number - 1.0).abs() < 1e-4)
        });
        assert!(is_found, "{numbers:?} on layer {layer}");
    }
}

#[test]
fn features_turn_with_the_image() {
    // Without doubling, and of sizes 2^n m + 1, each octave takes the same pixels from both ends.
    let sift = Sift::new(SiftParams {
        double_image: false,
        ..Default::default()
    })
    .unwrap();
    let image = texture(Size::new(193, 161));
    let (width, height) = (image.width(), image.height());
    // A quarter turn clockwise: (x, y) goes to (height - 1 - y, x).
    let turned = GrayImage::from_fn(Size::new(height, width), |x, y| image.at(y, height - 1 - x));
    let (a, b) = (sift.extract(&image), sift.extract(&turned));
    let (Descriptors::Float(a_rows), Descriptors::Float(b_rows)) = (&a.descriptors, &b.descriptors)
    else {
        panic!("SIFT has real values");
    };
    let is_twin = |p: &Keypoint, q: &Keypoint| {
        let at = Point2::new((height - 1) as f32 - p.at.y, p.at.x);
        let turn = (q.angle.unwrap() - p.angle.unwrap() - FRAC_PI_2).rem_euclid(TAU);
        (at - q.at).norm() < 0.1
            && (q.size / p.size - 1.0).abs() < 0.02
            && turn.min(TAU - turn) < 0.02
    };
    let twins: Vec<_> = (0..a.len())
        .filter_map(|i| {
            let j = (0..b.len()).find(|&j| is_twin(&a.keypoints[i], &b.keypoints[j]))?;
            Some((i, j))
        })
        .collect();
    assert!(a.len() > 50, "{} features", a.len());
    assert!(
        twins.len() * 20 > a.len() * 19,
        "{} twins of {}",
        twins.len(),
        a.len()
    );
    let mut distances: Vec<f32> = twins
        .iter()
        .map(|&(i, j)| {
            let differences = a_rows.row(i).iter().zip(b_rows.row(j)).map(|(a, b)| a - b);
            differences.map(|d| d * d).sum::<f32>().sqrt()
        })
        .collect();
    distances.sort_by(f32::total_cmp);
    assert!(distances[distances.len() / 2] < 25.0, "of a norm of 512");
}

#[test]
fn detecting_then_describing_is_extracting() {
    let image = texture(Size::new(160, 120));
    let features = sift().extract(&image);
    let mut keypoints = sift().detect(&image);
    let descriptors = sift().describe(&image, &mut keypoints);
    assert!(!features.is_empty());
    assert_eq!(
        features,
        Features::new(image.size(), keypoints, descriptors)
    );
}

#[test]
fn descriptors_are_bytes_of_about_one_norm() {
    let Descriptors::Float(rows) = sift().extract(&texture(Size::new(160, 120))).descriptors else {
        panic!("SIFT has real values");
    };
    for i in 0..rows.len() {
        let row = rows.row(i);
        assert!(
            row.iter()
                .all(|v| v.fract() == 0.0 && (0.0..=255.0).contains(v))
        );
        let norm = row.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((norm - 512.0).abs() < 30.0, "{norm}");
    }
}

#[test]
fn any_image_is_taken() {
    let sizes = [
        (0, 0),
        (0, 5),
        (5, 0),
        (1, 1),
        (2, 3),
        (5, 6),
        (6, 7),
        (11, 11),
        (3000, 6),
        (8, 2000),
    ];
    for (width, height) in sizes {
        let size = Size::new(width, height);
        for image in [
            noise(size),
            GrayImage::filled(size, 0),
            GrayImage::filled(size, 255),
        ] {
            let features = sift().extract(&image);
            for keypoint in &features.keypoints {
                assert!(
                    keypoint.is_describable_in(image.size()),
                    "{keypoint:?} in {size}"
                );
                assert!((0.0..TAU).contains(&keypoint.angle.unwrap()));
            }
            if image.data().iter().all(|&v| v == 0) {
                assert!(features.is_empty(), "{size}");
            }
        }
    }
    assert!(sift().extract(&noise(Size::new(64, 64))).len() > 20);
}

#[test]
fn keypoints_of_others_are_described_or_removed() {
    let image = texture(Size::new(90, 80));
    let good = Keypoint {
        at: Point2::new(40.0, 30.0),
        size: 9.0,
        angle: None,
        response: 0.0,
        octave: 77,
    };
    let at = |x, y| Keypoint {
        at: Point2::new(x, y),
        ..good
    };
    let sized = |size| Keypoint { size, ..good };
    let mut keypoints = vec![
        good,
        at(-1.0, 3.0),
        at(f32::NAN, 3.0),
        at(3.0, 80.0),
        at(89.4, 79.4),
        at(-0.4, -0.4),
        sized(0.0),
        sized(-1.0),
        sized(f32::NAN),
        sized(f32::INFINITY),
        sized(1e9),
        sized(1e-9),
        sized(1e-25),
        Keypoint {
            angle: Some(f32::NAN),
            ..good
        },
        Keypoint {
            angle: Some(1.0),
            ..good
        },
    ];
    let descriptors = sift().describe(&image, &mut keypoints);
    let kept: Vec<_> = keypoints.iter().map(|k| (k.at.x, k.size)).collect();
    assert_eq!(
        kept,
        [
            (40.0, 9.0),
            (89.4, 9.0),
            (-0.4, 9.0),
            (40.0, 1e9),
            (40.0, 1e-9),
            (40.0, 9.0)
        ]
    );
    assert_eq!(descriptors.len(), kept.len());
    assert!(keypoints.iter().all(|k| k.angle.is_some()));
    assert_eq!(keypoints[5].angle, Some(1.0));

    let mut keypoints = vec![good];
    assert!(
        sift()
            .describe(&GrayImage::filled(Size::new(0, 0), 0), &mut keypoints)
            .is_empty()
    );
    assert!(keypoints.is_empty());
}

#[test]
fn the_level_is_read_from_the_keypoint_alone() {
    let image = texture(Size::new(160, 120));
    for params in [
        SiftParams::default(),
        SiftParams {
            octave_layers: 5,
            ..Default::default()
        },
        SiftParams {
            octave_layers: 1,
            double_image: false,
            contrast_threshold: 0.01,
            ..Default::default()
        },
    ] {
        let sift = Sift::new(params).unwrap();
        let keypoints = sift.detect(&image);
        let octaves = sift.shape().octaves(image.size());
        assert!(!keypoints.is_empty());
        let layers = params.octave_layers as i32;
        for keypoint in keypoints {
            let (octave, layer) = sift.level(&keypoint, &octaves);
            let number = octaves[octave].number * layers + layer as i32;
            assert_eq!(number, i32::from(keypoint.octave), "{keypoint:?}");
            // The same level is found by size where the number says nothing.
            let foreign = Keypoint {
                octave: 1000,
                ..keypoint
            };
            assert_eq!(
                sift.level(&foreign, &octaves),
                (octave, layer),
                "{keypoint:?}"
            );
        }
    }
}

#[test]
fn a_limit_keeps_the_strongest_in_their_order() {
    let image = texture(Size::new(160, 120));
    let all = sift().detect(&image);
    let limited = Sift::new(SiftParams {
        limit: Some(20),
        ..Default::default()
    })
    .unwrap();
    let some = limited.detect(&image);
    assert_eq!(some.len(), 20);
    let weakest = some.iter().map(|k| k.response).fold(f32::MAX, f32::min);
    let stronger = all.iter().filter(|k| k.response > weakest);
    assert!(stronger.clone().count() < 20);
    assert!(stronger.clone().all(|k| some.contains(k)));
    assert!(some.is_sorted_by(|a, b| a.at.x <= b.at.x));
}

#[test]
fn parameters_out_of_range_are_named() {
    let default = SiftParams::default();
    for (params, name) in [
        (
            SiftParams {
                octave_layers: 0,
                ..default
            },
            "octave_layers",
        ),
        (
            SiftParams {
                contrast_threshold: f32::NAN,
                ..default
            },
            "contrast_threshold",
        ),
        (
            SiftParams {
                edge_threshold: 1.0,
                ..default
            },
            "edge_threshold",
        ),
        (
            SiftParams {
                sigma: 0.0,
                ..default
            },
            "sigma",
        ),
    ] {
        let error = Sift::new(params).unwrap_err();
        assert!(
            error.to_string().starts_with(&format!("`{name}` is ")),
            "{error}"
        );
    }
}

/// The numbers were measured with an allocator that counts, on the wall of small patches of [`Extractor::memory`].
#[test]
fn the_strip_counts_where_it_is_more_than_the_features() {
    let megabytes = |params, width, height| {
        let sift = Sift::new(params).expect("in range");
        Extractor::memory(&sift, Size::new(width, height)) as f64 * 1e-6
    };
    let default = SiftParams::default();
    for (width, height, taken) in [(320, 240, 2.61), (640, 480, 6.23), (3072, 2048, 61.0)] {
        let said = megabytes(default, width, height);
        assert!(
            said > taken && said < 2.1 * taken,
            "{width} x {height}: {said}"
        );
    }
    let wide = SiftParams {
        sigma: 8.0,
        ..default
    };
    let said = megabytes(wide, 640, 480);
    assert!(said > 16.27 && said < 25.0, "{said}");
}
