//! Reads text files of numbers as they occur in practice: irregular spaces, CRLF, a byte order mark, blank
//! lines, `#` comments, no final newline.
//!
//! Rotations are often printed with few digits. So a 3x3 block is accepted as a rotation if no entry of
//! `R^T R - I` exceeds [`ORTHOGONALITY_TOLERANCE`], and is replaced by the nearest rotation.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::DatasetError;
use crate::counted::counted;
use crate::files::{LONGEST_LINE, LineError, read_lines};

/// Largest entry of `R^T R - I` in a printed rotation, and largest deviation of the length of a printed quaternion from
/// one. Rounding to three decimals changes an entry by at most `sqrt(3) 1e-3`. A scaled or mistyped block changes it by
/// more; a transposed one does not, since it is a rotation too (see `pair_poses`).
pub(super) const ORTHOGONALITY_TOLERANCE: f64 = 1.8e-3;

/// A text file in memory, with its name for error messages.
#[derive(Debug)]
pub(super) struct TextFile {
    pub(super) path: PathBuf,
    text: String,
}

impl TextFile {
    pub(super) fn read(path: &Path) -> Result<Self, DatasetError> {
        Self::with_lines_of(path, LONGEST_LINE)
    }

    /// A file whose lines may have so many bytes.
    pub(super) fn with_lines_of(path: &Path, longest: usize) -> Result<Self, DatasetError> {
        let bytes = read_lines(path, longest).map_err(|error| unreadable(path, error))?;
        Ok(Self::new(path, &String::from_utf8_lossy(&bytes)))
    }

    pub(super) fn new(path: &Path, text: &str) -> Self {
        Self {
            path: path.to_owned(),
            text: text.strip_prefix('\u{feff}').unwrap_or(text).to_owned(),
        }
    }

    /// The same with blanks for commas, for files of numbers that may be separated by either.
    pub(super) fn without_commas(self) -> Self {
        Self {
            text: self.text.replace(',', " "),
            ..self
        }
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Lines that are not empty, trimmed, with their numbers (from 1).
    pub(super) fn rows(&self) -> impl Iterator<Item = (usize, &str)> {
        (self.text.lines().zip(1..)).filter_map(|(text, line)| Some((line, row(text)?)))
    }

    /// All numbers of the file, however they are broken into lines.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, DatasetError> {
        let mut all = Vec::new();
        for (line, row) in self.rows() {
            all.extend(numbers(row).map_err(|what| self.error_at(line, what))?);
        }
        Ok(all)
    }

    /// An error about this file as a whole.
    pub(super) fn error(&self, what: impl Into<String>, remedy: impl Into<String>) -> DatasetError {
        DatasetError::new(&self.path, what, remedy)
    }

    /// An error in one line; its remedy is to correct that line.
    pub(super) fn error_at(&self, line: usize, what: impl Into<String>) -> DatasetError {
        error_at(&self.path, line, what)
    }
}

/// An error in one line of the file at `path`; its remedy is to correct that line.
pub(super) fn error_at(path: &Path, line: usize, what: impl Into<String>) -> DatasetError {
    DatasetError::new(path, what, "correct this line or take it out").at(line)
}

/// The lines of the file at `path` cannot be read.
pub(super) fn unreadable(path: &Path, error: LineError) -> DatasetError {
    match error {
        LineError::Io(error) => DatasetError::io(path, &error),
        LineError::TooLong { line, what } => error_at(path, line, what),
    }
}

/// The content of a line, if it is neither white space nor a comment.
pub(super) fn row(line: &str) -> Option<&str> {
    let row = line.trim();
    (!row.is_empty() && !row.starts_with('#')).then_some(row)
}

