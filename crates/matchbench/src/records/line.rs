//! One record as one line of text, with a checksum at its end.
//!
//! The last field of the object, `"check"`, is the beginning of the BLAKE3 hash of all bytes before it. So
//! a bit that flipped on a disk is found, even where the changed number would look valid. In the first
//! format of run folders lines have no checksum; in the second every line has one.

use super::RunRecord;

const FIELD: &[u8] = b",\"check\":\"";
const END: &[u8] = b"\"}";
/// Hexadecimal digits of the checksum.
const DIGITS: usize = 16;
/// The format of run folders from which on all lines have one.
pub(super) const FIRST_WITH_CHECKSUMS: u32 = 2;

/// The line of a record, with its end.
pub(super) fn to_line(record: &RunRecord) -> Vec<u8> {
    let mut line = serde_json::to_vec(record).expect("a record has only strings and numbers");
    line.pop(); // the brace, which comes after the checksum
    let check = check(&line);
    line.extend([FIELD, check.as_bytes(), END, b"\n"].concat());
    line
}

/// A line that holds a record.
#[derive(Debug)]
pub(super) struct Line {
    record: RunRecord,
    has_checksum: bool,
}

/// What a line holds, or what is wrong with it; lines can be parsed in any order.
pub(super) fn parse(line: &[u8]) -> Result<Line, String> {
    let line = line.trim_ascii_end();
    let (parsed, has_checksum) = match split(line) {
        Some((body, stated)) => {
            if check(body).as_bytes() != stated {
                return Err("its checksum is not that of its content".into());
            }
            (serde_json::from_slice(&[body, b"}"].concat()), true)
        }
        None => (serde_json::from_slice(line), false),
    };
    let record: RunRecord = parsed.map_err(|error| error.to_string())?;
    record.check()?;
    Ok(Line {
        record,
        has_checksum,
    })
}

/// Looks at the lines of a file one after the other.
#[derive(Debug)]
pub(super) struct LineReader {
    /// Whether a line before had a checksum, or all must have.
    checked: bool,
}

impl LineReader {
    /// Of a file in a run folder of this format.
    pub(super) fn of_format(format: u32) -> Self {
        Self {
            checked: format >= FIRST_WITH_CHECKSUMS,
        }
    }

    /// The record of the next line; or what is wrong with it.
    pub(super) fn accept(&mut self, line: Result<Line, String>) -> Result<RunRecord, String> {
        let line = line?;
        if self.checked && !line.has_checksum {
            return Err("it has no checksum".into());
        }
        self.checked |= line.has_checksum;
        Ok(line.record)
    }
}

/// What the checksum is of, and the checksum; `None` where the line has none.
fn split(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let (body, stated) = line.strip_suffix(END)?.split_last_chunk::<DIGITS>()?;
    Some((body.strip_suffix(FIELD)?, stated.as_slice()))
}

