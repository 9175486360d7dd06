//! Records on disk: `records/<dataset>/<matcher>+<estimator>.jsonl` in the folder of the run, one
//! JSON object per line, only ever appended to.
//!
//! Each line ends with a checksum, see `line`. A line is handed to the operating system in one write that
//! ends with the end of the line. So a process that is killed in the middle leaves at most one line without
//! an end, and the next reader drops that line. Any other damage is an error: matchbench did not cause it,
//! and guessing which lines are still true could spoil tables without anybody noticing.
//!
//! # When power fails
//! A killed process loses nothing that was appended, since the operating system has it. A machine that
//! loses power loses what the system had not written yet. A run asks it to write ([`RecordWriter::sync`])
//! with the first record that is appended a second or more after the last time, and when it ends. So at
//! most the records of one second are lost, and are computed again. What records refer to, their images and
//! their matches, is brought to the disk before them.
//!
//! # What is tried again
//! A record of a task that failed before takes the place of the earlier one, for which the whole file is written anew. This
//! takes at most a tenth of the time, so it happens more seldom the longer the file is. Until then a process that is killed
//! loses such records, and the earlier ones stay.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::line::{FIRST_WITH_CHECKSUMS, LineReader, parse, to_line};
use super::{FORMAT, RunRecord};
use crate::files::{Appender, LineBlocks, LineError, WholeFile, open_file, write_unnamed};