/// The finite numbers of a row.
pub(super) fn numbers(row: &str) -> Result<Vec<f64>, String> {
    row.split_whitespace()
        .enumerate()
        .map(|(column, word)| {
            let column = column + 1;
            let shown = brief(word);
            match word.parse::<f64>() {
                Ok(number) if number.is_finite() => Ok(number),
                Ok(_) => Err(format!("column {column} is {shown}, not a finite number")),
                Err(_) => Err(format!("column {column} is `{shown}`, not a number")),
            }
        })
        .collect()
}

/// A word of a file as a message shows it, shortened if it is long.
pub(super) fn brief(word: &str) -> String {
    /// In characters.
    const MOST: usize = 60;
    match word.char_indices().nth(MOST) {
        None => word.to_owned(),
        Some((end, _)) => format!("{}... ({} bytes)", &word[..end], word.len()),
    }
}

/// Exactly `N` numbers of a row.
pub(super) fn exactly<const N: usize>(row: &str) -> Result<[f64; N], String> {
    let columns = row.split_whitespace().count();
    if columns != N {
        return Err(format!(
            "{} where {N} are expected",
            counted(columns, "column")
        ));
    }
    Ok(numbers(row)?
        .try_into()
        .expect("the number of columns was checked"))
}

/// Largest coordinate of a translation, in any unit. Beyond it, squares would not be finite.
const MAX_COORDINATE: f64 = 1e150;

fn translation(xyz: [f64; 3]) -> Result<Translation3<f64>, String> {
    match xyz
        .iter()
        .find(|x| !x.is_finite() || x.abs() > MAX_COORDINATE)
    {
        Some(x) => Err(format!(
            "the translation has the coordinate {x:e}, beyond {MAX_COORDINATE:e}"
        )),
        None => Ok(Translation3::from(Vector3::from(xyz))),
    }
}

/// A row-major 3x4 matrix [R t] as a rigid motion.
pub(super) fn rigid_motion(m: &[f64; 12]) -> Result<Isometry3<f64>, String> {
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    Ok(Isometry3::from_parts(
        translation([m[3], m[7], m[11]])?,
        nearest_rotation(&rotation)?,
    ))
}

/// A row-major 4x4 matrix [R t; 0 0 0 1] as a rigid motion. R may be rounded; the nearest rotation is taken.
///
/// # Errors
/// If it is none, in words.
pub fn rigid_motion_4x4(m: &[f64; 16]) -> Result<Isometry3<f64>, String> {
    let (motion, last) = m.split_at(12);
    if last != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!("the last row of the pose is {last:?}, not 0 0 0 1"));
    }
    rigid_motion(motion.try_into().expect("12 of 16 numbers"))
}

/// The rigid motion of 12 or 16 numbers: the rows of `[R t]`, or of the 4x4 matrix.
pub(super) fn rigid_motion_of(numbers: &[f64]) -> Result<Isometry3<f64>, String> {
    match numbers.len() {
        12 => rigid_motion(numbers.try_into().expect("12 numbers")),
        16 => rigid_motion_4x4(numbers.try_into().expect("16 numbers")),
        count => Err(counted(count, "number")),
    }
}

/// Nine numbers, row by row, as a homography; its scale is free.
pub(super) fn homography(numbers: &[f64]) -> Result<Matrix3<f64>, String> {
    let found = numbers.len();
    let matrix = match numbers.len() {
        9 => Matrix3::from_row_slice(numbers),
        _ => {
            return Err(format!(
                "{} where the 9 of a homography are expected",
                counted(found, "number")
            ));
        }
    };
    let largest = matrix.amax();
    if !largest.is_finite() || largest == 0.0 {
        return Err("the homography is zero or not finite".to_owned());
    }
    // Pixel coordinates are in the thousands, so a valid homography may have a small determinant. But it cannot
    // be so small that it is lost in the rounding of the entries.
    let determinant = (matrix / largest).determinant();
    if determinant.is_nan() || determinant.abs() < 1e-16 {
        return Err(format!(
            "the homography is singular: its determinant is {determinant:.1e} of its largest entry's cube"
        ));
    }
    Ok(matrix)
}

