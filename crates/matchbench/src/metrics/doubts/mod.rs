//! Whether the truth of a dataset can be right, and whether matches from outside are mostly [`copies`].
//!
//! Matches alone tell how probable it is that a pose is right ([`PoseProbabilities`](matchbench_vision::robust::PoseProbabilities)).
//! Of the poses with a probability of at least [`CONFIDENT`], nearly all agree with a sound truth, also where
//! most pairs fail. If few do, the usual [`mistakes`] are tried, and the one that explains most of these poses is
//! named. Without such an explanation the truth is in doubt only if rotations contradict it: where baselines are short,
//! estimators are sometimes sure of a wrong direction of translation.
//!
//! A truth may also be a little wrong everywhere, when the poses are those of a body to which the camera is fixed. In
//! the kitchen of 7-Scenes, whose poses are those of the depth camera, 6 of 30 confident poses are within 5 degrees of
//! the truth, and 26 if that camera is turned by 6 degrees; on sound scenes nearly all are.
//!
//! Scores do not depend on any of this.

mod copies;
mod mistakes;

use std::collections::{BTreeMap, BTreeSet};

use matchbench_vision::geometry::RelativePose;
use matchbench_vision::robust::RIGHT_POSE;
use nalgebra::Isometry3;

use super::{Angle, ResultSet};
use crate::datasets::{Pair, Sequence};
use crate::records::{Outcome, RunFolder, StoreError};
use copies::copies;
use mistakes::{Mistake, mistakes};

/// Probability of a pose to be right from which on it is confident.
const CONFIDENT: f64 = 0.9;
/// Fewer pairs with a confident pose say nothing ...
const MIN_PAIRS: usize = 10;
/// ... and neither do fewer images: a single one may show the same thing at two places.
const MIN_IMAGES: usize = 5;
/// The most pairs of a dataset that are looked at, evenly spread over all.
const MAX_PAIRS: usize = 2000;
/// Mistakes are tried if fewer than this share of the pairs agree with the truth ...
const FEW_AGREE: f64 = 0.4;
/// ... and one explains it if this share of the pairs agree under it, and at least twice as many as without it.
const MAX_AGREE: f64 = 0.5;
/// Without an explanation the truth is in doubt if fewer than this share of the pairs agree with it.
const HARDLY_ANY_AGREE: f64 = 0.2;

/// Confident poses are mostly nearer to a sound truth than this, in degrees ...
const NEAR: f64 = RIGHT_POSE / 2.0;
/// ... so if fewer than this share of the pairs are, the camera may be fixed to the body whose poses they are ...
const FEW_NEAR: f64 = 0.5;
/// ... which explains it if this share of the pairs are near then, and at least twice as many as without it.
const MOST_NEAR: f64 = 0.7;

/// What is said where no mistake explains it ...
const UNEXPLAINED: &str = "no usual mistake explains that; check the order of images and poses, the calibration \
                           (`matchbench validate`), and the matches if they come from outside";
/// ... and where none can be tried.
const NOT_AT_HAND: &str = "to find out which mistake explains that, put the dataset, unchanged, where the plan of the \
                           run has it";

/// The pairs of a dataset that have a confident pose, each with what of these poses agrees with the truth.
type Judged = BTreeMap<(u32, u32), Agreement>;

/// The confident poses of pairs.
type Estimates = BTreeMap<(u32, u32), Vec<RelativePose>>;

/// Whether one of the confident poses of a pair agrees with the truth.
#[derive(Clone, Copy, Default)]
struct Agreement {
    pose: bool,
    near: bool,
    rotation: bool,
}

