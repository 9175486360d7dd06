//! Reads regular files, and nothing else.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use super::calls::{Call, before};

/// Most bytes of a file that is read as a whole, 4 GiB. A longer file was not written by this program, and no
/// memory is allocated for it.
const MOST_BYTES: u64 = 4 << 30;

/// Opens a regular file for reading. Links are followed.
///
/// # Errors
/// The error of the operating system; or that it is a folder, a device or a pipe.
pub fn open_file(path: &Path) -> io::Result<File> {
    before(Call::Open, path)?;
    // Checked before it is opened, since opening a pipe waits for a writer.
    regular(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    regular(&file.metadata()?)?;
    Ok(file)
}

/// The bytes of a regular file. Links are followed.
///
/// # Errors
/// As [`open_file`]; also if the file is longer than 4 GiB, or than the memory that is left.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let file = open_file(path)?;
    let length = file.metadata()?.len();
    let mut bytes = Vec::new();
    before(Call::Read, path)?;
    if length > MOST_BYTES || bytes.try_reserve_exact(length as usize).is_err() {
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("{length} bytes are more than can be read"),
        ));
    }
    file.take(MOST_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a regular file, without the byte order mark that some programs write at the start.
///
/// # Errors
/// As [`read_file`]; also if it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    let mut text = String::from_utf8(read_file(path)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "not text in UTF-8"))?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

/// Checks that it is a regular file. This is done before a file is opened, since opening a pipe would wait.
///
/// # Errors
/// If it is a folder, a device or a pipe.
pub(crate) fn regular(metadata: &fs::Metadata) -> io::Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    let what = if metadata.is_dir() {
        "a folder"
    } else {
        "a device or a pipe"
    };
    Err(io::Error::other(format!("{what} where a file is needed")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_order_mark_is_no_text() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        fs::write(file.path(), "\u{feff}1 2").expect("writable");
        assert_eq!(read_text(file.path()).expect("readable"), "1 2");
        fs::write(file.path(), [0xff, 0xfe]).expect("writable");
        assert!(read_text(file.path()).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_regular_file_is_refused_at_once() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [pipe, link] = ["pipe", "link"].map(|name| folder.path().join(name));
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.expect("mkfifo is part of every system").success());
        std::os::unix::fs::symlink("/dev/zero", &link).expect("writable");
        for path in [&pipe, &link, folder.path()] {
            let error = read_file(path).expect_err("it is no file").to_string();
            assert!(error.contains("where a file is needed"), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_claims_to_be_endless_is_refused() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        (file.as_file().set_len(MOST_BYTES + 1)).expect("holes take no room");
        let error = read_file(file.path()).expect_err("too long");
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
    }
}