/// Why records cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The file system refused.
    #[error("cannot {action} {}: {error}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// With which file.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
    /// A whole line that is not a record.
    #[error(
        "{}:{line}: not a record of this version ({reason}); to do this task and all after it anew, \
         delete the file from this line on and run again",
        path.display()
    )]
    Corrupt {
        /// Which file.
        path: PathBuf,
        /// Which line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// A record of something else than its file is of.
    #[error(
        "{}:{line}: this is a record of {} with {} on {}, and the file is not that of these; records stand where a \
         run wrote them",
        path.display(), names[1], names[2], names[0]
    )]
    Foreign {
        /// Which file.
        path: PathBuf,
        /// Which line, from 1.
        line: usize,
        /// Dataset, matcher and estimator.
        names: [String; 3],
    },
    /// A file of matches that is damaged.
    #[error(
        "{}: damaged ({reason}); delete it, and run again what wrote it: matches that are missing are made again, but for those \
         of a program or of a matcher in Python",
        path.display()
    )]
    Matches {
        /// Which file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

impl StoreError {
    pub(super) fn io(action: &'static str, path: &Path) -> impl Fn(io::Error) -> Self + Copy {
        move |error| Self::Io {
            action,
            path: path.into(),
            error,
        }
    }
}

/// The folder of records within the folder of a run.
pub(super) const FOLDER: &str = "records";

/// Where the records of one dataset, matcher and estimator stand in the folder of a `run`.
pub fn path(run: &Path, dataset: &str, matcher: &str, estimator: &str) -> PathBuf {
    run.join(FOLDER)
        .join(dataset)
        .join(format!("{matcher}+{estimator}.jsonl"))
}

/// The records of one file, in their order; a last line without an end is left out. Safe while
/// another process is appending. Lines may be those of the first format, without checksums.
///
/// # Errors
/// If the file cannot be read or has a line that is not a record.
pub fn read(path: &Path) -> Result<Vec<RunRecord>, StoreError> {
    let mut records = Vec::new();
    for_each(path, 1, |_, record| {
        records.push(record);
        Ok::<_, StoreError>(())
    })?;
    Ok(records)
}

/// Hands over the records of one file of a run folder of this `format` in their order, each with the number of its line, without having
/// them all in memory; all threads of the current pool parse. Returns the length of the whole lines: a
/// last line without an end is left out.
///
/// # Errors
/// As [`read`], and whatever `each` does not want.
pub(crate) fn for_each<E: From<StoreError>>(
    path: &Path,
    format: u32,
    mut each: impl FnMut(usize, RunRecord) -> Result<(), E>,
) -> Result<u64, E> {
    for_each_placed(path, format, |line, _, record| each(line, record))
}

/// As [`for_each`], with the place of each line too.
///
/// # Errors
/// As [`for_each`].
pub(super) fn for_each_placed<E: From<StoreError>>(
    path: &Path,
    format: u32,
    mut each: impl FnMut(usize, Place, RunRecord) -> Result<(), E>,
) -> Result<u64, E> {
    let io = StoreError::io("read", path);
    let corrupt = |line, reason| StoreError::Corrupt {
        path: path.into(),
        line,
        reason,
    };
    let failed = |error| match error {
        LineError::Io(error) => io(error),
        LineError::TooLong { line, .. } => {
            corrupt(line, format!("it has no end within {LONGEST_LINE} bytes"))
        }
    };
    let mut blocks = LineBlocks::new(open_file(path).map_err(io)?, LONGEST_LINE);
    let mut start = 0;
    let mut lines = LineReader::of_format(format);
    while let Some(block) = blocks.next_block().map_err(failed)? {
        for (number, (length, line)) in block.parsed(|_, line| (line.len(), parse(line))) {
            let place = Place { start, length };
            start += length as u64;
            let record = lines.accept(line);
            each(
                number,
                place,
                record.map_err(|reason| corrupt(number, reason))?,
            )?;
        }
    }
    Ok(start)
}

/// The longest line that is taken for a record, in bytes.
pub(super) const LONGEST_LINE: usize = 8 << 20;

/// All records in the folder of a `run`, ordered by dataset, then by matcher and estimator, then
/// as they were written.
///
/// # Errors
/// As [`read`], for every file. A folder without records is no error, it has none.
#[cfg(test)]
pub(crate) fn read_run(run: &Path) -> Result<Vec<RunRecord>, StoreError> {
    let mut records = Vec::new();
    for file in files(run)? {
        records.append(&mut read(&file)?);
    }
    Ok(records)
}

/// The files of records in the folder of a `run`, ordered by dataset, then by matcher and estimator.
///
/// # Errors
/// If a folder cannot be listed. A folder without records is no error, it has none.
pub fn files(run: &Path) -> Result<Vec<PathBuf>, StoreError> {
    files_in(&run.join(FOLDER))
}

/// Those in a folder that is like that of records.
pub(super) fn files_in(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let mut files = Vec::new();
    for dataset in sorted_entries(folder)? {
        if dataset.is_dir() {
            let entries = sorted_entries(&dataset)?.into_iter();
            files.extend(entries.filter(|file| file.extension().is_some_and(|e| e == "jsonl")));
        }
    }
    Ok(files)
}

/// As [`read`], and a last line without an end is cut off the file, so that it can be appended to.
/// A file that does not exist has no records.
///
/// # Errors
/// As [`read`]; or if the file cannot be cut.
pub fn recover(path: &Path) -> Result<Vec<RunRecord>, StoreError> {
    let mut records = Vec::new();
    recover_each(path, |_, record| {
        records.push(record);
        Ok::<_, StoreError>(())
    })?;
    Ok(records)
}

/// As [`recover`], and the records are handed over as [`for_each`] does.
///
/// # Errors
/// As [`recover`], and whatever `each` does not want.
pub(crate) fn recover_each<E: From<StoreError>>(
    path: &Path,
    each: impl FnMut(usize, RunRecord) -> Result<(), E>,
) -> Result<(), E> {
    let length = match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        metadata => metadata.map_err(StoreError::io("read", path))?.len(),
    };
    let whole = for_each(path, FORMAT, each)?;
    if whole < length {
        Appender::open(path, Some(whole))
            .map_err(StoreError::io("cut the torn last line of", path))?;
    }
    Ok(())
}

/// Gives checksums to the records of the folder of a `run` of this `format`, where they need not have any.
///
/// # Errors
/// If a file cannot be read or written, or has a line that is not a record; files after it are as before.
pub(super) fn add_checksums(run: &Path, format: u32) -> Result<(), StoreError> {
    if format >= FIRST_WITH_CHECKSUMS {
        return Ok(());
    }
    for file in files(run)? {
        rewrite(&file, &read(&file)?)?;
    }
    Ok(())
}

/// Writes all records of a file anew.
///
/// # Errors
/// If it cannot be written; the old file is then still there.
pub(crate) fn rewrite(path: &Path, records: &[RunRecord]) -> Result<(), StoreError> {
    let mut text = Vec::new();
    for record in records {
        text.extend(to_line(record));
    }
    write_unnamed(path, &text).map_err(StoreError::io("write", path))
}

/// Writes a file anew with the lines of another behind its own; a last line without an end is cut off both.
///
/// # Errors
/// As [`recover`]; or if it cannot be written. The old file is then still there.
pub(super) fn put_behind(path: &Path, other: &Path) -> Result<(), StoreError> {
    let [read, write] = ["read", "write"].map(|action| StoreError::io(action, path));
    let mut file = WholeFile::create(path).map_err(write)?;
    for part in [path, other] {
        recover_each(part, |_, _| Ok::<_, StoreError>(()))?;
        let mut lines = open_file(part).map_err(read)?;
        io::copy(&mut lines, &mut file).map_err(write)?;
    }
    file.finish().map_err(write)
}

