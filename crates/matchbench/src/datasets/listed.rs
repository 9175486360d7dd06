//! Reads the lists of pairs of a dataset, `pairs.txt` and `homographies.txt`, row by row, since they may be
//! larger than memory.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::io::Read;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3};

use super::pair_list::pair_indices;
use super::text;
use super::{DatasetError, Pair, Problem, Truth};
use crate::files::{LONGEST_LINE, LineBlock, LineBlocks, open_file};

/// A pair as a file lists it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Listed<T> {
    pub(super) line: usize,
    pub(super) a: u32,
    pub(super) b: u32,
    pub(super) truth: T,
}

/// Whether something exists at `path`; a broken link counts as something.
pub(super) fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// Passes on the pairs of both lists. First come the pairs with poses, each with its homography if it has one
/// too, then the pairs that have only a homography. Only homographies are kept in memory. The file of `poses`
/// may be missing if there are `homographies`.
///
/// # Errors
/// The first problem.
pub(super) fn each_pair(
    poses: &Path,
    homographies: &Path,
    frames: usize,
    mut see: impl FnMut(Pair),
) -> Result<(), DatasetError> {
    let (mut problems, mut mapped) = (Vec::new(), Vec::new());
    if is_there(homographies) {
        mapped = listed(homographies, Some(frames), parse_homography, &mut problems);
    }
    if let Some(problem) = problems.into_iter().next() {
        return Err(problem.error);
    }
    let mut left: BTreeMap<(u32, u32), Matrix3<f64>> = (mapped.iter())
        .map(|row| ((row.a, row.b), row.truth))
        .collect();
    if is_there(poses) || mapped.is_empty() {
        each_listed(poses, Some(frames), parse_pose, |row| {
            let Listed { a, b, truth, .. } = row?;
            let truth = match left.remove(&(a, b)) {
                None => Truth::Pose(truth),
                Some(homography) => Truth::Both {
                    b_from_a: truth,
                    homography,
                },
            };
            see(Pair { a, b, truth });
            Ok(())
        })?;
    }
    for row in mapped {
        if let Some(homography) = left.get(&(row.a, row.b)) {
            see(Pair::with_homography(row.a, row.b, *homography));
        }
    }
    Ok(())
}

/// Whether a pair is twice in a list.
pub(super) fn has_one_twice(pairs: &[Pair]) -> bool {
    let frames = |pair: &Pair| (pair.a, pair.b);
    // As is the case for nearly every list.
    if pairs.is_sorted_by(|one, next| frames(one) < frames(next)) {
        return false;
    }
    let mut sorted: Vec<(u32, u32)> = pairs.iter().map(frames).collect();
    sorted.sort_unstable();
    sorted.windows(2).any(|two| two[0] == two[1])
}

/// All rows of a list; `parse` reads the truth from a whole row. Problems are added to `problems`.
pub(super) fn listed<T: Send>(
    path: &Path,
    frames: Option<usize>,
    parse: fn(&str) -> Result<T, String>,
    problems: &mut Vec<Problem>,
) -> Vec<Listed<T>> {
    let mut first_line = BTreeMap::new();
    let mut pairs = Vec::new();
    let read = each_listed(path, frames, parse, |row| {
        match row {
            Err(error) => problems.push(error.into()),
            Ok(pair) => match first_line.entry((pair.a, pair.b)) {
                Entry::Occupied(first) => {
                    let (a, b, first) = (pair.a, pair.b, first.get());
                    let what = format!("the pair {a} {b} stands in line {first} already");
                    problems.push(text::error_at(path, pair.line, what).into());
                }
                Entry::Vacant(place) => {
                    place.insert(pair.line);
                    pairs.push(pair);
                }
            },
        }
        Ok(())
    });
    problems.extend(read.err().map(Problem::from));
    pairs
}

/// Passes on every row of a list, or what is wrong with it.
fn each_listed<T: Send>(
    path: &Path,
    frames: Option<usize>,
    parse: fn(&str) -> Result<T, String>,
    each: impl FnMut(Result<Listed<T>, DatasetError>) -> Result<(), DatasetError>,
) -> Result<(), DatasetError> {
    let file = open_file(path).map_err(|error| DatasetError::io(path, &error))?;
    each_row(path, file, frames, parse, each)
}

