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