/// Writes a file anew with these lines in the place of those with the same numbers, from 0; the others stay as they are.
/// Of the file, one line is in memory.
///
/// # Errors
/// If it cannot be read or written, or has fewer lines; the old file is then still there.
pub(crate) fn replace(path: &Path, lines: &BTreeMap<usize, RecordLine>) -> Result<(), StoreError> {
    let [read, write] = ["read", "write"].map(|action| StoreError::io(action, path));
    let mut old = BufReader::new(open_file(path).map_err(read)?);
    let mut file = WholeFile::create(path).map_err(write)?;
    let (mut line, mut replaced) = (Vec::new(), 0);
    for number in 0.. {
        line.clear();
        if old.read_until(b'\n', &mut line).map_err(read)? == 0 {
            break;
        }
        let new = lines.get(&number);
        replaced += usize::from(new.is_some());
        (file.write_all(new.map_or(&line, |new| &new.0))).map_err(write)?;
    }
    drop(old);
    if replaced < lines.len() {
        return Err(read(io::Error::other(
            "it has become shorter while the run wrote",
        )));
    }
    file.finish().map_err(write)
}

/// How long records may be known to the operating system alone; tests do not wait for it.
pub(crate) const UNSYNCED: Duration = Duration::from_secs(if cfg!(test) { 0 } else { 1 });

/// A record as it stands in a file.
#[derive(Debug)]
pub(crate) struct RecordLine(Vec<u8>);

impl RecordLine {
    pub(crate) fn of(record: &RunRecord) -> Self {
        Self(to_line(record))
    }
}

/// Where a line stands in a file, in bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    start: u64,
    length: usize,
}

/// Reads single lines of one file.
#[derive(Debug)]
pub(crate) struct Lines {
    path: PathBuf,
    file: File,
}

impl Lines {
    /// Those of the file at `path`.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub(crate) fn of(path: &Path) -> Result<Self, StoreError> {
        Ok(Self {
            path: path.into(),
            file: open_file(path).map_err(StoreError::io("read", path))?,
        })
    }

    /// The line at this place, of which the file was read before.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(crate) fn at(&mut self, place: Place) -> Result<RecordLine, StoreError> {
        let mut line = vec![0; place.length];
        (self.file.seek(SeekFrom::Start(place.start)))
            .and_then(|_| self.file.read_exact(&mut line))
            .map_err(StoreError::io("read", &self.path))?;
        Ok(RecordLine(line))
    }
}

/// Appends records to one file.
#[derive(Debug)]
pub struct RecordWriter {
    path: PathBuf,
    file: Appender,
}

impl RecordWriter {
    /// A writer at the end of the file, which is made if it is not there, as is its folder. Call
    /// [`recover`] first.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        Ok(Self {
            path: path.into(),
            file: Appender::open(path, None).map_err(StoreError::io("open", path))?,
        })
    }

    /// Appends a record; when this returns, killing the process cannot lose it.
    ///
    /// # Errors
    /// If it cannot be written (a full disk). The file may then end in a torn line.
    pub fn append(&mut self, record: &RunRecord) -> Result<(), StoreError> {
        self.append_line(&RecordLine::of(record))
    }

    /// As [`append`](Self::append), of a record that was written as a line before.
    pub(crate) fn append_line(&mut self, line: &RecordLine) -> Result<(), StoreError> {
        let appended = self.file.append(&line.0);
        appended
            .map(drop)
            .map_err(StoreError::io("append to", &self.path))
    }

    /// Makes what was appended safe from the power supply.
    ///
    /// # Errors
    /// If the system cannot.
    pub fn sync(&mut self) -> Result<(), StoreError> {
        (self.file.sync()).map_err(StoreError::io("write", &self.path))
    }
}