fn check(body: &[u8]) -> String {
    blake3::hash(body).to_hex()[..DIGITS].to_owned()
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::RelativePose;
    use nalgebra::{Isometry3, Vector3};
    use proptest::prelude::*;

    use super::super::{Counts, Outcome, StageTimes, Task};
    use super::*;

    /// A record with a pose that turns and moves by these vectors.
    fn record(turn: [f64; 3], motion: [f64; 3]) -> RunRecord {
        let motion = Isometry3::new(Vector3::from(motion), Vector3::from(turn));
        let pose = RelativePose::from_isometry(&motion).expect("it moves");
        RunRecord {
            task: Task {
                dataset: "office".into(),
                matcher: "sift".into(),
                estimator: "ransac-e".into(),
                a: 3,
                b: 4,
                repetition: 0,
            },
            counts: Counts {
                selected: 40,
                ..Counts::default()
            },
            correct: None,
            repeated: None,
            by_depth: None,
            outcome: Outcome::judged(&pose, &Isometry3::translation(1.0, 0.0, 0.0), 9, 12, 100),
            times: StageTimes {
                search: Some(0.25),
                ..StageTimes::default()
            },
            device: None,
        }
    }

    #[test]
    fn a_time_that_no_stage_takes_is_refused() {
        let mut record = record([0.1, 0.2, 0.3], [1.0, 2.0, 3.0]);
        assert!(parse(&to_line(&record)).is_ok());
        for seconds in [-1.0, 1e308] {
            record.times.search = Some(seconds);
            let wrong = parse(&to_line(&record)).unwrap_err();
            assert!(wrong.contains("no time of a stage"), "{wrong}");
        }
    }

    #[test]
    fn every_bit_that_flips_is_found() {
        let line = to_line(&record([0.1, 0.2, 0.3], [1.0, 2.0, 3.0]));
        let ends = line.len() - 1;
        for bit in 0..8 * ends {
            let mut flipped = line.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(parse(&flipped).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn lines_without_a_checksum_come_first_or_not_at_all() {
        let record = record([0.1, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let old = serde_json::to_vec(&record).unwrap();
        let mut all_checked = LineReader::of_format(2);
        assert!(all_checked.accept(parse(&old)).is_err());
        let mut lines = LineReader::of_format(1);
        assert_eq!(lines.accept(parse(&old)).as_ref(), Ok(&record));
        assert_eq!(lines.accept(parse(&to_line(&record))).as_ref(), Ok(&record));
        assert!(
            lines
                .accept(parse(&old))
                .unwrap_err()
                .contains("no checksum")
        );
    }

    #[test]
    fn numbers_that_no_run_writes_are_refused() {
        let line = serde_json::to_string(&record([0.0; 3], [1.0, 0.0, 0.0])).unwrap();
        for (from, to, named) in [
            (
                "\"rotation_error\":0.0",
                "\"rotation_error\":-179.0",
                "rotation_error",
            ),
            (
                "\"rotation_error\":0.0",
                "\"rotation_error\":500.0",
                "rotation_error",
            ),
            (
                "\"translation_error\":0.0",
                "\"translation_error\":180.5",
                "translation_error",
            ),
            (
                "\"translation_error\":0.0",
                "\"translation_error\":1e999",
                "number out of range",
            ),
            ("\"rotation\":[1.0", "\"rotation\":[2.0", "rotation"),
            ("\"rotation\":[1.0", "\"rotation\":[-1.0", "rotation"),
            (
                "\"translation\":[1.0",
                "\"translation\":[1e200",
                "translation",
            ),
            (
                "\"translation\":[1.0",
                "\"translation\":[0.0",
                "translation",
            ),
            ("\"search\":0.25", "\"search\":-0.25", "seconds"),
            (
                "\"outcome\":",
                "\"correct\":[2,1,1,1,1,1,1,1,1,1],\"outcome\":",
                "correct",
            ),
            (
                "\"outcome\":",
                "\"correct\":[0,0,0,0,0,0,0,0,0,41],\"outcome\":",
                "correct",
            ),
            (
                "\"outcome\":",
                "\"repeated\":{\"visible\":[7,9],\"within\":[0,1,2,3,4,5,6,7,7,8]},\"outcome\":",
                "repeated",
            ),
            (
                "\"outcome\":",
                "\"repeated\":{\"visible\":[7,9],\"within\":[2,1,2,3,4,5,6,7,7,7]},\"outcome\":",
                "repeated",
            ),
            (
                "\"outcome\":",
                "\"by_depth\":{\"overlap\":1.1,\"judged\":0,\"within\":[0,0,0,0,0,0,0,0,0,0]},\"outcome\":",
                "overlap",
            ),
            (
                "\"outcome\":",
                "\"by_depth\":{\"judged\":41,\"within\":[0,0,0,0,0,0,0,0,0,0]},\"outcome\":",
                "judges 41 of 40",
            ),
            (
                "\"outcome\":",
                "\"by_depth\":{\"judged\":0,\"within\":[0,0,0,0,0,0,0,0,0,1]},\"outcome\":",
                "more and more",
            ),
            ("\"inliers\":9", "\"inliers\":41", "`inliers` is 41 of 40"),
            (
                "\"support\":12",
                "\"support\":1000000",
                "`support` is 1000000 of 40",
            ),
            ("\"b\":4", "\"b\":3", "itself"),
        ] {
            assert!(line.contains(from), "{from}: {line}");
            let text = line.replacen(from, to, 1);
            let reason = parse(text.as_bytes()).unwrap_err();
            assert!(reason.contains(named), "{to}: {reason}");
        }
    }

    #[test]
    fn homographies_that_no_run_writes_are_refused() {
        let mut record = record([0.0; 3], [1.0, 0.0, 0.0]);
        record.outcome = Outcome::Homography {
            homography: [0.0, 0.6, 0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.28_f64.sqrt()],
            inliers: 40,
            iterations: 7,
            corner_error: Some(2.5),
        };
        let line = serde_json::to_string(&record).unwrap();
        assert_eq!(parse(line.as_bytes()).map(|line| line.record), Ok(record));
        for (from, to, named) in [
            ("[0.0,0.6", "[0.0,0.7", "norm"),
            (
                "[0.0,0.6,0.0,0.6,0.0,0.0,0.0,0.0,",
                "[0.6,0.6,0.0,0.0,0.0,0.0,0.0,0.0,",
                "no inverse",
            ),
            ("2.5", "-2.5", "corner_error"),
            ("2.5", "1e999", "number out of range"),
            ("\"inliers\":40", "\"inliers\":-1", "invalid value"),
        ] {
            assert!(line.contains(from), "{from}: {line}");
            let reason = parse(line.replacen(from, to, 1).as_bytes()).unwrap_err();
            assert!(reason.contains(named), "{to}: {reason}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_and_in_range(
            turn in prop::array::uniform3(-3.0..3.0_f64),
            motion in prop::array::uniform3(-1e3..1e3_f64),
        ) {
            prop_assume!(motion != [0.0; 3]);
            let record = record(turn, motion);
            let read = parse(&to_line(&record)).map(|line| line.record);
            prop_assert_eq!(read, Ok(record));
        }

        #[test]
        fn what_is_accepted_holds(text in "\\{.{0,80}\\}|.{0,40}") {
            if let Ok(line) = parse(text.as_bytes()) {
                prop_assert!(line.record.check().is_ok());
            }
        }
    }
}
