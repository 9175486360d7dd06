//! The true poses and homographies of pairs alone, for scoring results without images.

use std::path::Path;

use super::listed::{Listed, each_pair, has_one_twice, listed, parse_pose};
use super::native::{HOMOGRAPHIES, PAIRS};
use super::problem::first_error;
use super::text::{self, TextFile};
use super::{DatasetError, Pair};
use crate::counted::counted;

/// Reads a `pairs.txt`: only the ground truth, for scoring without images.
///
/// # Errors
/// If the file cannot be read or a line is invalid.
pub fn read_pairs(file: &Path) -> Result<Vec<Pair>, DatasetError> {
    let mut problems = Vec::new();
    let listed = listed(file, None, parse_pose, &mut problems);
    first_error(problems)?;
    let pair = |row: Listed<_>| Pair::with_pose(row.a, row.b, row.truth);
    Ok(listed.into_iter().map(pair).collect())
}

/// Reads the pairs of the dataset in the folder `dir` from its `pairs.txt` and `homographies.txt`, of which one may be
/// missing: only the ground truth, for scoring without images.
///
/// # Errors
/// If a file cannot be read or a line is invalid, or if there is neither.
pub fn read_dataset_pairs(dir: &Path) -> Result<Vec<Pair>, DatasetError> {
    let (poses, homographies) = (dir.join(PAIRS), dir.join(HOMOGRAPHIES));
    let mut pairs = Vec::new();
    // Without images it is not known how many frames there are.
    let most = u32::MAX as usize;
    each_pair(&poses, &homographies, most, |pair| {
        pairs.push(pair);
    })?;
    if has_one_twice(&pairs) {
        // The list of poses: that of homographies was checked as it was read. This knows the lines.
        read_pairs(&poses)?;
    }
    Ok(pairs)
}

/// Reads the true poses of `pairs` from a file with one row of 12 numbers for each pair, in their order.
///
/// # Errors
/// If the file cannot be read, a line is invalid, or the number of rows differs from that of the pairs.
pub fn read_poses_of_pairs(file: &Path, pairs: &[(u32, u32)]) -> Result<Vec<Pair>, DatasetError> {
    let file = TextFile::read(file)?;
    let rows = file.rows().count();
    if rows != pairs.len() {
        return Err(file.error(
            format!(
                "{} for {}",
                counted(rows, "pose"),
                counted(pairs.len(), "pair")
            ),
            "give one row for each pair, in the order of the results; or begin each row with `a b`",
        ));
    }
    (file.rows().zip(pairs))
        .map(|((line, row), &(a, b))| {
            let pose = text::exactly(row).and_then(|numbers| text::rigid_motion(&numbers));
            let b_from_a = pose.map_err(|what| file.error_at(line, what))?;
            Ok(Pair::with_pose(a, b, b_from_a))
        })
        .collect()
}
