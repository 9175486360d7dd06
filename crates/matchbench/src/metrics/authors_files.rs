//! The authors' text files: true poses (`pairs.txt`) and results (`<matcher>.txt`).

use std::path::Path;

use matchbench_vision::geometry::RelativePose;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};

use super::ResultsError;
use super::results::read;

/// How far the rows of a printed rotation may be from orthonormal. The authors' six digits stay
/// below 1e-5; two digits are still a rotation, anything worse is a mix-up of columns.
const ROTATION_TOLERANCE: f64 = 0.02;

/// A pair and the truth about it.
pub(super) struct ListedPair {
    pub(super) line: usize,
    pub(super) a: u32,
    pub(super) b: u32,
    pub(super) rotation: UnitQuaternion<f64>,
    /// `None` where the true translation is zero.
    pub(super) pose: Option<RelativePose>,
}

/// What a matcher came to on one pair.
pub(super) struct ResultRow {
    pub(super) line: usize,
    pub(super) a: u32,
    pub(super) b: u32,
    pub(super) count: u32,
    /// `None` where the row says that there is none: a zero translation.
    pub(super) pose: Option<RelativePose>,
}

/// Reads `a b` and a 3x4 pose from each line.
pub(super) fn read_pairs(file: &Path) -> Result<Vec<ListedPair>, ResultsError> {
    read_lines(file, 14, |line, fields| {
        let pose = isometry(&numbers(&fields[2..])?)?;
        Ok(ListedPair {
            line,
            a: index(fields[0])?,
            b: index(fields[1])?,
            rotation: pose.rotation,
            pose: RelativePose::from_isometry(&pose),
        })
    })
}

/// Reads `a b count` and a 3x4 pose from each line.
pub(super) fn read_results(file: &Path) -> Result<Vec<ResultRow>, ResultsError> {
    read_lines(file, 15, |line, fields| {
        let numbers = numbers(&fields[3..])?;
        let has_pose = [numbers[3], numbers[7], numbers[11]] != [0.0; 3];
        Ok(ResultRow {
            line,
            a: index(fields[0])?,
            b: index(fields[1])?,
            count: index(fields[2])?,
            pose: if has_pose {
                RelativePose::from_isometry(&isometry(&numbers)?)
            } else {
                None
            },
        })
    })
}

/// Applies `parse` to the fields of each line that is not blank.
fn read_lines<T>(
    file: &Path,
    width: usize,
    parse: impl Fn(usize, &[&str]) -> Result<T, String>,
) -> Result<Vec<T>, ResultsError> {
    let text = read(file)?;
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let fields: Vec<&str> = line.split_whitespace().collect();
        if fields.is_empty() {
            continue;
        }
        let row = if fields.len() == width {
            parse(i + 1, &fields)
        } else {
            Err(format!(
                "{} fields instead of {width}: {} and a 3x4 pose",
                fields.len(),
                if width == 14 { "a b" } else { "a b count" }
            ))
        };
        rows.push(row.map_err(|problem| ResultsError::Line {
            path: file.to_path_buf(),
            line: i + 1,
            problem,
        })?);
    }
    Ok(rows)
}

fn index(field: &str) -> Result<u32, String> {
    (field.parse()).map_err(|_| format!("'{field}' is not a whole number from 0 up"))
}

/// The twelve numbers of a 3x4 pose.
fn numbers(fields: &[&str]) -> Result<[f64; 12], String> {
    let mut numbers = [0.0; 12];
    for (number, field) in numbers.iter_mut().zip(fields) {
        *number = (field.parse().ok())
            .filter(|number: &f64| number.is_finite())
            .ok_or_else(|| {
                format!("'{field}' is not a finite number; no pose is a zero translation")
            })?;
    }
    Ok(numbers)
}

/// The pose `[R | t]`, given row after row.
fn isometry(pose: &[f64; 12]) -> Result<Isometry3<f64>, String> {
    let rotation = Matrix3::new(
        pose[0], pose[1], pose[2], pose[4], pose[5], pose[6], pose[8], pose[9], pose[10],
    );
    let deviation = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    if deviation > ROTATION_TOLERANCE || rotation.determinant() < 0.0 {
        return Err(format!(
            "not a rotation (R R^T is off by {deviation:.2}, the determinant is {:.2}); \
             the pose is [R | t], row after row",
            rotation.determinant()
        ));
    }
    // Printed digits make the matrix a rotation only nearly; the quaternion is normalised again.
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Ok(Isometry3::from_parts(
        Translation3::new(pose[3], pose[7], pose[11]),
        UnitQuaternion::new_normalize(rotation.into_inner()),
    ))
}
