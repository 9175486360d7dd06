//! The layout in which the authors of MatchBench publish results: `<dataset>/<matcher>.txt`, one
//! row per pair, in the order of the pairs.
//!
//! A row is `a b n` and the 12 numbers of the 3x4 matrix `[R | t]`, row after row, of
//! `x_b = R x_a + t` with `t` of length 1. `n` is the number of selected matches in front of
//! both cameras ([`Outcome::Pose`]'s `support`). A failed pair has the row
//! `a b 0 1 0 0 0 0 1 0 0 0 0 1 0`: no support, no turn, no translation.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use matchbench_vision::geometry::RelativePose;
use matchbench_vision::robust::NoModel;
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::{Outcome, RunRecord, Task};
use crate::counted::counted;
use crate::files::{LineError, read_file, read_text_lines, write_whole};

/// What the file of the true poses of a dataset is called, without its ending: it is not of a matcher.
pub const TRUTH: &str = "groundtruth";

/// Why a file in the authors' layout cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AuthorsError {
    /// A file cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
    /// There is a file with other results, which may be somebody else's.
    #[error("{} has other results already; delete it, or export into another folder", path.display())]
    Exists {
        /// Which file.
        path: PathBuf,
    },
    /// All that was estimated are homographies.
    #[error(
        "the authors' format holds only poses, and only homographies were estimated; export their matches in one of \
         the other formats"
    )]
    NoPoses,
    /// A file cannot be written; the error names it.
    #[error(transparent)]
    Write(#[from] io::Error),
    /// A line that is not a row.
    #[error(
        "{}:{line}: {reason}; a row is `a b n`, with the number of matches in front of both cameras, and the 12 \
         numbers of the 3x4 matrix [R | t], row after row",
        path.display()
    )]
    Row {
        /// Which file.
        path: PathBuf,
        /// Which line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
}

/// One row: a pair and what was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Its line in the file, from 1.
    pub line: usize,
    /// Index of the first frame.
    pub a: u32,
    /// Index of the second frame.
    pub b: u32,
    /// Matches in front of both cameras.
    pub support: u32,
    /// The relative pose; `None` where the row has no translation, as the rows of failed pairs.
    pub b_from_a: Option<RelativePose>,
}

impl Row {
    /// What the row says, judged by the `truth`. A pose whose support is below `min_support` does not count: that
    /// is [`MIN_SUPPORT`](super::MIN_SUPPORT), or what the protocol asks for under which the pose was estimated.
    pub fn outcome(&self, truth: &Isometry3<f64>, min_support: usize) -> Outcome {
        match self.b_from_a {
            Some(b_from_a) if self.support as usize >= min_support => {
                Outcome::judged(&b_from_a, truth, self.support, self.support, 0)
            }
            _ => Outcome::NoPose {
                reason: NoModel::NoSupport {
                    found: self.support as usize,
                    needed: min_support,
                },
            },
        }
    }
}

/// The rows of one file, in their order. Any white space separates numbers; empty lines are
/// skipped.
///
/// # Errors
/// If the file cannot be read or a line is not a row.
pub fn read(path: &Path) -> Result<Vec<Row>, AuthorsError> {
    let text = read_text_lines(path).map_err(|error| match error {
        LineError::Io(error) => AuthorsError::Read {
            path: path.into(),
            error,
        },
        LineError::TooLong { line, what } => AuthorsError::Row {
            path: path.into(),
            line,
            reason: what,
        },
    })?;
    (text.lines().enumerate())
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(index, line)| {
            let number = index + 1;
            parse(number, line).map_err(|reason| AuthorsError::Row {
                path: path.into(),
                line: number,
                reason,
            })
        })
        .collect()
}

