//! Keypoints that are the same by geometry alone, in images where each pixel's place in the other image is
//! known.
//!
//! No descriptor is used for the choice, so it favours none. The limits are those of the data set of Brown, Hua
//! and Winder ("Discriminative Learning of Local Image Descriptors", PAMI 2011: 5 pixels, a quarter of an octave, an
//! eighth of half a turn), but places are compared relative to the size, and sizes may differ by a third of an octave.

use matchbench_vision::features::{Features, Keypoint};
use nalgebra::Point2;

use super::epipolar::wrap;

/// Largest distance in place of a keypoint of size s: `max(PLACE_PX, min(PLACE_SHARE s, PLACE_PX + SLACK_SHARE s))`, in
/// pixels.
const PLACE_PX: f32 = 0.5;
const PLACE_SHARE: f32 = 0.15;
const SLACK_SHARE: f32 = 0.05;
/// Largest ratio of sizes: a third of an octave, which is the ratio of neighbouring scales.
const RATIO: f32 = 1.26;
/// Largest difference of directions, in radians.
const DIRECTION: f32 = core::f32::consts::PI / 8.0;

/// Maps a point of `a` to `b`; `None` if it cannot be seen there.
pub(super) type Transfer<'a> = &'a dyn Fn(Point2<f64>) -> Option<Point2<f64>>;

/// The keypoint as it should look in the other image.
pub(super) fn carried(keypoint: &Keypoint, transfer: Transfer<'_>) -> Option<Keypoint> {
    let angle = keypoint.angle?;
    let arm = f64::from(keypoint.size);
    let (sin, cos) = (f64::from(libm::sinf(angle)), f64::from(libm::cosf(angle)));
    let at = Point2::new(f64::from(keypoint.at.x), f64::from(keypoint.at.y));
    let offset = |x: f64, y: f64| transfer(Point2::new(at.x + arm * x, at.y + arm * y));
    let centre = transfer(at)?;
    let along = (offset(cos, sin)? - offset(-cos, -sin)?) * 0.5;
    let across = (offset(-sin, cos)? - offset(sin, -cos)?) * 0.5;
    let area = along.x * across.y - along.y * across.x;
    // A surface seen from behind, or a step in depth, distorts the keypoint too much.
    let stretched = along.norm().max(across.norm()) / along.norm().min(across.norm());
    (area > 0.0 && stretched < 3.0).then(|| Keypoint {
        at: Point2::new(centre.x as f32, centre.y as f32),
        size: area.sqrt() as f32,
        angle: Some(libm::atan2(along.y, along.x) as f32),
        ..*keypoint
    })
}

/// Keypoints of `a` and `b` that are the same: for each of `a`, the nearest of those that agree with it.
pub(super) fn agreeing(a: &Features, b: &Features, transfer: Transfer<'_>) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (i, keypoint) in a.keypoints.iter().enumerate() {
        let Some(expected) = carried(keypoint, transfer) else {
            continue;
        };
        let reach = (PLACE_SHARE * expected.size)
            .min(PLACE_PX + SLACK_SHARE * expected.size)
            .max(PLACE_PX);
        let fits = |found: &Keypoint| {
            let ratio = found.size / expected.size;
            let turn = wrap(found.angle.unwrap_or(0.0) - expected.angle.unwrap_or(0.0));
            ratio < RATIO && ratio > 1.0 / RATIO && turn.abs() < DIRECTION
        };
        // Keypoints are sorted by column.
        let first = b
            .keypoints
            .partition_point(|k| k.at.x < expected.at.x - reach);
        let nearest = (b.keypoints.iter().enumerate().skip(first))
            .take_while(|(_, found)| found.at.x <= expected.at.x + reach)
            .filter(|(_, found)| fits(found))
            .map(|(j, found)| ((found.at - expected.at).norm(), j))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, j)) = nearest.filter(|&(distance, _)| distance <= reach) {
            pairs.push((i, j));
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use core::f32::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_keypoint_is_turned_and_grows_with_the_image() {
        let keypoint = Keypoint {
            at: Point2::new(10.0, 20.0),
            size: 4.0,
            angle: Some(0.3),
            response: 0.0,
            octave: 0,
        };
        // A quarter of a turn clockwise on the screen, and twice as large.
        let transfer = |p: Point2<f64>| Some(Point2::new(100.0 - 2.0 * p.y, 2.0 * p.x));
        let carried = carried(&keypoint, &transfer).expect("everything is seen");
        assert_eq!(carried.at, Point2::new(60.0, 20.0));
        assert!((carried.size - 8.0).abs() < 1e-5);
        assert!((carried.angle.unwrap() - 0.3 - FRAC_PI_2).abs() < 1e-5);
        let mirrored = |p: Point2<f64>| Some(Point2::new(-p.x, p.y));
        assert!(super::carried(&keypoint, &mirrored).is_none());
        assert!(super::carried(&keypoint, &|_| None).is_none());
    }
}
