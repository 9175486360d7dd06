//! Files that are appended to.

use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::calls::{Call, before, sync, write_all};
use super::{make_folder, sync_folder_of};

/// A file that is only ever appended to.
///
/// Appended data are handed to the operating system. So a process that is killed loses none of them, and leaves
/// at most a part of the last piece, which the next process cuts off. A machine that loses power keeps what was
/// [synced](Self::sync).
#[derive(Debug)]
pub(crate) struct Appender {
    path: PathBuf,
    file: File,
    end: u64,
    is_synced: bool,
}

impl Appender {
    /// Opens the file to append at byte `end`. What follows `end` was not finished and is cut off. Without
    /// `end`, the length of the file is used. A missing file is created, and so is its folder.
    ///
    /// # Errors
    /// The error of the operating system.
    pub(crate) fn open(path: &Path, end: Option<u64>) -> io::Result<Self> {
        let is_new = !path.exists();
        if let Some(folder) = path.parent() {
            make_folder(folder)?;
        }
        before(Call::Open, path)?;
        let file = (OpenOptions::new().create(true).truncate(false).write(true)).open(path)?;
        if is_new {
            sync_folder_of(path);
        }
        let length = file.metadata()?.len();
        let mut appender = Self {
            path: path.into(),
            file,
            end: end.unwrap_or(length).min(length),
            is_synced: true,
        };
        if appender.end < length {
            before(Call::Cut, path)?;
            appender.file.set_len(appender.end)?;
        }
        appender.file.seek(SeekFrom::Start(appender.end))?;
        Ok(appender)
    }

    /// Appends a piece, and returns the position where it begins. After an error, a part of it may be in the
    /// file; the next piece overwrites it.
    ///
    /// # Errors
    /// The error of the operating system, such as a full disk.
    pub(crate) fn append(&mut self, piece: &[u8]) -> io::Result<u64> {
        self.is_synced = false;
        if let Err(error) = write_all(&mut self.file, &self.path, piece) {
            let _ = self.file.seek(SeekFrom::Start(self.end));
            return Err(error);
        }
        let start = self.end;
        self.end += piece.len() as u64;
        Ok(start)
    }

    /// Waits until appended data would survive a loss of power.
    ///
    /// # Errors
    /// The error of the operating system; or that the file is gone, which can be written to as long as it is open.
    pub(crate) fn sync(&mut self) -> io::Result<()> {
        if !self.is_synced {
            if !self.path.exists() {
                let what = "it was removed while it was written to; run again";
                return Err(io::Error::new(io::ErrorKind::NotFound, what));
            }
            sync(&self.file, &self.path)?;
            self.is_synced = true;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn pieces_follow_each_other_and_what_was_left_unfinished_is_cut_off() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("below/file");
        let mut file = Appender::open(&path, None).unwrap();
        assert_eq!(file.append(b"one").unwrap(), 0);
        assert_eq!(file.append(b"two").unwrap(), 3);
        file.sync().unwrap();
        drop(file);
        assert_eq!(fs::read(&path).unwrap(), b"onetwo");
        let mut file = Appender::open(&path, Some(4)).unwrap();
        assert_eq!(file.append(b"!").unwrap(), 4);
        assert_eq!(fs::read(&path).unwrap(), b"onet!");
        let mut file = Appender::open(&path, None).unwrap();
        assert_eq!(file.append(b"?").unwrap(), 5);
        assert_eq!(fs::read(&path).unwrap(), b"onet!?");
        file.sync().unwrap();
    }

    #[cfg(unix)] // elsewhere what is open stays
    #[test]
    fn what_is_written_into_a_file_that_is_gone_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut file = Appender::open(&path, None).unwrap();
        file.append(b"there").unwrap();
        file.sync().unwrap();
        fs::remove_file(&path).unwrap();
        file.append(b"lost").unwrap();
        let error = file.sync().unwrap_err().to_string();
        assert!(error.contains("removed"), "{error}");
    }
}
