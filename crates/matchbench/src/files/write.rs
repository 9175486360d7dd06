//! Writes complete files.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

use super::calls::{Call, before, sync, write_all};
use super::{PREFIX, hold};

/// Writes `contents` to a temporary file beside `path` and renames it. So a reader of `path` finds the old file
/// or the new one, never a part. Missing folders are created. An existing file keeps its permissions, and a
/// link keeps its target. If `path` is not a file but a device or a pipe, `contents` are written into it.
///
/// # Errors
/// The error of the file system, with the path; if there is a folder at `path`, or a file that must not be
/// written to.
pub fn write_whole(path: &Path, contents: &[u8]) -> io::Result<()> {
    write_unnamed(path, contents).map_err(named(path))
}

/// As [`write_whole`], but something that exists and is not a file is refused, such as a pipe, which may have
/// no reader.
///
/// # Errors
/// As [`write_whole`].
pub(crate) fn write_whole_file(path: &Path, contents: &[u8]) -> io::Result<()> {
    if fs::metadata(path).is_ok_and(|there| !there.is_file()) {
        let error = io::Error::other("it is there and no file; delete it");
        return Err(named(path)(error));
    }
    write_whole(path, contents)
}

/// A file that is written in several pieces and appears complete at its path; see [`write_whole`]. If it is
/// dropped before [`finish`](Self::finish), nothing is left.
#[derive(Debug)]
pub(crate) struct WholeFile {
    /// The temporary file beside it: its own errors do not name it, which is gone by then.
    beside: BufWriter<File>,
    temporary: TempPath,
    /// The path that it gets.
    path: PathBuf,
    /// The file that is at this path now.
    earlier: Option<Metadata>,
}

impl WholeFile {
    /// Starts a file for `path`. As in [`write_unnamed`], whoever calls this or what follows names the path in errors.
    ///
    /// # Errors
    /// As [`write_unnamed`].
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        let earlier = earlier(path)?.map(|(earlier, _)| earlier);
        let path = followed(path)?;
        let (beside, temporary) = beside(&path)?.into_parts();
        Ok(Self {
            beside: BufWriter::new(beside),
            temporary,
            path,
            earlier,
        })
    }

    /// Moves the finished file to its path.
    ///
    /// # Errors
    /// As [`write_unnamed`].
    pub(crate) fn finish(self) -> io::Result<()> {
        let beside = (self.beside.into_inner()).map_err(io::IntoInnerError::into_error)?;
        let beside = NamedTempFile::from_parts(beside, self.temporary);
        put(beside, &self.path, self.earlier.as_ref())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.beside.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.beside.flush()
    }
}

fn named(path: &Path) -> impl FnOnce(io::Error) -> io::Error {
    move |error| {
        let message = format!("cannot write {}: {error}", path.display());
        io::Error::new(error.kind(), message)
    }
}

/// As [`write_unnamed`]; but an existing file with other content belongs to somebody else, and stays.
///
/// # Errors
/// As [`write_unnamed`]; [`io::ErrorKind::AlreadyExists`] if there is such a file.
pub(crate) fn write_new(path: &Path, contents: &[u8]) -> io::Result<()> {
    if super::read_file(path).is_ok_and(|there| there != contents) {
        return Err(io::Error::new(
            io::ErrorKind::AlreadyExists,
            "it has other content already; delete it, or write into another folder",
        ));
    }
    write_unnamed(path, contents)
}

/// As [`write_whole`], for callers whose own errors name the path.
///
/// # Errors
/// The error of the file system; otherwise as [`write_whole`].
pub(crate) fn write_unnamed(path: &Path, contents: &[u8]) -> io::Result<()> {
    let earlier = match earlier(path)? {
        Some((earlier, mut there)) if !earlier.is_file() => return there.write_all(contents),
        earlier => earlier.map(|(earlier, _)| earlier),
    };
    let path = &followed(path)?;
    let mut beside = beside(path)?;
    write_all(beside.as_file_mut(), path, contents)?;
    put(beside, path, earlier.as_ref())
}

/// The file at `path`, opened for writing: a file that must not be written to must not be replaced either.
fn earlier(path: &Path) -> io::Result<Option<(Metadata, File)>> {
    let earlier = match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        metadata => metadata?,
    };
    let there = OpenOptions::new().write(true).open(path)?;
    Ok(Some((earlier, there)))
}