/// Writes `records` as `out/<dataset>/<matcher>.txt`, or `<matcher>+<estimator>.txt` where a matcher was run with
/// several estimators or under a protocol, by which its rows are to be read, or is called [`TRUTH`], and returns
/// the files. The layout has one row per pair, so only the first repetition is written, and no place for
/// homographies, so methods that estimate these are left out.
///
/// # Errors
/// If a file cannot be written, or all records are of homographies.
pub fn write(out: &Path, records: &[RunRecord]) -> Result<Vec<PathBuf>, AuthorsError> {
    let method = |task: &Task| [&task.dataset, &task.matcher, &task.estimator].map(String::clone);
    let is_homography = |record: &&RunRecord| {
        let outcome = &record.outcome;
        matches!(
            outcome,
            Outcome::Homography { .. } | Outcome::NoHomography { .. }
        )
    };
    let homographies: BTreeSet<_> = (records.iter().filter(is_homography))
        .map(|record| method(&record.task))
        .collect();
    let mut estimators = BTreeMap::<_, BTreeSet<_>>::new();
    let mut texts = BTreeMap::<_, String>::new();
    for RunRecord { task, outcome, .. } in records {
        if homographies.contains(&method(task)) {
            continue;
        }
        let matcher = (&task.dataset, &task.matcher);
        (estimators.entry(matcher).or_default()).insert(&task.estimator);
        if task.repetition == 0 {
            let text = texts.entry((matcher, &task.estimator)).or_default();
            push_row(text, task.a, task.b, outcome);
        }
    }
    if texts.is_empty() && !records.is_empty() {
        return Err(AuthorsError::NoPoses);
    }
    (texts.into_iter())
        .map(|((matcher, estimator), text)| {
            let (dataset, id) = matcher;
            let is_plain =
                estimators[&matcher].len() == 1 && !estimator.contains('@') && id != TRUTH;
            let name = if is_plain {
                format!("{id}.txt")
            } else {
                format!("{id}+{estimator}.txt")
            };
            let path = out.join(dataset).join(name);
            if read_file(&path).is_ok_and(|there| there != text.as_bytes()) {
                return Err(AuthorsError::Exists { path });
            }
            write_whole(&path, text.as_bytes())?;
            Ok(path)
        })
        .collect()
}

fn push_row(text: &mut String, a: u32, b: u32, outcome: &Outcome) {
    let (support, r, t) = match outcome {
        Outcome::Pose {
            rotation,
            translation,
            support,
            ..
        } => (*support, *rotation, *translation),
        Outcome::NoPose { .. }
        | Outcome::Homography { .. }
        | Outcome::NoHomography { .. }
        | Outcome::Failed { .. } => (0, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], [0.0; 3]),
    };
    write!(text, "{a} {b} {support}").expect("a string takes all");
    for (row, t) in r.chunks_exact(3).zip(t) {
        // Every digit is written, so that a score of the export is the score of the run.
        write!(text, " {} {} {} {t}", row[0], row[1], row[2]).expect("a string takes all");
    }
    text.push('\n');
}

fn parse(number_of_line: usize, line: &str) -> Result<Row, String> {
    // A line may be all of a file: what follows is counted, not kept.
    let mut words = line.split_whitespace();
    let fields: Vec<&str> = words.by_ref().take(15).collect();
    let found = fields.len() + words.count();
    let (Ok([a, b, support, pose @ ..]), 15) = (<[&str; 15]>::try_from(&fields[..]), found) else {
        return Err(format!("found {}, needed 15", counted(found, "number")));
    };
    let mut rows = [0.0; 12];
    for (value, field) in rows.iter_mut().zip(pose) {
        *value = number(field, "a number")?;
        if !f64::is_finite(*value) {
            return Err(format!("`{field}` is not finite"));
        }
    }
    Ok(Row {
        line: number_of_line,
        a: number(a, "the index of a frame")?,
        b: number(b, "the index of a frame")?,
        support: number(support, "a number of matches")?,
        b_from_a: relative_pose(&rows)?,
    })
}

fn number<T: FromStr>(field: &str, what: &str) -> Result<T, String> {
    field
        .parse()
        .map_err(|_| format!("`{field}` is not {what}"))
}