/// The row-major 3x4 matrix [R t] of a rigid motion.
pub(super) fn matrix_rows(motion: &Isometry3<f64>) -> [f64; 12] {
    let m = motion.to_homogeneous();
    std::array::from_fn(|k| m[(k / 4, k % 4)])
}

/// The rotation nearest to a printed one. It is the orthogonal polar factor, by Newton's iteration (Higham,
/// "Computing the Polar Decomposition - with Applications", SIAM J. Sci. Stat. Comput. 7(4), 1986). It equals
/// `U V^T` of the SVD, and needs only the four operations.
pub(super) fn nearest_rotation(printed: &Matrix3<f64>) -> Result<UnitQuaternion<f64>, String> {
    let deviation = printed.transpose() * printed - Matrix3::identity();
    // Written this way so that NaN is refused too.
    if !deviation.iter().all(|x| x.abs() <= ORTHOGONALITY_TOLERANCE) {
        return Err(format!(
            "the 3x3 block is not a rotation: R^T R differs from the identity by {:.1e} \
             (at most {ORTHOGONALITY_TOLERANCE:.1e} is accepted)",
            deviation.amax()
        ));
    }
    if printed.determinant() < 0.0 {
        return Err("the 3x3 block is a reflection (determinant -1), not a rotation".to_owned());
    }
    let mut r = *printed;
    for _ in 0..4 {
        // Convergence is quadratic: 2e-3, 1e-6, 1e-12, full precision; one step is added.
        let inverse = r
            .try_inverse()
            .expect("a nearly orthogonal matrix has an inverse");
        r = (r + inverse.transpose()) * 0.5;
    }
    Ok(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix_unchecked(r),
    ))
}

/// A printed quaternion (x, y, z, w) and translation as a rigid motion.
pub(super) fn quaternion_motion(
    xyz: [f64; 3],
    [x, y, z, w]: [f64; 4],
) -> Result<Isometry3<f64>, String> {
    let quaternion = nalgebra::Quaternion::new(w, x, y, z);
    let length = quaternion.norm();
    if length.is_nan() || (length - 1.0).abs() > ORTHOGONALITY_TOLERANCE {
        return Err(format!("the quaternion has length {length:.4}, not 1"));
    }
    Ok(Isometry3::from_parts(
        translation(xyz)?,
        UnitQuaternion::from_quaternion(quaternion),
    ))
}

#[cfg(test)]
mod tests {
    use matchbench_vision::seed::Seed;

    use super::*;

    #[test]
    fn every_rotation_of_three_decimals_is_read_and_a_scaled_one_is_not() {
        let mut rng = Seed(3).rng();
        for _ in 0..2000 {
            let angles = [(); 3].map(|()| 6.0 * rng.uniform());
            let exact = Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
            let printed = exact.matrix().map(|entry| (entry * 1e3).round() / 1e3);
            let read = nearest_rotation(&printed).expect("three decimals are enough");
            let off = read.angle_to(&exact.into());
            assert!(off < 1e-3, "{off} radians");
            assert!(nearest_rotation(&(printed * 1.002)).is_err());
        }
    }

