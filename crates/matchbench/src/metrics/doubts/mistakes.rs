//! The usual mistakes in the truth of a dataset, and the relative poses that would be true had one been made.
//!
//! A pose `P` of a frame is read as world-from-camera, so a pair has the truth `b_from_a = P_b^-1 P_a`. Had the
//! poses been camera-from-world, it would be `P_b P_a^-1`. This is another motion than the inverse of the first, so
//! it needs the poses of the frames. If the axes of the cameras are others, with `camera = C other`, the truth is
//! `C (b_from_a) C^-1`, which follows from the pair alone; and so it is if the poses are those of a body to which the
//! camera is fixed ([`camera_from_body`]).

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;

use matchbench_vision::geometry::{RelativePose, camera_from_body};
use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::datasets::{Sequence, relative_pose};
use crate::front_door;

/// Estimates that are off by more than about this count less, in radians.
const SCALE: f64 = 3.0 * PI / 180.0;

/// A mistake that may have been made.
pub(super) struct Mistake {
    /// What the truth would be, to stand after "if".
    pub(super) what: String,
    /// How it is corrected.
    pub(super) remedy: String,
    poses: Poses,
    /// Takes the axes that the poses have to those of the camera.
    axes: Matrix3<f64>,
    /// Where that is whose poses they are, for the camera.
    place: Vector3<f64>,
}

/// Which poses are taken to be true.
enum Poses {
    /// Those of the pairs.
    Given,
    /// Those of the pairs, from the second image to the first.
    Backwards,
    /// Others of the frames.
    Frames(Vec<Option<Isometry3<f64>>>),
}

impl Mistake {
    fn new(what: impl Into<String>, remedy: impl Into<String>, poses: Poses) -> Self {
        Self {
            what: what.into(),
            remedy: remedy.into(),
            poses,
            axes: Matrix3::identity(),
            place: Vector3::zeros(),
        }
    }

    /// The poses are those of a body to which the camera is fixed, where it best explains these true poses of pairs and their
    /// estimates; `None` without any.
    pub(super) fn of_a_body(motions: &[(Isometry3<f64>, RelativePose)]) -> Option<Self> {
        let camera_from_body = camera_from_body(motions, SCALE)?;
        let axes = camera_from_body.rotation.to_rotation_matrix();
        let there = camera_from_body.inverse().to_matrix();
        let rows = there.fixed_rows::<3>(0).transpose();
        let numbers = rows.iter().map(|number| format!("{number:.4}"));
        let numbers = numbers.collect::<Vec<_>>().join(" ");
        let degrees = camera_from_body.rotation.angle().to_degrees();
        let apart = camera_from_body.translation.vector.norm();
        let what = format!(
            "the poses are those of a body to which the camera is fixed, turned by {degrees:.1} degrees and {apart:.3} away"
        );
        let remedy = format!(
            "measure where the camera is on it (these poses say `{numbers}`), give that by {}",
            front_door::BODY_FROM_CAMERA
        );
        Some(Self {
            axes: axes.into_inner(),
            place: camera_from_body.translation.vector,
            ..Self::new(what, remedy, Poses::Given)
        })
    }

    /// The true pose `b_from_a` of a pair if this mistake was made; `None` where that is not known.
    pub(super) fn truth(
        &self,
        (a, b): (u32, u32),
        given: &Isometry3<f64>,
    ) -> Option<Isometry3<f64>> {
        let b_from_a = match &self.poses {
            Poses::Given => *given,
            Poses::Backwards => given.inverse(),
            Poses::Frames(poses) => {
                let pose = |frame: u32| poses.get(frame as usize)?.as_ref();
                relative_pose(pose(a)?, pose(b)?)
            }
        };
        let turned = self.axes * b_from_a.rotation.to_rotation_matrix() * self.axes.transpose();
        let rotation = Rotation3::from_matrix_unchecked(turned);
        let translation =
            self.axes * b_from_a.translation.vector + self.place - turned * self.place;
        Some(Isometry3::from_parts(
            Translation3::from(translation),
            UnitQuaternion::from_rotation_matrix(&rotation),
        ))
    }
}

