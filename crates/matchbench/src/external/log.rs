//! The log of what child processes print, in a file whose size is limited.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::files::is_link;

/// Bytes after which a log is full.
const FULL: u64 = 16 << 20;
/// Letters of a line that are told to the user.
const TOLD: usize = 300;

/// The log of one matcher; clones write into the same file.
///
/// At most 16 MiB are written; the rest is dropped, and the log says so. A log that is half full when
/// it is opened is put aside as `<name>.log.old`.
#[derive(Clone, Debug)]
pub struct Log(Arc<Mutex<State>>);

#[derive(Debug)]
struct State {
    path: PathBuf,
    file: File,
    room: u64,
}

impl Log {
    /// Opens the log at `path` for appending; it and its folder are made if they are not there.
    ///
    /// # Errors
    /// If it or its folder is a link, or it cannot be opened; the error names it.
    pub fn open(path: &Path) -> io::Result<Self> {
        Self::with_room(path, FULL)
    }

    fn with_room(path: &Path, full: u64) -> io::Result<Self> {
        let named = |error: io::Error| {
            let message = format!("cannot open the log {}: {error}", path.display());
            io::Error::new(error.kind(), message)
        };
        if let Some(folder) = path.parent() {
            // A run folder of somebody else could lead to any file.
            if is_link(folder) || is_link(path) {
                return Err(named(io::Error::other(
                    "it is a link, or its folder is; delete it",
                )));
            }
            fs::create_dir_all(folder).map_err(named)?;
        }
        let about = fs::metadata(path);
        // A pipe would wait for a reader.
        if about.as_ref().is_ok_and(|about| !about.is_file()) {
            return Err(named(io::Error::other("it is no file")));
        }
        let length = about.map_or(0, |about| about.len());
        let length = if length > full / 2 {
            let mut old = path.as_os_str().to_owned();
            old.push(".old");
            fs::rename(path, old).map_err(named)?;
            0
        } else {
            length
        };
        let file = OpenOptions::new().append(true).create(true).open(path);
        Ok(Self(Arc::new(Mutex::new(State {
            path: path.into(),
            file: file.map_err(named)?,
            room: full - length,
        }))))
    }

    /// Where it is.
    pub fn path(&self) -> PathBuf {
        self.state().path.clone()
    }

    /// Appends a line.
    pub(super) fn line(&self, line: &[u8]) {
        let mut state = self.state();
        let length = line.len() as u64 + 1;
        let (text, room) = match state.room {
            0 => return,
            room if length <= room => ([line, b"\n"].concat(), room - length),
            _ => (b"(the log is full; the rest is dropped)\n".to_vec(), 0),
        };
        state.room = room;
        // A full disk takes the log away and nothing else.
        if state.file.write_all(&text).is_err() {
            state.room = 0;
        }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The beginning of a line without what would move a terminal's cursor.
pub(super) fn told(line: &[u8]) -> String {
    let line = String::from_utf8_lossy(&line[..line.len().min(4 * TOLD)]);
    let shown: String = (line.trim().chars())
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(TOLD)
        .collect();
    if line.trim().chars().count() > TOLD {
        shown + " ..."
    } else {
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn nothing_is_written_through_a_link() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let (theirs, logs) = (folder.path().join("theirs"), folder.path().join("logs"));
        fs::create_dir(&logs).unwrap();
        symlink(&theirs, logs.join("x.log")).unwrap();
        let error = Log::open(&logs.join("x.log")).unwrap_err().to_string();
        assert!(error.contains("it is a link"), "{error}");
        symlink(&logs, folder.path().join("elsewhere")).unwrap();
        let error = Log::open(&folder.path().join("elsewhere/y.log")).unwrap_err();
        assert!(error.to_string().contains("it is a link"), "{error}");
        assert!(!theirs.exists() && !logs.join("y.log").exists());
    }

    #[test]
    fn a_log_is_full_and_says_so_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("logs/x.log");
        let log = Log::with_room(&path, 20).unwrap();
        for line in ["123456789", "12345678", "more", "and more"] {
            log.line(line.as_bytes());
        }
        let text = fs::read_to_string(&path).unwrap();
        let note = "(the log is full; the rest is dropped)\n";
        assert_eq!(text, format!("123456789\n12345678\n{note}"));
        let again = Log::with_room(&path, 20).unwrap();
        again.line(b"new");
        assert_eq!(fs::read_to_string(&path).unwrap(), "new\n");
        assert!(folder.path().join("logs/x.log.old").is_file());
    }

    #[test]
    fn what_is_told_moves_no_cursor_and_is_short() {
        assert_eq!(told(b" \x1b[2Jbad\tname \n"), " [2Jbad name");
        assert_eq!(told(&[b'x'; 5000]).len(), TOLD + 4);
    }
}