/// An empty file in the folder of `path`, which is created if it is missing.
fn beside(path: &Path) -> io::Result<NamedTempFile> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    make_folder(folder)?;
    before(Call::Open, path)?;
    // Temporary files can be read only by their owner; this one becomes an ordinary file.
    let ordinary = |path: &Path| File::create_new(path);
    let beside = (tempfile::Builder::new().prefix(PREFIX)).make_in(folder, ordinary)?;
    hold(beside.as_file());
    Ok(beside)
}

/// Moves the new file to the place of the earlier one.
fn put(beside: NamedTempFile, path: &Path, earlier: Option<&Metadata>) -> io::Result<()> {
    if let Some(earlier) = earlier {
        keep_owner(beside.as_file(), earlier);
        beside.as_file().set_permissions(earlier.permissions())?;
    }
    sync(beside.as_file(), path)?;
    before(Call::Rename, path)?;
    beside.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// Creates a folder and those above it, if they are missing.
pub(crate) fn make_folder(folder: &Path) -> io::Result<()> {
    before(Call::MakeFolder, folder)?;
    fs::create_dir_all(folder)
}

/// Moves a file to where none is, in a folder of the same disk, which is created if it is missing.
///
/// # Errors
/// The error of the operating system; the file is then where it was.
pub(crate) fn move_file(from: &Path, to: &Path) -> io::Result<()> {
    if let Some(folder) = to.parent() {
        make_folder(folder)?;
    }
    before(Call::Rename, from)?;
    fs::rename(from, to)?;
    sync_folder_of(to);
    sync_folder_of(from);
    Ok(())
}

/// Makes the name of a file survive a loss of power, as its content does, if the system supports that.
pub(crate) fn sync_folder_of(path: &Path) {
    if let Some(folder) = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
    {
        let _ = File::open(folder).and_then(|open| sync(&open, folder));
    }
}

/// The path at the end of a chain of links, whether something exists there or not.
fn followed(path: &Path) -> io::Result<PathBuf> {
    /// As many links as Linux follows.
    const MAX_LINKS: usize = 40;
    let mut path = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&path) {
            Ok(target) => path = path.parent().unwrap_or(Path::new("")).join(target),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many links lead on from it"))
}

/// Gives a file the owner of the earlier one, if that is permitted.
#[cfg(unix)]
fn keep_owner(file: &File, before: &fs::Metadata) {
    use std::os::unix::fs::{MetadataExt, fchown};
    let _ = fchown(file, Some(before.uid()), Some(before.gid()));
}

#[cfg(not(unix))]
fn keep_owner(_: &File, _: &fs::Metadata) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_nothing_is_left_beside() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("new/file.txt");
        write_whole(&path, b"old").expect("writable");
        write_whole(&path, b"new").expect("writable");
        assert_eq!(fs::read(&path).expect("readable"), b"new");
        let beside = fs::read_dir(path.parent().expect("has a folder")).expect("readable");
        assert_eq!(beside.count(), 1);
    }

    #[test]
    fn an_error_names_the_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("file"), b"").expect("writable");
        let path = folder.path().join("file/below");
        let error = write_whole(&path, b"").expect_err("a file is no folder");
        assert!(error.to_string().contains("below"), "{error}");
        assert!(write_whole(folder.path(), b"").is_err(), "it is a folder");
        assert!(folder.path().join("file").is_file());
    }

    #[cfg(unix)]
    #[test]
    fn links_lead_on_permissions_stay_and_pipes_are_written_into() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [file, link, far] = ["file", "link", "far"].map(|name| folder.path().join(name));
        fs::write(&file, b"old").expect("writable");
        let private = fs::Permissions::from_mode(0o600);
        fs::set_permissions(&file, private).expect("it is ours");
        symlink("file", &link).expect("writable");
        symlink("link", &far).expect("writable");
        write_whole(&far, b"new").expect("writable");
        assert_eq!(fs::read(&file).expect("readable"), b"new");
        let metadata = fs::symlink_metadata(&file).expect("there");
        assert_eq!(metadata.permissions().mode() & 0o777, 0o600);
        for link in [&link, &far] {
            assert!(fs::symlink_metadata(link).expect("there").is_symlink());
        }
        fs::remove_file(&file).expect("it is ours");
        write_whole(&link, b"again").expect("a link to nothing makes the file");
        assert_eq!(fs::read(&file).expect("readable"), b"again");

        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.expect("mkfifo is part of every system").success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read(pipe).expect("readable")
        });
        write_whole(&pipe, b"through").expect("somebody reads");
        assert_eq!(reader.join().expect("it ended"), b"through");
        write_whole(Path::new("/dev/null"), b"gone").expect("it takes all");
        let null = fs::metadata("/dev/null").expect("there");
        assert!(!null.is_file(), "a device stays a device");
    }
}
