//! Camera trajectories as text: TUM's (`time tx ty tz qx qy qz qw`) and KITTI's (12 numbers, the
//! row-major [R t]). Both are camera-to-world.

use nalgebra::Isometry3;

use super::DatasetError;
use super::text::{self, TextFile};

/// A pose and the time when the camera was there, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TimedPose {
    pub(super) time: f64,
    pub(super) world_from_camera: Isometry3<f64>,
}

/// How the pose of an image is found by time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Association {
    /// Largest difference in time between an image and its pose, in seconds. The default, 0.02, is that of
    /// TUM's own tool.
    pub tolerance: f64,
    /// Interpolate between the poses before and after the image (both within the tolerance)
    /// instead of taking the nearest one. The authors of the benchmark took the nearest.
    pub interpolate: bool,
}

impl Default for Association {
    fn default() -> Self {
        Self {
            tolerance: 0.02,
            interpolate: false,
        }
    }
}

impl Association {
    /// The pose at `time` from a `trajectory` that is sorted by time.
    pub(super) fn pose_at(&self, trajectory: &[TimedPose], time: f64) -> Option<Isometry3<f64>> {
        if !self.interpolate {
            let pose = self.nearest(trajectory, |pose| pose.time, time)?;
            return Some(pose.world_from_camera);
        }
        let [previous, next] = self.around(trajectory, |pose| pose.time, time);
        let next = next?;
        if next.time == time {
            return Some(next.world_from_camera);
        }
        let previous = previous?;
        let share = (time - previous.time) / (next.time - previous.time);
        (previous.world_from_camera).try_lerp_slerp(&next.world_from_camera, share, 1e-9)
    }

    /// The entry of `timed`, sorted by time, that is nearest to `time`; of two equally near, the earlier.
    pub(super) fn nearest<'a, T>(
        &self,
        timed: &'a [T],
        time_of: impl Fn(&T) -> f64,
        time: f64,
    ) -> Option<&'a T> {
        match self.around(timed, &time_of, time) {
            [Some(previous), Some(next)] if time_of(next) - time < time - time_of(previous) => {
                Some(next)
            }
            [previous, next] => previous.or(next),
        }
    }

    /// The last entry before `time` and the first at or after it, if they are within the tolerance.
    fn around<'a, T>(
        &self,
        timed: &'a [T],
        time_of: impl Fn(&T) -> f64,
        time: f64,
    ) -> [Option<&'a T>; 2] {
        let after = timed.partition_point(|it| time_of(it) < time);
        let previous = after.checked_sub(1).map(|before| &timed[before]);
        let within = |it: &&T| (time_of(it) - time).abs() <= self.tolerance;
        [previous.filter(within), timed.get(after).filter(within)]
    }
}

/// What has times, in the order of these; what has the same stays as it is.
pub(super) fn in_order_of_time<T>(mut timed: Vec<(f64, T)>) -> impl Iterator<Item = T> {
    timed.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    timed.into_iter().map(|(_, it)| it)
}

/// Reads a trajectory in TUM's format, sorted by time.
pub(super) fn parse_tum(file: &TextFile) -> Result<Vec<TimedPose>, DatasetError> {
    let mut poses = parse_tum_lines(file)?;
    poses.sort_by(|p, q| p.time.total_cmp(&q.time));
    Ok(poses)
}

/// Reads poses in TUM's format, in the order of their lines.
pub(super) fn parse_tum_lines(file: &TextFile) -> Result<Vec<TimedPose>, DatasetError> {
    file.rows()
        .map(|(line, row)| {
            text::exactly(row)
                .and_then(|[time, x, y, z, qx, qy, qz, qw]| {
                    Ok(TimedPose {
                        time,
                        world_from_camera: text::quaternion_motion([x, y, z], [qx, qy, qz, qw])
                            .map_err(|what| format!("{what} (order: tx ty tz qx qy qz qw)"))?,
                    })
                })
                .map_err(|what| file.error_at(line, what))
        })
        .collect()
}

/// Reads a trajectory in KITTI's format.
pub(super) fn parse_kitti(file: &TextFile) -> Result<Vec<Isometry3<f64>>, DatasetError> {
    parse_matrices(file, text::rigid_motion)
}

/// Reads poses as 16 numbers per line, the row-major 4x4 matrix.
pub(super) fn parse_4x4(file: &TextFile) -> Result<Vec<Isometry3<f64>>, DatasetError> {
    parse_matrices(file, text::rigid_motion_4x4)
}

