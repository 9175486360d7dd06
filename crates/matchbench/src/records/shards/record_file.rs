//! The records of one shard, read line by line as they are asked for.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::super::line::{LineReader, parse};
use super::super::store::LONGEST_LINE;
use super::super::{FORMAT, RunRecord, StoreError};
use crate::files::open_file;

/// One file of records and how far it was read. It can be closed in between: many shards are read in
/// turn, and a process may not have that many files open.
pub(super) struct RecordFile {
    path: PathBuf,
    reader: Option<BufReader<File>>,
    offset: u64,
    line: usize,
    lines: LineReader,
    text: Vec<u8>,
}

impl RecordFile {
    /// The beginning of a file.
    pub(super) fn new(path: PathBuf) -> Self {
        Self {
            path,
            reader: None,
            offset: 0,
            line: 0,
            lines: LineReader::of_format(FORMAT),
            text: Vec::new(),
        }
    }

    /// Number of the line that was read last, from 1.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// The next record and its line as it stands in the file, with its end; `None` after the last whole line.
    ///
    /// # Errors
    /// If the file cannot be read, or the line is not a record.
    pub(super) fn next(&mut self) -> Result<Option<(&[u8], RunRecord)>, StoreError> {
        let io = StoreError::io("read", &self.path);
        let reader = match &mut self.reader {
            Some(reader) => reader,
            none => match open_at(&self.path, self.offset) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
                reader => none.insert(reader.map_err(io)?),
            },
        };
        self.text.clear();
        let mut limited = reader.take(LONGEST_LINE as u64);
        (limited.read_until(b'\n', &mut self.text)).map_err(io)?;
        let whole = self.text.last() == Some(&b'\n');
        if !whole && self.text.len() < LONGEST_LINE {
            return Ok(None);
        }
        self.offset += self.text.len() as u64;
        self.line += 1;
        let record = if whole {
            self.lines.accept(parse(&self.text))
        } else {
            Err("the line has no end".into())
        };
        let record = record.map_err(|reason| StoreError::Corrupt {
            path: self.path.clone(),
            line: self.line,
            reason,
        })?;
        Ok(Some((&self.text, record)))
    }

    /// Closes the file; it is opened again where it was left.
    pub(super) fn close(&mut self) {
        self.reader = None;
    }
}

/// A reader of a file from `offset` on.
pub(super) fn open_at(path: &Path, offset: u64) -> io::Result<BufReader<File>> {
    let mut file = open_file(path)?;
    file.seek(SeekFrom::Start(offset))?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// How many whole lines a file has; none if it is not there.
///
/// # Errors
/// If it cannot be read.
pub(super) fn count_lines(path: &Path) -> Result<u64, StoreError> {
    let mut reader = match open_at(path, 0) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(0),
        reader => reader.map_err(StoreError::io("read", path))?,
    };
    let mut lines = 0;
    loop {
        let bytes = (reader.fill_buf()).map_err(StoreError::io("read", path))?;
        if bytes.is_empty() {
            return Ok(lines);
        }
        lines += (bytes.split(|&byte| byte == b'\n').count() - 1) as u64;
        let read = bytes.len();
        reader.consume(read);
    }
}