/// The same for what `reader` reads from the file.
fn each_row<T: Send>(
    path: &Path,
    reader: impl Read,
    frames: Option<usize>,
    parse: fn(&str) -> Result<T, String>,
    mut each: impl FnMut(Result<Listed<T>, DatasetError>) -> Result<(), DatasetError>,
) -> Result<(), DatasetError> {
    let failed = |error| text::unreadable(path, error);
    let mut any = false;
    let mut see = |block: LineBlock<'_>| {
        let rows = block.parsed(|line, bytes| parse_row(line, bytes, frames, parse));
        for (line, row) in rows {
            if let Some(row) = row.transpose() {
                any = true;
                each(row.map_err(|what| text::error_at(path, line, what)))?;
            }
        }
        Ok(())
    };
    let mut blocks = LineBlocks::new(reader, LONGEST_LINE);
    while let Some(block) = blocks.next_block().map_err(failed)? {
        see(block)?;
    }
    blocks.rest().map_or(Ok(()), see)?;
    if !any {
        let remedy = "list the pairs to be matched";
        each(Err(DatasetError::new(path, "there are no pairs", remedy)))?;
    }
    Ok(())
}

/// The pair in a line, if there is one.
fn parse_row<T>(
    line: usize,
    bytes: &[u8],
    frames: Option<usize>,
    parse: fn(&str) -> Result<T, String>,
) -> Result<Option<Listed<T>>, String> {
    let text = String::from_utf8_lossy(bytes);
    let text = match line {
        1 => text.strip_prefix('\u{feff}').unwrap_or(&text),
        _ => &text,
    };
    let Some(row) = text::row(text) else {
        return Ok(None);
    };
    let (a, b) = pair_indices(row, frames)?;
    let truth = parse(row)?;
    Ok(Some(Listed { line, a, b, truth }))
}

pub(super) fn parse_pose(row: &str) -> Result<Isometry3<f64>, String> {
    let numbers: [f64; 14] = text::exactly(row)?;
    let motion = numbers[2..].try_into().expect("12 of 14 numbers are left");
    text::rigid_motion(&motion)
}

pub(super) fn parse_homography(row: &str) -> Result<Matrix3<f64>, String> {
    let numbers: [f64; 11] = text::exactly(row)?;
    text::homography(&numbers[2..])
}

#[cfg(test)]
mod tests {
    use std::fs;

    use proptest::prelude::*;

    use super::super::{Sequence, Unpaired, testing};
    use super::*;

    #[test]
    fn a_part_is_known_by_the_whole() {
        let (_folder, dir) = testing::dataset();
        fs::write(
            dir.join("homographies.txt"),
            "0 1 1 0 5 0 1 -3 0 0 1\n3 0 2 0 0 0 2 0 0 0 2\n",
        )
        .unwrap();
        let sequence = Sequence::open(&dir).unwrap();
        let mut index = 0;
        let every_other = |pair: &Pair| {
            assert_eq!(*pair, sequence.pairs[index]);
            index += 1;
            index % 2 == 1
        };
        let unpaired = Unpaired::open(&dir).unwrap();
        assert_eq!(unpaired.name(), sequence.name);
        let (part, whole) = unpaired.part(every_other).unwrap();
        assert_eq!(whole.pairs, sequence.pairs.len());
        assert_eq!(whole.fingerprint, sequence.fingerprint());
        assert_eq!(part.frames, sequence.frames);
        let kept: Vec<Pair> = sequence.pairs.iter().step_by(2).copied().collect();
        assert_eq!(part.pairs, kept);
    }

    #[test]
    fn a_pair_that_stands_twice_is_named_in_any_order() {
        let (_folder, dir) = testing::dataset();
        let pose = "1 0 0 0 0 1 0 0 0 0 1 1";
        for rows in [[(0, 1), (0, 1)], [(1, 0), (1, 0)]] {
            let rows = [&rows[..1], &[(0, 2)], &rows[1..]].concat();
            let lines: Vec<_> = (rows.iter())
                .map(|(a, b)| format!("{a} {b} {pose}\n"))
                .collect();
            fs::write(dir.join("pairs.txt"), lines.concat()).unwrap();
            let error = Sequence::open(&dir).unwrap_err();
            assert_eq!(error.line, Some(3));
            assert!(error.what.ends_with("stands in line 1 already"), "{error}");
        }
    }

    #[test]
    fn a_line_without_end_takes_no_memory() {
        let endless = std::io::repeat(b'1');
        let error = each_row(Path::new("t"), endless, None, parse_pose, |_| Ok(()));
        assert_eq!(error.unwrap_err().line, Some(1));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "([-0-9.e]{1,4}[ \n]){0,40}|.{0,60}") {
            let path = Path::new("t");
            let _ = each_row(path, text.as_bytes(), Some(2), parse_pose, |row| row.map(drop));
            let _ = each_row(path, text.as_bytes(), None, parse_homography, |row| row.map(drop));
        }
    }
}
