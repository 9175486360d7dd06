use super::*;
use crate::features::extractor_tests::{agreement, assert_odd_images_are_fine, blobs};

fn akaze() -> Akaze {
    Akaze::new(AkazeParams::default()).expect("the default is valid")
}

#[test]
fn features_turn_with_the_image() {
    let upright = akaze().extract(&blobs(0.0));
    for (degrees, twins, distance) in [(90.0, 0.85, 0.04), (37.0, 0.7, 0.2)] {
        let turned = akaze().extract(&blobs(degrees));
        let (share, median) = agreement(&upright, &turned, degrees);
        assert!(share > twins, "{degrees} degrees: {share} have twins");
        assert!(median < distance, "{degrees} degrees: {median} differ");
    }
}

#[test]
fn odd_images_are_fine() {
    assert!(assert_odd_images_are_fine(&akaze()) > 0);
    let all = AkazeParams {
        threshold: 0.0,
        octaves: 16,
        levels: 2,
    };
    assert_odd_images_are_fine(&Akaze::new(all).expect("within the ranges"));
}

#[test]
fn a_blob_is_found_where_it_is_at_its_scale() {
    // Under linear diffusion a Gaussian blob of deviation 6 has its maximum at scale 6; edges
    // that stop the diffusion keep it a little smaller.
    let image = GrayImage::from_fn(Size::new(300, 280), |x, y| {
        let squared = (x as f64 - 140.3).powi(2) + (y as f64 - 130.8).powi(2);
        (20.0 + 200.0 * libm::exp(-0.5 * squared / 36.0)) as u8
    });
    let keypoints = akaze().detect(&image);
    assert_eq!(keypoints, akaze().extract(&image).keypoints);
    let strongest = keypoints
        .iter()
        .max_by(|a, b| a.response.total_cmp(&b.response))
        .expect("a blob is found");
    assert!((strongest.at.x - 140.3).abs() < 0.3, "{strongest:?}");
    assert!((strongest.at.y - 130.8).abs() < 0.3, "{strongest:?}");
    assert!(
        (3.0..9.0).contains(&(strongest.size / 3.0)),
        "{strongest:?}"
    );
}

#[test]
fn levels_have_the_scales_and_sizes_of_the_paper() {
    let levels = akaze().levels(Size::new(640, 360));
    let octaves: Vec<(usize, usize)> = levels
        .iter()
        .step_by(4)
        .map(|l| (l.size.width, l.size.height))
        .collect();
    assert_eq!(octaves, [(640, 360), (320, 180), (160, 90), (80, 45)]);
    assert!((levels[6].scale - 1.6 * 2.0_f32.powf(1.5)).abs() < 1e-5);
    let steps: Vec<usize> = levels.iter().map(|l| l.step).collect();
    assert_eq!(steps, [2, 3, 3, 4].repeat(4));
    let counts: Vec<usize> = levels[1..].iter().map(|l| l.diffusion.len()).collect();
    assert_eq!(counts, [3, 3, 4, 4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 24, 29]);
}

/// The blur, the contrast and its decay, suppression, orientation and cells all show in these numbers.
#[test]
fn keypoints_and_bits_are_those_of_opencv() {
    // Three keypoints of cv2.AKAZE_create() of OpenCV 4.14.0 on blocks of 7 x 6 pixels, one of the first octave and two of
    // the second, by their places among all 738: x, y, size, angle in degrees, response; level; bits.
    let expected = [
        (
            30,
            [59.255_707, 38.397_3, 4.8, 188.603_23, 0.040_905_073],
            0,
            [
                0x73f81189bf7a0965,
                0x25aa50028df4c819,
                0xa67008ffffffc99f,
                0xfd9e00a7bc000201,
                0x087ff000442fff7d,
                0x9fdfdfc0679f3110,
                0x000000014f94f803,
                0x00000030f17bfc40,
            ],
        ),
        (
            731,
            [264.006_29, 57.882_774, 9.6, 199.320_89, 0.007_087_08],
            4,
            [
                0xc01f0026093f0638,
                0xca5528a55cbf001f,
                0x009cff4130081dff,
                0x021fcc66033f3c02,
                0xfb000ffb9994c882,
                0xed87b89fff2267ff,
                0xb410341082683b6b,
                0x0000000306bed9b5,
            ],
        ),
        (
            737,
            [240.114_32, 85.198_265, 13.576_45, 168.374_83, 0.004_242_132],
            6,
            [
                0x36f4b042025f0c21,
                0xdef46a8b17c8fcd1,
                0x84ad9f01404a212a,
                0xb7de0ffe00240593,
                0x00421a5bedb8001d,
                0xbc02f7a87f0a13fe,
                0xa7c1300e1be01700,
                0x00000007eef7c383,
            ],
        ),
    ];
    let blocks = GrayImage::from_fn(Size::new(340, 200), |x, y| {
        let (x, y) = (x / 7, y / 6);
        ((37 * x + 101 * y) ^ (13 * x * y)) as u8
    });
    let features = akaze().extract(&blocks);
    assert_eq!(features.len(), 738);
    let Descriptors::Binary(rows) = &features.descriptors else {
        panic!("AKAZE describes by bits");
    };
    for (i, numbers, level, bits) in expected {
        let k = features.keypoints[i];
        let angle = k.angle.expect("AKAZE assigns orientations").to_degrees();
        let found = [k.at.x, k.at.y, k.size, angle, k.response];
        for (found, number) in found.iter().zip(numbers) {
            assert!((found / number - 1.0).abs() < 1e-4, "{found}, not {number}");
        }
        assert_eq!((k.octave, rows.row(i)), (level, &bits[..]));
    }
}

/// Heights whose halves do not divide them: 900 halves to 225 and then to 112, of which each is 2.0089... pixels.
#[test]
fn any_height_can_be_halved_again_and_again() {
    for height in [89, 107, 178, 249, 675, 900] {
        let image = GrayImage::filled(Size::new(200, height), 90);
        assert!(akaze().extract(&image).is_empty(), "{height}");
    }
}

#[test]
fn parameters_out_of_range_are_refused() {
    for params in [
        AkazeParams {
            threshold: f32::NAN,
            ..Default::default()
        },
        AkazeParams {
            threshold: -1.0,
            ..Default::default()
        },
        AkazeParams {
            octaves: 0,
            ..Default::default()
        },
        AkazeParams {
            levels: 17,
            ..Default::default()
        },
    ] {
        assert!(Akaze::new(params).is_err(), "{params:?}");
    }
}
