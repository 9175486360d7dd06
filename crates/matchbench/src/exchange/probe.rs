//! Finds which files a path holds, and of what kind they are by their first bytes.

use std::ffi::OsStr;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::{ExchangeError, FORMATS, Format};
use crate::arrays::{Hdf5, Npz};
use crate::files::open_file;

/// Endings of files that may hold matches; a folder's other files (logs, images) are passed over.
const ENDINGS: [&str; 7] = ["npz", "txt", "h5", "hdf5", "db", "sqlite", "sqlite3"];
/// The most files of a folder: one for each pair of a dataset.
const MAX_FILES: usize = 1_000_000;

/// Files that belong together.
pub(super) struct Probe {
    /// Sorted where they come from a folder, else as given.
    pub(super) files: Vec<PathBuf>,
    pub(super) content: Content,
}

/// What kind of files they are.
pub(super) enum Content {
    /// numpy archives, with the names of the arrays in the first.
    Npz(Vec<String>),
    /// HDF5 files, each with the paths of its arrays.
    Hdf5(Vec<(Hdf5, Vec<String>)>),
    /// SQLite databases.
    Sqlite,
    /// Anything else that is called `.txt`.
    Text,
}

impl Probe {
    /// What is at `paths`: files, or one folder of files, or one folder with a folder of files for
    /// each dataset, of which that of `dataset` is taken.
    ///
    /// # Errors
    /// If there is nothing, something cannot be read, or the files are of several kinds.
    pub(super) fn new(paths: &[PathBuf], dataset: &str) -> Result<Self, ExchangeError> {
        let files = match paths {
            [path] if path.is_dir() => {
                let inner = path.join(dataset);
                let folder = if inner.is_dir() { &inner } else { path };
                files_in(folder)?
            }
            paths => paths.to_vec(),
        };
        let Some(first) = files.first() else {
            return Err(ExchangeError::new("", "no file is named", "name one"));
        };
        let kind = |path: &Path| {
            let known = magic(path)?;
            Ok::<_, ExchangeError>(known.map_or("text", |(_, kind)| kind))
        };
        let found = kind(first)?;
        // A folder of one file a pair may have very many: each says what it is when it is read.
        for other in files.iter().skip(1).take(8) {
            if kind(other)? != found {
                let what = format!("it is of another kind than {}", first.display());
                return Err(ExchangeError::new(
                    other,
                    what,
                    "name the files, not their folder",
                ));
            }
        }
        let content = match found {
            "npz" => Content::Npz(Npz::open(first)?.names()),
            "hdf5" => Content::Hdf5(opened(&files)?),
            "sqlite" => Content::Sqlite,
            _ if first.extension() == Some(OsStr::new("txt")) => Content::Text,
            _ => {
                return Err(ExchangeError::new(
                    first,
                    "it is no .npz, HDF5, SQLite or .txt file",
                    "see `matchbench list formats` for what can be read",
                ));
            }
        };
        Ok(Self { files, content })
    }

    /// The format of the files, which must be the `asked` one.
    ///
    /// # Errors
    /// If it is another, or none that is known.
    pub(super) fn format(
        &self,
        asked: Option<&'static Format>,
    ) -> Result<&'static Format, ExchangeError> {
        let found = FORMATS.iter().find(|format| (format.recognises)(self));
        let first = &self.files[0];
        match (found, asked) {
            (Some(found), Some(asked)) if found.id != asked.id => Err(ExchangeError::new(
                first,
                format!("its content is `{}`, not `{}`", found.id, asked.id),
                "leave --matches-format out, or name the right files",
            )),
            (Some(found), _) => Ok(found),
            (None, asked) => {
                let layouts = (FORMATS.iter())
                    .filter(|format| asked.is_none_or(|asked| asked.id == format.id))
                    .map(|format| format!("{} ({})", format.id, format.layout))
                    .collect::<Vec<_>>();
                Err(ExchangeError::new(
                    first,
                    "its content is of no known layout",
                    format!("there are: {}", layouts.join("; ")),
                ))
            }
        }
    }
}

/// The HDF5 files, all opened: formats have one or two.
fn opened(files: &[PathBuf]) -> Result<Vec<(Hdf5, Vec<String>)>, ExchangeError> {
    if let [_, _, third, ..] = files {
        let what = format!("{} HDF5 files", files.len());
        return Err(ExchangeError::new(
            third,
            what,
            "name one with features and one with matches",
        ));
    }
    (files.iter())
        .map(|path| {
            let file = Hdf5::open(path)?;
            let arrays = file.arrays()?;
            Ok((file, arrays))
        })
        .collect()
}

/// The first bytes of a kind of file, and the kind; `None` for any other.
fn magic(path: &Path) -> Result<Option<(&'static [u8], &'static str)>, ExchangeError> {
    const KNOWN: [(&[u8], &str); 4] = [
        (b"PK\x03\x04", "npz"),
        // An archive without any array.
        (b"PK\x05\x06", "npz"),
        (b"\x89HDF\r\n\x1a\n", "hdf5"),
        (b"SQLite format 3\0", "sqlite"),
    ];
    let mut start = Vec::new();
    open_file(path)
        .and_then(|file| file.take(16).read_to_end(&mut start))
        .map_err(|error| ExchangeError::unreadable(path, error))?;
    Ok(KNOWN
        .into_iter()
        .find(|(magic, _)| start.starts_with(magic)))
}

/// The visible files of a folder that may hold matches, by name.
fn files_in(folder: &Path) -> Result<Vec<PathBuf>, ExchangeError> {
    let unreadable = |error| ExchangeError::unreadable(folder, error);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let hidden = (path.file_name()).is_some_and(|name| name.as_encoded_bytes()[0] == b'.');
        let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default();
        if !hidden && ENDINGS.contains(&ending) {
            files.push(path);
        }
        if files.len() > MAX_FILES {
            let what = format!("more than {MAX_FILES} files");
            return Err(ExchangeError::new(folder, what, "pack them into one file"));
        }
    }
    if files.is_empty() {
        let what = format!("no file of matches ({}) is in it", ENDINGS.join(", "));
        return Err(ExchangeError::new(folder, what, "check the path"));
    }
    files.sort();
    Ok(files)
}
