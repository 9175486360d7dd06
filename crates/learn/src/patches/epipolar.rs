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

#[cfg(test)]
mod tests {
    use matchbench_vision::features::{Descriptors, FloatRows, Keypoint};
    use matchbench_vision::image::Size;
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    const EXACT: usize = 10;

    fn features(keypoints: Vec<Keypoint>, descriptors: Vec<f32>) -> Features {
        let descriptors = Descriptors::Float(FloatRows::from_vec(1, descriptors));
        Features::new(Size::new(640, 480), keypoints, descriptors)
    }

    #[test]
    fn only_matches_that_agree_with_the_pose_and_with_each_other_are_kept() {
        let camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);
        // A camera that moved to the side: lines are rows.
        let b_from_a = RelativePose {
            rotation: UnitQuaternion::identity(),
            direction: -Vector3::x_axis(),
        };
        // Matches by pixels off the line, and by how they differ from the turn and the growth of all, in radians and
        // octaves.
        let mut matches = vec![[0.0, 0.0, 0.0]; EXACT];
        let near = [[1.5, 0.0, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, 0.6]];
        let far = [[3.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.8]];
        matches.extend(near.into_iter().chain(far));
        let keypoint = |x: usize, [off, turn, growth]: [f32; 3]| Keypoint {
            at: Point2::new(100.0 + 20.0 * x as f32, 50.0 + 15.0 * x as f32 + off),
            size: 8.0 * libm::exp2f(growth),
            angle: Some(turn),
            response: 1.0,
            octave: 0,
        };
        let numbered = || matches.iter().enumerate();
        // Of each match, b sees the point farther to the left, turned by 0.1 and half as large again.
        let mut a: Vec<_> = numbered().map(|(x, _)| keypoint(x, [0.0; 3])).collect();
        let b: Vec<_> = numbered()
            .map(|(x, &[off, turn, growth])| {
                let mut seen = keypoint(x, [off, 0.1 + turn, 0.58 + growth]);
                seen.at.x -= 30.0;
                seen
            })
            .collect();
        let rows: Vec<f32> = (0..b.len()).map(|row| row as f32).collect();
        // One more of a is at the same place as the first, but the first is nearer to that of b.
        a.push(a[0]);
        let rows_a = rows.iter().copied().chain([0.25]).collect();
        let found = agreeing(
            [&features(a, rows_a), &features(b, rows)],
            [&camera, &camera],
            &b_from_a,
        );
        let kept = EXACT + near.len();
        assert_eq!(found, (0..kept).map(|n| (n, n)).collect::<Vec<_>>());
    }
}