/// The pose `[R | t]`; `None` where t is zero, whatever R is: there is nothing to judge.
fn relative_pose(rows: &[f64; 12]) -> Result<Option<RelativePose>, String> {
    /// Published rotations have six digits; what is off by more than this is something else.
    const TOLERANCE: f64 = 1e-3;
    let translation = Vector3::from_fn(|row, _| rows[4 * row + 3]);
    let Some(direction) = RelativePose::direction_of(&translation) else {
        return Ok(None);
    };
    let r = Matrix3::from_fn(|row, column| rows[4 * row + column]);
    let deviation = r.transpose() * r - Matrix3::identity();
    // What is not a number is no small deviation either.
    if !(deviation.iter().all(|x| x.abs() <= TOLERANCE) && r.determinant() > 0.0) {
        return Err("the 3x3 part is not a rotation".into());
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r));
    let rotation = UnitQuaternion::new_normalize(rotation.into_inner());
    Ok(Some(RelativePose {
        rotation,
        direction,
    }))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use nalgebra::Translation3;

    use super::super::{Counts, MIN_SUPPORT, StageTimes};
    use super::*;

    fn record(estimator: &str, b: u32, repetition: u32, outcome: Outcome) -> RunRecord {
        RunRecord {
            task: Task {
                dataset: "05-castle".into(),
                matcher: "sift".into(),
                estimator: estimator.into(),
                a: 0,
                b,
                repetition,
            },
            counts: Counts::default(),
            correct: None,
            repeated: None,
            by_depth: None,
            outcome,
            times: StageTimes::default(),
            device: None,
        }
    }

    fn truth() -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::new(1.0, 2.0, -0.3),
            UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3),
        )
    }

    fn solved() -> Outcome {
        let pose = RelativePose::from_isometry(&truth()).unwrap();
        Outcome::judged(&pose, &truth(), 30, 40, 1000)
    }

    fn broken() -> Outcome {
        Outcome::Failed {
            reason: "cannot read an image".into(),
            may_pass: true,
        }
    }

    fn read_text(text: &str) -> Result<Vec<Row>, AuthorsError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sift.txt");
        fs::write(&path, text).unwrap();
        read(&path)
    }

    #[test]
    fn what_is_written_comes_back_with_the_same_errors() {
        let out = tempfile::tempdir().unwrap();
        let records = [
            record("ransac-e", 1, 0, solved()),
            record("ransac-e", 1, 1, broken()),
            record("ransac-e", 2, 0, broken()),
        ];
        let files = write(out.path(), &records).unwrap();
        assert_eq!(files, [out.path().join("05-castle/sift.txt")]);
        let text = fs::read_to_string(&files[0]).unwrap();
        assert_eq!(text.lines().nth(1), Some("0 2 0 1 0 0 0 0 1 0 0 0 0 1 0"));

        let rows = read(&files[0]).unwrap();
        assert_eq!((rows[0].line, rows[0].b, rows[0].support), (1, 1, 40));
        let Outcome::Pose {
            rotation_error,
            translation_error,
            ..
        } = rows[0].outcome(&truth(), MIN_SUPPORT)
        else {
            panic!("the first row has a pose")
        };
        assert!(rotation_error < 1e-6 && translation_error.unwrap() < 1e-5);
        assert!(matches!(
            rows[1].outcome(&truth(), MIN_SUPPORT),
            Outcome::NoPose {
                reason: NoModel::NoSupport {
                    found: 0,
                    needed: 10
                }
            }
        ));
    }

    #[test]
    fn what_somebody_else_wrote_is_not_overwritten() {
        let out = tempfile::tempdir().unwrap();
        let records = [record("ransac-e", 1, 0, solved())];
        let files = write(out.path(), &records).unwrap();
        assert_eq!(
            write(out.path(), &records).unwrap(),
            files,
            "the same again"
        );
        fs::write(&files[0], "theirs").unwrap();
        let error = write(out.path(), &records).unwrap_err().to_string();
        assert!(error.contains("sift.txt has other results"), "{error}");
        assert_eq!(fs::read_to_string(&files[0]).unwrap(), "theirs");
    }

    #[test]
    fn a_protocol_is_told_by_the_name_of_the_file_and_says_how_much_support_a_pose_needs() {
        let out = tempfile::tempdir().unwrap();
        let pose = RelativePose::from_isometry(&truth()).unwrap();
        let weak = Outcome::judged(&pose, &truth(), 6, 6, 30);
        let files = write(out.path(), &[record("ransac-e@superglue", 1, 0, weak)]).unwrap();
        let expected = out.path().join("05-castle/sift+ransac-e@superglue.txt");
        assert_eq!(files, [expected]);
        let rows = read(&files[0]).unwrap();
        let is_pose = |needed| matches!(rows[0].outcome(&truth(), needed), Outcome::Pose { .. });
        assert!(is_pose(1) && is_pose(6) && !is_pose(7));
    }

    #[test]
    fn several_estimators_are_told_apart_by_the_name_of_the_file() {
        let out = tempfile::tempdir().unwrap();
        let records = [
            record("ransac-e", 1, 0, solved()),
            record("lmeds-e", 1, 0, broken()),
        ];
        let names: Vec<_> = (write(out.path(), &records).unwrap().iter())
            .map(|path| path.file_name().unwrap().to_owned())
            .collect();
        assert_eq!(names, ["sift+lmeds-e.txt", "sift+ransac-e.txt"]);
    }

    #[test]
    fn results_are_not_called_as_the_truth_beside_them() {
        let out = tempfile::tempdir().unwrap();
        let mut oracle = record("best", 1, 0, solved());
        oracle.task.matcher = TRUTH.into();
        let expected = out.path().join("05-castle/groundtruth+best.txt");
        assert_eq!(write(out.path(), &[oracle]).unwrap(), [expected]);
    }

    #[test]
    fn white_space_may_be_irregular() {
        let rows = read_text(
            "0  1 12 1 0 0 0.6  0 1 0 0 0\t0 1 0.8  \r\n\r\n2 3 9 1 0 0 1 0 1 0 0 0 0 1 0",
        );
        let rows = rows.unwrap();
        assert_eq!(rows.len(), 2);
        assert_eq!(rows[0].b_from_a.unwrap().direction.z, 0.8);
        assert!(
            matches!(
                rows[1].outcome(&truth(), MIN_SUPPORT),
                Outcome::NoPose { .. }
            ),
            "a support of 9 is too little"
        );
    }

    #[test]
    fn a_huge_translation_is_judged_by_its_direction() {
        for length in ["1e154", "1e200", "1e308", "1e-200"] {
            let row = format!("\u{feff}0 1 12 1 0 0 0 0 1 0 -{length} 0 0 1 0\n");
            let rows = read_text(&row).unwrap();
            let truth = Isometry3::translation(0.0, 1.0, 0.0);
            let Outcome::Pose {
                translation,
                translation_error,
                ..
            } = rows[0].outcome(&truth, MIN_SUPPORT)
            else {
                panic!("a pose with a support of twelve")
            };
            assert_eq!(
                (translation, translation_error),
                ([0.0, -1.0, 0.0], Some(180.0))
            );
        }
    }

    #[test]
    fn what_is_not_a_row_is_named_by_line() {
        let good = "0 1 12 1 0 0 1 0 1 0 0 0 0 1 0\n";
        for (bad, named) in [
            ("0 1", "found 2 numbers, needed 15"),
            (&"1 ".repeat(1 << 16), "found 65536 numbers, needed 15"),
            ("0 1 12 1 0 0 1 0 1 0 0 0 0 1 0 5", "found 16 numbers"),
            (
                "0 -1 12 1 0 0 1 0 1 0 0 0 0 1 0",
                "`-1` is not the index of a frame",
            ),
            (
                "0 1 x 1 0 0 1 0 1 0 0 0 0 1 0",
                "`x` is not a number of matches",
            ),
            ("0 1 12 1 0 0 nan 0 1 0 0 0 0 1 0", "`nan` is not finite"),
            ("0 1 12 1 0 0 1 0 2 0 0 0 0 1 0", "not a rotation"),
            ("0 1 12 -1 0 0 1 0 -1 0 0 0 0 -1 0", "not a rotation"),
            (
                "0 1 12 1e200 1e200 0 1 -1e200 1e200 0 0 0 0 1 0",
                "not a rotation",
            ),
        ] {
            let message = read_text(&format!("{good}{bad}\n"))
                .unwrap_err()
                .to_string();
            assert!(
                message.contains("sift.txt:2: ") && message.contains(named),
                "{message}"
            );
        }
    }

    #[cfg(unix)] // holes of files take no room
    #[test]
    fn a_line_without_an_end_is_named_before_the_rest_is_read() {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), "0 2 0 1 0 0 0 0 1 0 0 0 0 1 0\n").unwrap();
        // A hole, which takes no room.
        file.as_file().set_len(3 << 30).unwrap();
        let error = read(file.path()).unwrap_err().to_string();
        assert!(
            error.contains(":2: the line has more than 1048576 bytes; a row is"),
            "{error}"
        );
    }

    #[test]
    #[ignore = "needs MATCHBENCH_REFERENCE, a folder with the authors' Dataset and Results"]
    fn the_published_results_are_read() {
        let reference = std::env::var_os("MATCHBENCH_REFERENCE");
        let reference = reference.expect("MATCHBENCH_REFERENCE names a folder");
        let results = Path::new(&reference).join("Results");
        let rows = read(&results.join("05-castle/latch.txt")).unwrap();
        assert_eq!(rows.len(), 435);
        assert!(rows.iter().all(|row| row.b_from_a.is_some()));
        let rows = read(&results.join("08-large-cabinet-wide/latch.txt")).unwrap();
        let failed = rows.iter().filter(|row| row.b_from_a.is_none());
        assert!(failed.clone().all(|row| row.support == 0));
        assert_eq!((rows.len(), failed.count()), (567, 300));
    }
}