fn parse_matrices<const N: usize>(
    file: &TextFile,
    motion: fn(&[f64; N]) -> Result<Isometry3<f64>, String>,
) -> Result<Vec<Isometry3<f64>>, DatasetError> {
    file.rows()
        .map(|(line, row)| {
            text::exactly(row)
                .and_then(|numbers| motion(&numbers))
                .map_err(|what| file.error_at(line, what))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    fn file(text: &str) -> TextFile {
        TextFile::new(Path::new("poses.txt"), text)
    }

    /// Poses at 0, 1 and 3 seconds, x equal to the time, turning by 0.1 rad per second.
    fn trajectory() -> Vec<TimedPose> {
        [0.0, 1.0, 3.0]
            .map(|time| TimedPose {
                time,
                world_from_camera: Isometry3::new(
                    Vector3::new(time, 0.0, 0.0),
                    Vector3::new(0.0, 0.1 * time, 0.0),
                ),
            })
            .to_vec()
    }

    #[test]
    fn the_nearest_pose_within_the_tolerance_is_taken() {
        let x = |time: f64| {
            Association {
                tolerance: 0.6,
                interpolate: false,
            }
            .pose_at(&trajectory(), time)
            .map(|pose| pose.translation.x)
        };
        assert_eq!(x(0.4), Some(0.0));
        assert_eq!(x(0.6), Some(1.0));
        assert_eq!(x(0.5), Some(0.0), "the earlier of two equally near");
        assert_eq!(x(-0.6), Some(0.0));
        assert_eq!(x(2.0), None);
        assert_eq!(x(3.7), None);
        assert_eq!(x(f64::NAN), None);
        // Between 1 and 3, both within the tolerance.
        let wide = Association {
            tolerance: 1.6,
            interpolate: false,
        };
        let of = |time| {
            wide.pose_at(&trajectory(), time)
                .map(|pose| pose.translation.x)
        };
        assert_eq!([of(1.9), of(2.1)], [Some(1.0), Some(3.0)]);
        assert_eq!(Association::default().pose_at(&[], 1.0), None);
    }

    /// 0.02 s as in TUM's own tool, and the nearest, as the authors took it.
    #[test]
    fn an_image_takes_the_nearest_pose_within_two_hundredths_unless_told_otherwise() {
        let x = |time: f64| {
            let pose = Association::default().pose_at(&trajectory(), time);
            pose.map(|pose| pose.translation.x)
        };
        assert_eq!([x(1.019), x(0.981)], [Some(1.0); 2]);
        assert_eq!([x(1.021), x(0.979)], [None; 2]);
    }

    #[test]
    fn interpolation_lies_between_and_does_not_extrapolate() {
        let rule = Association {
            tolerance: 1.5,
            interpolate: true,
        };
        let pose = rule.pose_at(&trajectory(), 2.5).unwrap();
        assert!((pose.translation.x - 2.5).abs() < 1e-12);
        assert!((pose.rotation.angle() - 0.25).abs() < 1e-12);
        assert_eq!(
            rule.pose_at(&trajectory(), 1.0),
            Some(trajectory()[1].world_from_camera)
        );
        assert_eq!(rule.pose_at(&trajectory(), 3.1), None);
        assert_eq!(rule.pose_at(&trajectory(), -0.1), None);
    }

    #[test]
    fn tum_is_sorted_and_wrong_lines_are_named() {
        let poses = parse_tum(&file("# c\n2 0 0 0 0 0 0 1\n1 5 0 0 0 0 0 1\n")).unwrap();
        assert_eq!(poses.iter().map(|p| p.time).collect::<Vec<_>>(), [1.0, 2.0]);
        for (text, line) in [
            ("1 0 0 0 0 0 0 0", 1),
            ("\n1 0 0 0 0 0 0 1\n1 0 0", 3),
            ("1 0 0 0 0 nan 0 1", 1),
        ] {
            assert_eq!(parse_tum(&file(text)).unwrap_err().line, Some(line));
        }
        let error = parse_kitti(&file("1 0 0 0 0 1 0 0 0 0 2 0")).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("poses.txt:1: the 3x3 block is not")
        );
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "([-0-9.e]{1,4}[ \n]){0,30}|.{0,60}") {
            let _ = parse_tum(&file(&text));
            let _ = parse_kitti(&file(&text));
        }
    }
}