/// Of each dataset of a run whose truth contradicts most of its confident poses a sentence: which mistake explains
/// that, and what to do. Then a sentence of each matcher from outside whose matches are mostly copies of others. `sets` are the
/// results of the run.
///
/// # Errors
/// If records of such a dataset cannot be read.
pub fn doubts(run: &RunFolder, sets: &[ResultSet]) -> Result<Vec<String>, StoreError> {
    let mut sentences = Vec::new();
    for dataset in &run.plan().datasets {
        let sets = sets.iter().filter(|set| set.dataset == dataset.name);
        let sets: Vec<&ResultSet> = sets.collect();
        let judged = judged(&sets);
        let (few_agree, few_near) = (is_doubtful(&judged), are_few_near(&judged));
        if !few_agree && !few_near {
            continue;
        }
        let sequence = Sequence::open_same(&dataset.path, &dataset.fingerprint);
        let (mut usual, mut of_a_body) = (None, None);
        if let Some(sequence) = &sequence {
            let poses = poses(run, &sets, &judged)?;
            if few_agree {
                usual = explanation(sequence, &poses)
                    .filter(|(_, count)| *count >= 2 * agreeing(&judged));
            }
            if few_near && usual.is_none() {
                of_a_body = body(sequence, &poses).filter(|(_, count)| *count >= 2 * near(&judged));
            }
        }
        let pairs = judged.len();
        let reason = match (usual, of_a_body) {
            (Some((Mistake { what, remedy, .. }, count)), _) => format!(
                "{} of {pairs} pairs with a confident pose contradict it, and {count} agree if {what}; {remedy}, and \
                 import again",
                pairs - agreeing(&judged)
            ),
            (None, Some((Mistake { what, remedy, .. }, count))) => format!(
                "{} of {pairs} pairs with a confident pose are {NEAR} degrees or more off, but only {} if {what}; \
                 {remedy}, and import again",
                pairs - near(&judged),
                pairs - count
            ),
            (None, None) if !few_agree || !is_contradicted(&judged) => continue,
            (None, None) => format!(
                "{} of {pairs} pairs with a confident pose contradict it, and {}",
                pairs - agreeing(&judged),
                if sequence.is_some() {
                    UNEXPLAINED
                } else {
                    NOT_AT_HAND
                }
            ),
        };
        sentences.push(format!(
            "the truth of {} looks wrong: {reason}",
            dataset.name
        ));
    }
    sentences.extend(copies(run, sets));
    Ok(sentences)
}

fn judged(sets: &[&ResultSet]) -> Judged {
    let mut all = Judged::new();
    for pair in sets.iter().flat_map(|set| &set.pairs) {
        let errors = (pair.error(Angle::Pose)).zip(pair.error(Angle::Rotation));
        if let Some((pose, rotation)) = errors
            && pair.pose_probability.is_some_and(|p| p >= CONFIDENT)
        {
            let agreement = all.entry((pair.a, pair.b)).or_default();
            agreement.pose |= pose < RIGHT_POSE;
            agreement.near |= pose < NEAR;
            agreement.rotation |= rotation < RIGHT_POSE;
        }
    }
    let step = all.len().div_ceil(MAX_PAIRS).max(1);
    all.into_iter().step_by(step).collect()
}

fn agreeing(judged: &Judged) -> usize {
    judged.values().filter(|agreement| agreement.pose).count()
}

fn near(judged: &Judged) -> usize {
    judged.values().filter(|agreement| agreement.near).count()
}

/// Whether there are enough pairs.
fn can_tell(judged: &Judged) -> bool {
    let images: BTreeSet<u32> = judged.keys().flat_map(|&(a, b)| [a, b]).collect();
    judged.len() >= MIN_PAIRS && images.len() >= MIN_IMAGES
}

/// Whether there are enough pairs, of which few are near the truth.
fn are_few_near(judged: &Judged) -> bool {
    can_tell(judged) && (near(judged) as f64) < FEW_NEAR * judged.len() as f64
}

/// Whether there are enough pairs, of which few agree with the truth.
fn is_doubtful(judged: &Judged) -> bool {
    can_tell(judged) && (agreeing(judged) as f64) < FEW_AGREE * judged.len() as f64
}

/// Whether hardly any pair agrees with the truth, and the rotations of at least half of them contradict it.
fn is_contradicted(judged: &Judged) -> bool {
    let turned = judged.values().filter(|agreement| !agreement.rotation);
    (agreeing(judged) as f64) < HARDLY_ANY_AGREE * judged.len() as f64
        && turned.count() * 2 >= judged.len()
}

/// The confident poses of these pairs.
fn poses(run: &RunFolder, sets: &[&ResultSet], judged: &Judged) -> Result<Estimates, StoreError> {
    let mut poses = Estimates::new();
    for set in sets {
        run.for_each_of([&set.dataset, &set.matcher, &set.estimator], |record| {
            let pair = (record.task.a, record.task.b);
            let Outcome::Pose {
                pose_probability, ..
            } = record.outcome
            else {
                return;
            };
            if pose_probability.is_some_and(|p| p >= CONFIDENT) && judged.contains_key(&pair) {
                poses.entry(pair).or_default().extend(record.outcome.pose());
            }
        })?;
    }
    Ok(poses)
}

