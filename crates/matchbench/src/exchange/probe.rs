//! Finds which files a path holds that may have matches, and of what kind they are by their first bytes.

use std::ffi::OsStr;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::ExchangeError;
use super::found::some_of;
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
    /// How many files of the folder were passed over, since others are called as files of matches are.
    pub(super) passed_over: usize,
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
        let (files, passed_over) = match paths {
            [path] if path.is_dir() => {
                let inner = path.join(dataset);
                if inner.is_dir() {
                    files_in(&inner)?
                        .ok_or_else(|| without_matches(&inner, "", "check the path"))?
                } else {
                    files_in(path)?.ok_or_else(|| of_other_datasets(path, dataset))?
                }
            }
            paths => (paths.to_vec(), 0),
        };
        let Some(first) = files.first() else {
            return Err(ExchangeError::new("", "no file is named", "name one"));
        };
        let kind = |path: &Path| match magic(path)? {
            Some((_, kind)) => Ok(kind),
            None if ending_of(path) == "txt" => Ok("text"),
            None => Err(ExchangeError::new(
                path,
                "it is no .npz, HDF5, SQLite or .txt file",
                "see `matchbench list formats` for what can be read",
            )),
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
            _ => Content::Text,
        };
        Ok(Self {
            files,
            passed_over,
            content,
        })
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

/// The visible files of a folder that may hold matches, by name, and how many others were passed over; `None` if
/// none may. SuperGlue writes its matches beside evaluations and pictures of the same pairs, so if names say which
/// files have matches, these alone are taken.
fn files_in(folder: &Path) -> Result<Option<(Vec<PathBuf>, usize)>, ExchangeError> {
    let (mut files, mut others) = (Vec::new(), 0);
    for path in visible(folder)? {
        let path = path?;
        if ENDINGS.contains(&&*ending_of(&path)) {
            files.push(path);
        } else if path.is_file() {
            others += 1;
        }
        if files.len() > MAX_FILES {
            let what = format!("more than {MAX_FILES} files");
            return Err(ExchangeError::new(folder, what, "pack them into one file"));
        }
    }
    files.sort();
    let mut passed_over = 0;
    let is_called = |path: &PathBuf| pair_of_matches(path).is_some();
    if files.iter().any(is_called) {
        passed_over = files.len() + others;
        files.retain(is_called);
        passed_over -= files.len();
    }
    Ok((!files.is_empty()).then_some((files, passed_over)))
}

/// The ending of a file's name, in small letters.
fn ending_of(path: &Path) -> String {
    let ending = path.extension().and_then(OsStr::to_str);
    ending.unwrap_or_default().to_ascii_lowercase()
}

/// The names of the pair in the name of a file, if it is called as SuperGlue calls matches.
pub(super) fn pair_of_matches(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_string_lossy();
    Some(name.strip_suffix("_matches.npz")?.to_owned())
}

/// What a folder has, but for what is hidden.
fn visible(
    folder: &Path,
) -> Result<impl Iterator<Item = Result<PathBuf, ExchangeError>>, ExchangeError> {
    let unreadable = |error| ExchangeError::unreadable(folder, error);
    let entries = fs::read_dir(folder).map_err(unreadable)?;
    let is_hidden =
        |path: &Path| (path.file_name()).is_some_and(|name| name.as_encoded_bytes()[0] == b'.');
    Ok(entries
        .map(move |entry| Ok(entry.map_err(unreadable)?.path()))
        .filter(move |path| !path.as_ref().is_ok_and(|path| is_hidden(path))))
}

/// A folder has no files of matches; `but` says what it has.
fn without_matches(folder: &Path, but: &str, remedy: &str) -> ExchangeError {
    let what = format!("no file of matches ({}) is in it{but}", ENDINGS.join(", "));
    ExchangeError::new(folder, what, remedy)
}

/// A folder has no files of matches, and no folder that is called as the dataset.
fn of_other_datasets(folder: &Path, dataset: &str) -> ExchangeError {
    let paths = visible(folder).into_iter().flatten().flatten();
    let mut folders: Vec<_> = paths
        .filter(|path| path.is_dir())
        .filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()))
        .collect();
    folders.sort();
    let Some(folders) = some_of(&folders) else {
        return without_matches(folder, "", "check the path");
    };
    let but = format!(
        ", and none of its folders is called `{dataset}`, as the dataset is; there are: {folders}"
    );
    without_matches(
        folder,
        &but,
        "name the folder with the files, or call it as the dataset",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_file_is_named_and_not_the_sound_ones_beside_it() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        fs::write(at("0_1.npz"), "<html>404</html>").expect("writable");
        fs::write(at("0_2.npz"), b"PK\x05\x06").expect("writable");
        let said = Probe::new(&[folder.path().to_owned()], "castle");
        let said = said.err().expect("one is damaged").to_string();
        assert!(said.contains("0_1.npz: it is no .npz"), "{said}");
    }

    #[test]
    fn endings_may_be_of_capital_letters() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("0_1.TXT"), "1 2 3 4\n").expect("writable");
        let probe = Probe::new(&[folder.path().to_owned()], "castle").expect("it is a text");
        assert_eq!(probe.files.len(), 1);
        assert!(matches!(probe.content, Content::Text));
    }

    #[test]
    fn a_folder_that_has_those_of_other_datasets_names_them() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let refused = || {
            let found = Probe::new(&[folder.path().to_owned()], "castle");
            found.err().expect("no matches").to_string()
        };
        assert!(
            refused().ends_with("is in it; check the path"),
            "{}",
            refused()
        );
        for name in ["office", "kitchen", ".cache"] {
            fs::create_dir(folder.path().join(name)).expect("writable");
        }
        let said = refused();
        let named = "none of its folders is called `castle`, as the dataset is; there are: `kitchen`, `office`; name";
        assert!(said.contains(named), "{said}");
        fs::create_dir(folder.path().join("castle")).expect("writable");
        assert!(
            refused().contains("castle: no file of matches"),
            "{}",
            refused()
        );
    }
}
