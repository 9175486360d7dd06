//! Matches in photographs with known poses, chosen so that they agree with the poses and with each other.

use core::f32::consts::{PI, TAU};

use matchbench_vision::features::Features;
use matchbench_vision::geometry::{
    Camera, PointPairs, RelativePose, essential_from_pose, squared_sampson_distances,
};
use matchbench_vision::matching::two_nearest;
use nalgebra::Point2;

/// Largest distance from the epipolar line, in pixels.
const TOLERANCE: f64 = 1.5;
/// Largest difference between the rotation of a match's keypoints and the median rotation, in radians.
const DIRECTION: f32 = 0.4;
/// Largest difference between the scale change of a match's keypoints and the median scale change, in octaves.
const OCTAVES: f32 = 0.7;

/// Features of `a` and `b` that probably show the same point: each is the nearest of the other, they agree with
/// the epipolar geometry, and their change of direction and of size agrees with that of the other matches.
/// There is no ratio test, since it would leave out the features that are hard to tell apart.
pub(super) fn agreeing(
    [a, b]: [&Features; 2],
    cameras: [&Camera; 2],
    b_from_a: &RelativePose,
) -> Vec<(usize, usize)> {
    let back = two_nearest(&b.descriptors, &a.descriptors);
    let mutual: Vec<(usize, usize)> = two_nearest(&a.descriptors, &b.descriptors)
        .iter()
        .filter(|m| back.get(m.b as usize).is_some_and(|back| back.b == m.a))
        .map(|m| (m.a as usize, m.b as usize))
        .collect();
    let point = |features: &Features, camera: &Camera, index: usize| {
        let at = features.keypoints[index].at;
        camera.normalize(Point2::new(f64::from(at.x), f64::from(at.y)))
    };
    let pairs: PointPairs = mutual
        .iter()
        .map(|&(i, j)| (point(a, cameras[0], i), point(b, cameras[1], j)))
        .collect();
    let mut squared = vec![0.0; mutual.len()];
    squared_sampson_distances(
        &essential_from_pose(b_from_a),
        &pairs,
        0..mutual.len(),
        &mut squared,
    );
    let focal = 0.5 * (cameras[0].mean_focal() + cameras[1].mean_focal());
    let most = (TOLERANCE / focal) * (TOLERANCE / focal);
    let near: Vec<(usize, usize)> = (mutual.iter().zip(&squared))
        .filter(|&(_, &squared)| squared < most)
        .map(|(&pair, _)| pair)
        .collect();

    let turned = |&(i, j): &(usize, usize)| {
        let angle = |features: &Features, i: usize| features.keypoints[i].angle.unwrap_or(0.0);
        wrap(angle(b, j) - angle(a, i))
    };
    let grown = |&(i, j): &(usize, usize)| libm::log2f(b.keypoints[j].size / a.keypoints[i].size);
    // Cameras are held nearly upright, so the median can ignore the jump of angles at half a turn.
    let (turn, growth) = (
        median(near.iter().map(turned)),
        median(near.iter().map(grown)),
    );
    near.into_iter()
        .filter(|pair| wrap(turned(pair) - turn).abs() < DIRECTION)
        .filter(|pair| (grown(pair) - growth).abs() < OCTAVES)
        .collect()
}

/// The angle in `[-pi, pi)`.
pub(super) fn wrap(angle: f32) -> f32 {
    angle - TAU * ((angle + PI) / TAU).floor()
}

fn median(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