/// The mistake under which most of these pairs have a pose that agrees with the truth, and how many; `None` if fewer
/// than half do. Of several equal ones, the one that is more frequent.
fn explanation(sequence: &Sequence, poses: &Estimates) -> Option<(Mistake, usize)> {
    let mut best: Option<(Mistake, usize)> = None;
    for mistake in mistakes(sequence) {
        let count = explained(&mistake, RIGHT_POSE, sequence, poses);
        if best.as_ref().is_none_or(|(_, most)| count > *most) {
            best = Some((mistake, count));
        }
    }
    best.filter(|(_, count)| *count as f64 >= MAX_AGREE * poses.len() as f64)
}

/// That the poses are those of a body to which the camera is fixed, and how many pairs have a near pose then; `None` if
/// some have none.
fn body(sequence: &Sequence, poses: &Estimates) -> Option<(Mistake, usize)> {
    let mistake = Mistake::of_a_body(&motions(sequence, poses))?;
    let count = explained(&mistake, NEAR, sequence, poses);
    (count as f64 >= MOST_NEAR * poses.len() as f64).then_some((mistake, count))
}

/// How many of these pairs have a pose within so many degrees of the truth if this mistake was made.
fn explained(mistake: &Mistake, degrees: f64, sequence: &Sequence, poses: &Estimates) -> usize {
    let agrees = |pair: &&Pair| {
        let poses = poses.get(&(pair.a, pair.b))?;
        let truth = mistake.truth((pair.a, pair.b), pair.pose()?)?;
        let truth = RelativePose::from_isometry(&truth)?;
        let error = |pose: &RelativePose| pose.error(&truth).max().to_degrees();
        poses.iter().any(|pose| error(pose) < degrees).then_some(())
    };
    let pairs = sequence.pairs.iter();
    pairs.filter(|pair| agrees(pair).is_some()).count()
}