/// Axes of cameras that others use: their names, how poses are corrected, and the rows of `camera_from_other`.
const AXES: [(&str, &str, [f64; 9]); 7] = [
    (
        "y up, looking along -z, as in OpenGL and Blender",
        "negate the second and third column of the rotation of each world-from-camera pose",
        [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0],
    ),
    (
        "y up in a left-handed system, as in Unity",
        "negate the second row and the second column of each 3x4 pose",
        [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0],
    ),
    (
        "x ahead, y left, z up, as of robots (ROS)",
        "multiply each pose by the pose of the camera on the body",
        [0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0],
    ),
    (
        "x ahead, y right, z down, as of vehicles and aircraft",
        "multiply each pose by the pose of the camera on the body",
        [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0],
    ),
    (
        "turned half a turn about the optical axis",
        "turn the images, or the poses, so that both are of one orientation",
        [-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0],
    ),
    (
        "turned a quarter turn about the optical axis",
        "turn the images, or the poses, so that both are of one orientation",
        [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ),
    (
        "turned a quarter turn back about the optical axis",
        "turn the images, or the poses, so that both are of one orientation",
        [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ),
];

/// The usual mistakes, the most frequent ones first; of those of single poses only what the dataset allows to tell.
pub(super) fn mistakes(sequence: &Sequence) -> Vec<Mistake> {
    let poses: Vec<Option<Isometry3<f64>>> = (sequence.frames.iter())
        .map(|frame| frame.world_from_camera)
        .collect();
    let has_poses = poses.iter().any(Option::is_some);
    let each = |change: fn(&Isometry3<f64>) -> Isometry3<f64>| {
        Poses::Frames(poses.iter().map(|pose| pose.as_ref().map(change)).collect())
    };
    let mut all = Vec::new();
    if has_poses {
        all.push(Mistake::new(
            "the poses are camera-from-world",
            "matchbench reads world-from-camera: invert each pose",
            each(Isometry3::inverse),
        ));
    }
    all.push(Mistake::new(
        "the pose of each pair leads from its second image to its first",
        "pairs.txt takes x_b = R x_a + t: invert each pose there, or exchange the two images",
        Poses::Backwards,
    ));
    all.extend(axes(|| Poses::Given, ["", ""]));
    if has_poses {
        all.extend(of_frames(&each));
        all.extend(axes(
            || each(Isometry3::inverse),
            [
                "the poses are camera-from-world, and ",
                "invert each pose, then ",
            ],
        ));
        all.extend(in_another_order(sequence, &poses));
    }
    all
}

/// Poses of cameras with other axes; `first` is what else is wrong with them, and how that is corrected.
fn axes(poses: impl Fn() -> Poses, first: [&str; 2]) -> Vec<Mistake> {
    (AXES.iter())
        .map(|(name, remedy, rows)| Mistake {
            axes: Matrix3::from_row_slice(rows),
            ..Mistake::new(
                format!("{}the axes of the cameras are {name}", first[0]),
                format!("{}{remedy}", first[1]),
                poses(),
            )
        })
        .collect()
}

/// What can be wrong with each single pose besides its direction.
fn of_frames(each: &impl Fn(fn(&Isometry3<f64>) -> Isometry3<f64>) -> Poses) -> Vec<Mistake> {
    let numbers = "matchbench reads qx qy qz qw: write the numbers in this order";
    let halves = "invert the rotation, so that each pose is world-from-camera as a whole";
    let centre =
        "give the place of the camera, -R^T t, so that each pose is world-from-camera as a whole";
    vec![
        Mistake::new("the quaternions have w first", numbers, each(with_w_first)),
        Mistake::new(
            "the quaternions have w last and were read with w first",
            numbers,
            each(with_w_last),
        ),
        Mistake::new(
            "the quaternions have w first and the poses are camera-from-world",
            "matchbench reads world-from-camera and qx qy qz qw: correct both",
            each(|pose| with_w_first(pose).inverse()),
        ),
        Mistake::new(
            "the rotations are camera-from-world, and the translations are the places of the cameras",
            halves,
            each(|pose| Isometry3::from_parts(pose.translation, pose.rotation.inverse())),
        ),
        Mistake::new(
            "the rotations are world-from-camera, but the translations are those of camera-from-world",
            centre,
            each(|pose| {
                let place = pose.rotation * -pose.translation.vector;
                Isometry3::from_parts(Translation3::from(place), pose.rotation)
            }),
        ),
    ]
}

/// A pose whose quaternion `w x y z` was read as `x y z w`.
fn with_w_first(read: &Isometry3<f64>) -> Isometry3<f64> {
    let q = read.rotation.coords;
    with_quaternion(read, q.x, Vector3::new(q.y, q.z, q.w))
}

/// A pose whose quaternion `x y z w` was read as `w x y z`.
fn with_w_last(read: &Isometry3<f64>) -> Isometry3<f64> {
    let q = read.rotation.coords;
    with_quaternion(read, q.z, Vector3::new(q.w, q.x, q.y))
}

fn with_quaternion(pose: &Isometry3<f64>, w: f64, xyz: Vector3<f64>) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::from_parts(w, xyz));
    Isometry3::from_parts(pose.translation, rotation)
}

/// Poses that belong to other images than they stand for.
fn in_another_order(sequence: &Sequence, poses: &[Option<Isometry3<f64>>]) -> Vec<Mistake> {
    let count = poses.len();
    let from = |places: Vec<Option<usize>>| {
        let pose = |place: Option<usize>| *poses.get(place?)?;
        Poses::Frames(places.into_iter().map(pose).collect())
    };
    let lines = "look for a line that is missing or too much";
    let mut all = vec![
        Mistake::new(
            "each pose is that of the image after its own",
            lines,
            from((0..count).map(|frame| frame.checked_sub(1)).collect()),
        ),
        Mistake::new(
            "each pose is that of the image before its own",
            lines,
            from((0..count).map(|frame| Some(frame + 1)).collect()),
        ),
    ];
    let mut names: Vec<(&Path, usize)> = (sequence.frames.iter().enumerate())
        .map(|(frame, of)| (of.image.as_path(), frame))
        .collect();
    names.sort_unstable();
    let place: BTreeMap<usize, usize> = (names.iter().enumerate())
        .map(|(place, &(_, frame))| (frame, place))
        .collect();
    if place.iter().any(|(frame, place)| frame != place) {
        all.push(Mistake::new(
            "the poses are in the order of the alphabet, 1, 10, 2",
            "matchbench takes images in the order 1, 2, 10: write the poses in this order",
            from(place.into_values().map(Some).collect()),
        ));
    }
    all
}