    #[test]
    fn text_in_utf_16_is_to_be_saved_as_another() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let little: Vec<u8> = "\u{feff}0 1\r\n"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        let big: Vec<u8> = "\u{feff}0 1"
            .encode_utf16()
            .flat_map(u16::to_be_bytes)
            .collect();
        for text in [little, big] {
            std::fs::write(file.path(), text).unwrap();
            let error = TextFile::read(file.path()).unwrap_err();
            assert_eq!(error.what, "text in UTF-16, not in UTF-8");
            assert_eq!(error.remedy, "save it as text in UTF-8");
        }
    }

    #[test]
    fn irregular_text_is_read() {
        let file = TextFile::new(
            Path::new("t"),
            "\u{feff}1   2\t3 \r\n\r\n  # no\n4 5 6   \n7 8 9",
        );
        let rows: Vec<_> = file.rows().collect();
        assert_eq!(rows, [(1, "1   2\t3"), (4, "4 5 6"), (5, "7 8 9")]);
        assert_eq!(
            file.numbers().unwrap(),
            [1., 2., 3., 4., 5., 6., 7., 8., 9.]
        );
    }

    #[cfg(unix)] // holes of files take no room
    #[test]
    fn a_line_without_an_end_is_named_before_the_rest_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.txt");
        std::fs::write(&path, "# poses\n1 2 3\n").unwrap();
        // A hole of 3 GiB: to read all of it takes seconds.
        let file = std::fs::OpenOptions::new()
            .append(true)
            .open(&path)
            .unwrap();
        file.set_len(3 << 30).unwrap();
        let error = TextFile::read(&path).unwrap_err().to_string();
        assert!(
            error.ends_with(
                "poses.txt:3: the line has more than 1048576 bytes; correct this line or take it out"
            ),
            "{error}"
        );
    }

    #[test]
    fn what_is_no_number_is_named_by_its_column() {
        assert!(numbers("1 nan").unwrap_err().contains("column 2 is nan"));
        assert!(numbers("1 2,5").unwrap_err().contains("column 2 is `2,5`"));
        assert!(exactly::<3>("1 2").unwrap_err().contains("2 columns"));
    }

    #[test]
    fn the_nearest_rotation_is_that_of_the_svd() {
        let rotation = Rotation3::from_euler_angles(0.3, -1.2, 2.0);
        let printed = rotation.matrix().map(|x: f64| (x * 1e4).round() / 1e4);
        let nearest = nearest_rotation(&printed).unwrap().to_rotation_matrix();
        let svd = printed.svd(true, true);
        let expected = svd.u.unwrap() * svd.v_t.unwrap();
        assert!((nearest.matrix() - expected).amax() < 1e-12);
        assert!((nearest.matrix() - rotation.matrix()).amax() < 1e-4);
    }

    #[test]
    fn scaled_mirrored_and_empty_blocks_are_no_rotations() {
        let eye = Matrix3::identity();
        assert!(nearest_rotation(&eye).is_ok());
        for (wrong, word) in [
            (eye * 1.01, "not a rotation"),
            (-eye, "reflection"),
            (eye * 0.0, "not a rotation"),
            (eye * f64::NAN, "not a rotation"),
            (eye * 1e200, "not a rotation"),
        ] {
            assert!(nearest_rotation(&wrong).unwrap_err().contains(word));
        }
    }

    #[test]
    fn translations_whose_length_overflows_are_refused() {
        let pose = |x: f64| rigid_motion(&[1., 0., 0., x, 0., 1., 0., 0., 0., 0., 1., 0.]);
        assert!(pose(1e150).is_ok());
        for x in [1e151, -1e308, f64::NAN, f64::INFINITY] {
            assert!(pose(x).unwrap_err().contains("coordinate"));
        }
        assert!(quaternion_motion([0.0, 1e308, 0.0], [0.0, 0.0, 0.0, 1.0]).is_err());
    }

    #[test]
    fn singular_homographies_are_refused() {
        let large = [
            8.5e-1, 2.1e-1, 9.9e3, -2.1e-1, 8.5e-1, 1.3e4, 2e-6, 1e-6, 1.0,
        ];
        assert!(homography(&large).is_ok());
        assert!(homography(&[0.0; 9]).is_err());
        assert!(homography(&[1.0; 9]).is_err());
        assert!(homography(&[1.0; 8]).is_err());
        assert!(homography(&[f64::NAN; 9]).is_err());
    }

    #[test]
    fn a_quaternion_that_is_none_is_refused() {
        assert!(quaternion_motion([0.0; 3], [0.0; 4]).is_err());
        assert!(quaternion_motion([1e200, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]).is_err());
        assert!(quaternion_motion([0.0; 3], [0.0003, 0.8617, -0.5072, -0.0145]).is_ok());
    }
}