/// The motions of these pairs, each with one of its poses.
fn motions(sequence: &Sequence, poses: &Estimates) -> Vec<(Isometry3<f64>, RelativePose)> {
    let motion = |pair: &Pair| {
        let estimate = poses.get(&(pair.a, pair.b))?.first()?;
        Some((*pair.pose()?, *estimate))
    };
    sequence.pairs.iter().filter_map(motion).collect()
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::Camera;
    use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

    use super::super::{AngularError, Deviation, Failure, PairResult};
    use super::*;
    use crate::datasets::{Frame, relative_pose};

    /// Frames in the order of numbers in their names, which is not that of the alphabet.
    const FRAMES: usize = 12;

    /// Where a camera truly is: it turns and moves to all sides.
    fn place(frame: usize) -> Isometry3<f64> {
        let i = frame as f64;
        Isometry3::new(
            Vector3::new(libm::sin(2.0 * i), 0.5 * libm::cos(3.0 * i), 0.7 * i),
            Vector3::new(
                0.3 * libm::sin(1.3 * i),
                0.4 * libm::cos(i),
                0.5 * libm::sin(1.7 * i),
            ),
        )
    }

    /// A dataset with these poses in the world, and every pair.
    fn dataset(pose: impl Fn(usize) -> Isometry3<f64>) -> Sequence {
        let camera = Camera::pinhole(100.0, 100.0, 50.0, 50.0);
        let frame = |index| Frame::with_pose(format!("{index}.png"), camera, pose(index));
        let frames: Vec<Frame> = (0..FRAMES).map(frame).collect();
        let pairs = pairs().map(|(a, b)| {
            let b_from_a = relative_pose(&pose(a as usize), &pose(b as usize));
            Pair::with_pose(a, b, b_from_a)
        });
        let (name, pairs) = ("room".into(), pairs.collect());
        Sequence {
            name,
            frames,
            pairs,
        }
    }

    fn pairs() -> impl Iterator<Item = (u32, u32)> {
        let frames = FRAMES as u32;
        (0..frames).flat_map(move |a| (a + 1..frames).map(move |b| (a, b)))
    }

    /// What the matches say, which is true, of each pair.
    fn estimates() -> Estimates {
        let estimate = |(a, b)| {
            let truth = relative_pose(&place(a as usize), &place(b as usize));
            (
                (a, b),
                vec![RelativePose::from_isometry(&truth).expect("they are apart")],
            )
        };
        pairs().map(estimate).collect()
    }

    fn named(sequence: &Sequence) -> Option<String> {
        explanation(sequence, &estimates()).map(|(mistake, _)| mistake.what)
    }

    /// A pose as it is written with other axes of the camera, of which these are the rows of `camera_from_other`.
    fn with_axes(pose: &Isometry3<f64>, rows: [f64; 9]) -> Isometry3<f64> {
        let turn = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&rows));
        pose * UnitQuaternion::from_rotation_matrix(&turn)
    }

    const OPENGL: [f64; 9] = [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0];
    const ROBOT: [f64; 9] = [0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0];

    fn with_coordinates(pose: &Isometry3<f64>, [w, x, y, z]: [f64; 4]) -> Isometry3<f64> {
        let rotation = nalgebra::Quaternion::new(w, x, y, z);
        Isometry3::from_parts(pose.translation, UnitQuaternion::from_quaternion(rotation))
    }

    #[test]
    fn each_mistake_is_told_from_all_others() {
        type Written = fn(usize) -> Isometry3<f64>;
        let mistakes: [(&str, Written); 11] = [
            ("the poses are camera-from-world", |i| place(i).inverse()),
            ("the axes of the cameras are y up, looking along -z", |i| {
                with_axes(&place(i), OPENGL)
            }),
            ("the axes of the cameras are x ahead, y left", |i| {
                with_axes(&place(i), ROBOT)
            }),
            (
                "the poses are camera-from-world, and the axes of the cameras are y up, looking",
                |i| with_axes(&place(i), OPENGL).inverse(),
            ),
            ("the axes of the cameras are y up in a left-handed", |i| {
                let (pose, mirror) = (place(i), Vector3::new(1.0, -1.0, 1.0));
                let q = pose.rotation.coords;
                let mirrored = with_coordinates(&pose, [q.w, -q.x, q.y, -q.z]);
                let moved = Translation3::from(pose.translation.vector.component_mul(&mirror));
                Isometry3::from_parts(moved, mirrored.rotation)
            }),
            ("the quaternions have w first", |i| {
                let q = place(i).rotation.coords;
                with_coordinates(&place(i), [q.z, q.w, q.x, q.y])
            }),
            ("the quaternions have w last", |i| {
                let q = place(i).rotation.coords;
                with_coordinates(&place(i), [q.x, q.y, q.z, q.w])
            }),
            ("the rotations are camera-from-world", |i| {
                Isometry3::from_parts(place(i).translation, place(i).rotation.inverse())
            }),
            ("the rotations are world-from-camera, but", |i| {
                Isometry3::from_parts(place(i).inverse().translation, place(i).rotation)
            }),
            ("each pose is that of the image after", |i| place(i + 1)),
            ("the poses are in the order of the alphabet", |i| {
                place([0, 1, 10, 11, 2, 3, 4, 5, 6, 7, 8, 9][i])
            }),
        ];
        for (words, written) in mistakes {
            let what = named(&dataset(written)).expect("it is explained");
            assert!(what.starts_with(words), "{what}, not {words}");
        }
        let body_from_camera =
            Isometry3::new(Vector3::new(0.2, -0.1, 0.3), Vector3::new(0.3, -0.2, 0.1));
        let body_poses = dataset(|i| place(i) * body_from_camera.inverse());
        assert_eq!(named(&body_poses), None, "no usual one");
        let (Mistake { what, .. }, count) =
            body(&body_poses, &estimates()).expect("it is explained");
        let expected = "the poses are those of a body to which the camera is fixed, turned by 21.4 degrees and 0.374 away";
        assert_eq!((what.as_str(), count), (expected, 66));
        let mut backwards = dataset(place);
        for frame in &mut backwards.frames {
            frame.world_from_camera = None;
        }
        for pair in &mut backwards.pairs {
            *pair = Pair::with_pose(pair.a, pair.b, pair.pose().expect("it has one").inverse());
        }
        let what = named(&backwards).expect("it is explained");
        assert!(what.starts_with("the pose of each pair leads"), "{what}");
        // Estimates of another scene.
        let other = dataset(|i| place(7 * i + 5));
        assert_eq!(named(&other), None);
        assert!(body(&other, &estimates()).is_none());
    }

    /// Results of these pairs, with this pose_probability and error.
    fn results(
        pairs: impl Iterator<Item = (u32, u32)>,
        pose_probability: f64,
        error: f64,
    ) -> ResultSet {
        let pairs = pairs.map(|(a, b)| PairResult {
            pose_probability: Some(pose_probability),
            outcome: Ok(Deviation::Pose(AngularError {
                rotation: 0.5,
                translation: Some(error),
            })),
            ..PairResult::failed(a, b, Failure::Missing)
        });
        ResultSet {
            dataset: "room".into(),
            matcher: "sift".into(),
            estimator: "best".into(),
            repetitions: 1,
            pairs: pairs.collect(),
            ignored: 0,
            lacking: 0,
        }
    }

    #[test]
    fn doubts_need_many_confident_poses_that_no_method_confirms() {
        let doubtful = |sets: &[&ResultSet]| is_doubtful(&judged(sets));
        let wrong = results(pairs(), 0.95, 80.0);
        assert!(doubtful(&[&wrong]));
        assert!(!doubtful(&[&results(pairs(), 0.85, 80.0)]), "not confident");
        assert!(!doubtful(&[&results(pairs().take(9), 0.95, 80.0)]), "few");
        let two = (1..21).map(|b| (b % 2, 2 + b % 2));
        assert!(!doubtful(&[&results(two, 0.95, 80.0)]), "of few images");
        // Matches from elsewhere may be wrong; those of another matcher show that the truth is not.
        let right = |count| results(pairs().take(count), 0.95, 2.0);
        assert!(!doubtful(&[&wrong, &right(27)]), "27 of 66 agree");
        assert!(doubtful(&[&wrong, &right(26)]));
        assert_eq!(agreeing(&judged(&[&wrong, &right(26)])), 26);
    }

    #[test]
    fn directions_alone_may_be_wrong_where_the_truth_is_not() {
        let wrong = results(pairs(), 0.95, 80.0);
        assert!(!is_contradicted(&judged(&[&wrong])));
        let mut turned = wrong.clone();
        for pair in &mut turned.pairs[..33] {
            pair.outcome = Ok(Deviation::Pose(AngularError {
                rotation: 30.0,
                translation: Some(80.0),
            }));
        }
        assert!(is_contradicted(&judged(&[&turned])));
        assert!(!is_contradicted(&judged(&[&turned, &wrong])));
        let right = |count| results(pairs().skip(33).take(count), 0.95, 2.0);
        assert!(is_contradicted(&judged(&[&turned, &right(13)])));
        assert!(
            !is_contradicted(&judged(&[&turned, &right(14)])),
            "14 of 66 agree"
        );
    }

    #[test]
    fn a_truth_may_be_that_of_a_body_where_few_poses_are_within_five_degrees() {
        let few = |sets: &[&ResultSet]| are_few_near(&judged(sets));
        let off = results(pairs(), 0.95, 5.0);
        assert!(few(&[&off]));
        assert!(!few(&[&results(pairs().take(9), 0.95, 5.0)]), "of few");
        let within = |count| results(pairs().take(count), 0.95, 4.9);
        assert!(few(&[&off, &within(32)]));
        assert!(!few(&[&off, &within(33)]), "33 of 66 are near");
    }

    #[test]
    fn of_very_many_pairs_some_are_looked_at() {
        let many = results((0..9001).map(|a| (a, a + 1)), 0.95, 80.0);
        let judged = judged(&[&many]);
        assert!(
            (1500..=MAX_PAIRS).contains(&judged.len()),
            "{}",
            judged.len()
        );
        assert!(judged.keys().any(|(a, _)| *a > 8990));
    }

    #[test]
    fn a_pose_agrees_with_the_truth_below_ten_degrees() {
        let mut near = results((0..4).map(|a| (a, a + 1)), 0.95, 0.0);
        let errors = [(0.5, 9.9), (0.5, 10.0), (9.9, 10.1), (10.0, 0.5)];
        for (pair, (rotation, translation)) in near.pairs.iter_mut().zip(errors) {
            let translation = Some(translation);
            let error = AngularError {
                rotation,
                translation,
            };
            pair.outcome = Ok(Deviation::Pose(error));
        }
        let found: Vec<_> = (judged(&[&near]).values())
            .map(|agreement| (agreement.pose, agreement.rotation))
            .collect();
        let expected = [(true, true), (false, true), (false, true), (false, false)];
        assert_eq!(found, expected);
    }
}
