//! Compares the poses of pairs with the poses of their frames, where a dataset has both.
//!
//! A run takes the pose of a pair. If the frames say something else, one of the two is wrong, most often
//! because it was written the other way round, and scores against it mean nothing.

use std::path::Path;

use nalgebra::Isometry3;

use super::images::IMAGES;
use super::native::{PAIRS, POSES};
use super::{DatasetError, Problem, Sequence, relative_pose};
use crate::counted::counted;

/// Largest angle between the rotation of a pair and that of the poses, in radians (0.1 degrees; both are
/// printed with about six digits).
const ROTATION_TOLERANCE_RAD: f64 = 1.75e-3;
/// Largest difference of the translations, as a share of the baseline ...
const TRANSLATION_TOLERANCE: f64 = 0.01;
/// ... plus the uncertainty of six printed digits, as a share of the distances of the cameras from the origin.
const PRINTED_DIGITS: f64 = 1e-5;

/// How the pose of a pair contradicts those of its frames in the world; `None` if it does not.
pub(super) fn contradiction(
    (a, b): (u32, u32),
    b_from_a: &Isometry3<f64>,
    [world_from_a, world_from_b]: [&Isometry3<f64>; 2],
) -> Option<String> {
    let expected = relative_pose(world_from_a, world_from_b);
    let angle = b_from_a.rotation.angle_to(&expected.rotation);
    let shift = (b_from_a.translation.vector - expected.translation.vector).norm();
    let baseline = expected.translation.vector.norm();
    let from_origin =
        world_from_a.translation.vector.norm() + world_from_b.translation.vector.norm();
    let allowed = TRANSLATION_TOLERANCE * baseline + PRINTED_DIGITS * from_origin;
    (angle > ROTATION_TOLERANCE_RAD || shift > allowed).then(|| {
        format!(
            "the pair {a} {b} differs from pose.txt by {:.2} degrees and {shift:.3e} of a baseline of \
             {baseline:.3e}",
            angle.to_degrees()
        )
    })
}

/// What is to be done about a contradiction in the dataset in the folder `dir`.
pub(super) fn remedy(dir: &Path) -> String {
    format!(
        "both say world_from_camera and x_b = R x_a + t? Correct the pair or {}",
        dir.join(IMAGES).join(POSES).display()
    )
}

/// Whether pairs of an opened dataset in the folder `dir` contradict the poses of its frames: how many, and the
/// first one.
pub fn pair_pose_problem(dir: &Path, sequence: &Sequence) -> Option<Problem> {
    let world = |frame: u32| sequence.frames[frame as usize].world_from_camera.as_ref();
    let mut wrong = (sequence.pairs.iter()).filter_map(|pair| {
        let poses = [world(pair.a)?, world(pair.b)?];
        contradiction((pair.a, pair.b), pair.pose()?, poses)
    });
    let first = wrong.next()?;
    let what = match wrong.count() {
        0 => first,
        others => format!("{first}, and {} too", counted(others, "other pair")),
    };
    Some(DatasetError::new(dir.join(PAIRS), what, remedy(dir)).into())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::testing;
    use super::*;

    #[test]
    fn pairs_that_contradict_the_poses_are_counted_and_the_first_is_named() {
        let (_folder, dir) = testing::dataset();
        let problem = || pair_pose_problem(&dir, &Sequence::open(&dir).unwrap());
        assert_eq!(problem(), None);
        let file = dir.join(IMAGES).join(POSES);
        let text = fs::read_to_string(&file).unwrap();
        // The camera of frame 1 elsewhere.
        let mut lines: Vec<&str> = text.lines().collect();
        lines[1] = "1 0 0 50 0 1 0 0 0 0 1 0";
        fs::write(&file, lines.join("\n")).unwrap();
        let found = problem().unwrap().error.what;
        assert!(found.starts_with("the pair 0 1 differs"), "{found}");
        assert!(found.ends_with("and 2 other pairs too"), "{found}");
    }
}