/// What is in a folder, sorted by name; nothing if there is no such folder.
fn sorted_entries(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(StoreError::io("list", folder))?,
    };
    let mut paths = (entries.map(|entry| entry.map(|entry| entry.path())))
        .collect::<Result<Vec<_>, _>>()
        .map_err(StoreError::io("list", folder))?;
    paths.sort();
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use matchbench_vision::robust::NoModel;

    use super::super::{Counts, Outcome, StageTimes, Task};
    use super::*;

    fn record(b: u32) -> RunRecord {
        RunRecord {
            task: Task {
                dataset: "office".into(),
                matcher: "sift".into(),
                estimator: "ransac-e".into(),
                a: 0,
                b,
                repetition: 0,
            },
            counts: Counts::default(),
            correct: None,
            repeated: None,
            by_depth: None,
            outcome: Outcome::NoPose {
                reason: NoModel::TooFewMatches {
                    found: 3,
                    needed: 20,
                },
            },
            times: StageTimes::default(),
            device: None,
        }
    }

    /// A run with the records of three pairs: its folder and the file.
    fn three_records() -> (tempfile::TempDir, PathBuf) {
        let run = tempfile::tempdir().unwrap();
        let file = path(run.path(), "office", "sift", "ransac-e");
        let mut writer = RecordWriter::open(&file).unwrap();
        (1..4).for_each(|b| writer.append(&record(b)).unwrap());
        (run, file)
    }

    #[test]
    fn records_come_back_in_order() {
        let (run, file) = three_records();
        assert_eq!(read(&file).unwrap(), [1, 2, 3].map(record));
        assert_eq!(read_run(run.path()).unwrap(), [1, 2, 3].map(record));
    }

    #[test]
    fn a_file_that_cannot_be_rewritten_is_named_once() {
        let (_run, file) = three_records();
        let below = file.join("below");
        for ended in [rewrite(&below, &[]), replace(&below, &BTreeMap::new())] {
            let message = ended.unwrap_err().to_string();
            assert_eq!(message.matches("below").count(), 1, "{message}");
        }
    }

    #[test]
    fn lines_are_replaced_and_the_others_stay_as_they_are() {
        let (_run, file) = three_records();
        // Nobody reads what stays.
        let text = fs::read_to_string(&file).unwrap();
        let text = text.replacen("{\"task\"", "{ \"task\"", 3);
        fs::write(&file, &text).unwrap();
        let new = BTreeMap::from([(1, RecordLine::of(&record(7)))]);
        replace(&file, &new).unwrap();
        let now = fs::read_to_string(&file).unwrap();
        let mut expected: Vec<_> = text.lines().collect();
        let line = String::from_utf8(to_line(&record(7))).unwrap();
        expected[1] = line.trim_end();
        assert_eq!(now.lines().collect::<Vec<_>>(), expected);
        let missing = BTreeMap::from([(3, RecordLine::of(&record(7)))]);
        let message = replace(&file, &missing).unwrap_err().to_string();
        assert!(message.contains("become shorter"), "{message}");
        assert_eq!(fs::read_to_string(&file).unwrap(), now);
    }

    #[test]
    fn a_torn_last_line_is_left_out_wherever_it_was_torn() {
        let (_run, file) = three_records();
        let whole = fs::read(&file).unwrap();
        for length in 0..=whole.len() {
            fs::write(&file, &whole[..length]).unwrap();
            let expected = whole[..length].split(|&byte| byte == b'\n').count() - 1;
            assert_eq!(read(&file).unwrap().len(), expected);
            assert_eq!(
                fs::read(&file).unwrap().len(),
                length,
                "reading cuts nothing"
            );
            assert_eq!(recover(&file).unwrap().len(), expected);
            assert_eq!(recover(&file).unwrap().len(), expected);
            let mut writer = RecordWriter::open(&file).unwrap();
            (expected as u32..3).for_each(|done| writer.append(&record(done + 1)).unwrap());
            assert_eq!(fs::read(&file).unwrap(), whole);
        }
    }

    #[test]
    fn damage_in_the_middle_is_named_by_file_and_line() {
        let (_run, file) = three_records();
        let text = fs::read_to_string(&file).unwrap();
        for damaged in [
            text.replacen("\"b\":2", "\"b\":-2", 1),
            text.replacen("\"b\":2", "\"b\":2,\"c\":2", 1),
            text.replacen("\"b\":2", "\"b\":\n2", 1),
        ] {
            fs::write(&file, damaged).unwrap();
            let message = recover(&file).unwrap_err().to_string();
            assert!(message.contains("sift+ransac-e.jsonl:2:"), "{message}");
        }
    }

    #[test]
    fn a_file_that_is_not_there_has_no_records() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(recover(&folder.path().join("none.jsonl")).unwrap(), []);
        assert_eq!(read_run(folder.path()).unwrap(), []);
    }
}
