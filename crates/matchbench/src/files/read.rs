//! Reads regular files, and nothing else.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use super::calls::{Call, before};
use super::lines::{LineBlock, LineBlocks, LineError};

/// Most bytes of a file that is read as a whole, 4 GiB. A longer file was not written by this program, and no
/// memory is allocated for it.
const MAX_BYTES: u64 = 4 << 30;

/// The longest line of a text that people and other tools write, in bytes. Those that are known have a few hundred.
pub(crate) const LONGEST_LINE: usize = 1 << 20;

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
    before(Call::Read, path)?;
    let mut bytes = room_for(length)?;
    file.take(MAX_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The bytes of a regular file whose first `N` bytes, as `told` reads them, say how long all of it is. `None` where
/// they do not, or it has another length: the rest is not read then.
///
/// # Errors
/// As [`read_file`].
pub(crate) fn read_file_as_told<const N: usize>(
    path: &Path,
    told: impl FnOnce(&[u8; N]) -> Option<u64>,
) -> io::Result<Option<Vec<u8>>> {
    let mut file = open_file(path)?;
    let length = file.metadata()?.len();
    if length < N as u64 {
        return Ok(None);
    }
    let mut first = [0; N];
    before(Call::Read, path)?;
    file.read_exact(&mut first)?;
    if told(&first) != Some(length) {
        return Ok(None);
    }
    before(Call::Read, path)?;
    let mut bytes = room_for(length)?;
    bytes.extend(first);
    file.take(length - N as u64).read_to_end(&mut bytes)?;
    Ok(Some(bytes))
}

/// Memory for so many bytes of a file.
fn room_for(length: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    if length > MAX_BYTES || bytes.try_reserve_exact(length as usize).is_err() {
        return Err(too_large(length));
    }
    Ok(bytes)
}

/// A file has so many bytes that it cannot be read as a whole.
fn too_large(bytes: u64) -> io::Error {
    io::Error::new(
        io::ErrorKind::FileTooLarge,
        format!("{bytes} bytes are more than can be read"),
    )
}

/// As [`read_file`], where no line may have more than `longest` bytes. Reading stops at the first byte that is too many.
///
/// # Errors
/// As [`read_file`]; also if a line is too long.
pub(crate) fn read_lines(path: &Path, longest: usize) -> Result<Vec<u8>, LineError> {
    let file = open_file(path).map_err(LineError::Io)?;
    let length = file.metadata().map_err(LineError::Io)?.len();
    before(Call::Read, path).map_err(LineError::Io)?;
    if length > MAX_BYTES {
        return Err(LineError::Io(too_large(length)));
    }
    let mut bytes = Vec::new();
    let mut append = |block: LineBlock<'_>| {
        let reserved = bytes.try_reserve(block.bytes());
        reserved.map_err(|_| LineError::Io(too_large(length)))?;
        bytes.extend_from_slice(block.as_bytes());
        Ok(())
    };
    let mut blocks = LineBlocks::new(file.take(MAX_BYTES), longest);
    while let Some(block) = blocks.next_block()? {
        append(block)?;
    }
    blocks.rest().map_or(Ok(()), append)?;
    Ok(bytes)
}

/// The text of a regular file, without the byte order mark that some programs write at the start.
///
/// # Errors
/// As [`read_file`]; also if it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    text_of(read_file(path)?)
}

/// As [`read_text`], where no line may have more than [`LONGEST_LINE`] bytes.
///
/// # Errors
/// As [`read_text`]; also if a line is too long.
pub(crate) fn read_text_lines(path: &Path) -> Result<String, LineError> {
    text_of(read_lines(path, LONGEST_LINE)?).map_err(LineError::Io)
}

fn text_of(bytes: Vec<u8>) -> io::Result<String> {
    let mut text = String::from_utf8(bytes)
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

    #[test]
    fn lines_come_as_they_stand_up_to_the_longest() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let read = |text: &[u8], longest: usize| {
            fs::write(file.path(), text).expect("writable");
            read_lines(file.path(), longest)
        };
        for text in ["", "\n", "one\r\n\ntwo", "one\ntwo\n"] {
            let bytes = read(text.as_bytes(), 5).expect("short lines");
            assert_eq!(bytes, text.as_bytes());
        }
        let error = read(b"one\nthree", 4).expect_err("a long line");
        let LineError::TooLong { line, what } = error else {
            panic!("{error:?}")
        };
        assert_eq!((line, &*what), (2, "the line has more than 4 bytes"));
        fs::write(file.path(), "\u{feff}1 2").expect("writable");
        assert_eq!(read_text_lines(file.path()).expect("readable"), "1 2");
        assert!(matches!(
            read_lines(Path::new("/nowhere"), 9),
            Err(LineError::Io(_))
        ));
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_claims_to_be_endless_is_refused() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        (file.as_file().set_len(MAX_BYTES + 1)).expect("holes take no room");
        let error = read_file(file.path()).expect_err("too long");
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        let error = read_lines(file.path(), LONGEST_LINE).expect_err("too long");
        assert!(
            matches!(error, LineError::Io(error) if error.kind() == io::ErrorKind::FileTooLarge)
        );
        // A line without an end is seen before the rest is read.
        (file.as_file().set_len(MAX_BYTES)).expect("holes take no room");
        let error = read_lines(file.path(), LONGEST_LINE).expect_err("too long");
        assert!(
            matches!(error, LineError::TooLong { line: 1, .. }),
            "{error:?}"
        );
    }
}
