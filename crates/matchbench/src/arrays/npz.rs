//! numpy's archives: `.npz`, a zip file of arrays in the `.npy` format, stored or deflated.
//!
//! The zip container is read by the `zip` crate.

use std::fs::File;
use std::io::{BufReader, Cursor, Write};
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::ArrayError;
use super::array::{Array, MAX_BYTES};
use super::npy::{header, read_array, stated_elements, stated_shape};
use crate::files::open_file;

/// The most members of an archive, since each name is kept in memory.
const MAX_MEMBERS: usize = 4096;

/// An opened `.npz`.
#[derive(Debug)]
pub(crate) struct Npz {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    /// The most bytes that an array may have.
    most_bytes: u64,
}

impl Npz {
    /// Opens the archive.
    ///
    /// # Errors
    /// If it cannot be read or is not a zip file.
    pub(crate) fn open(path: &Path) -> Result<Self, ArrayError> {
        let file = open_file(path).map_err(|error| ArrayError::unreadable(path, error))?;
        let zip = ZipArchive::new(BufReader::new(file))
            .map_err(|error| ArrayError::damaged(path, format!("no zip file ({error})")))?;
        if zip.len() > MAX_MEMBERS {
            let what = format!("{} arrays in one file", zip.len());
            return Err(ArrayError::damaged(path, what));
        }
        Ok(Self {
            path: path.into(),
            zip,
            most_bytes: MAX_BYTES,
        })
    }

    /// The same archive, with this limit for the bytes of an array.
    pub(crate) fn with_arrays_of(mut self, bytes: usize) -> Self {
        self.most_bytes = MAX_BYTES.min(bytes as u64);
        self
    }

    /// The file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// How many elements each array of numbers says it has, and how many bytes each of them.
    pub(crate) fn stated_elements(&mut self) -> Vec<[u64; 2]> {
        let members = 0..self.zip.len();
        members
            .filter_map(|index| stated_elements(&mut self.zip.by_index(index).ok()?))
            .collect()
    }

    /// Names of the arrays.
    pub(crate) fn names(&self) -> Vec<String> {
        let names = self.zip.file_names().filter_map(Result::ok);
        names
            .filter_map(|name| Some(name.strip_suffix(".npy")?.to_owned()))
            .collect()
    }

    /// The shape that the array called `name` says it has; `None` if it is no array of numbers.
    pub(crate) fn stated_shape(&mut self, name: &str) -> Option<Vec<usize>> {
        let mut file = self.zip.by_name(&format!("{name}.npy")).ok()?;
        stated_shape(&mut file)
    }

    /// The array called `name`, if there is one.
    ///
    /// # Errors
    /// If it cannot be read, or is not an array of numbers.
    pub(crate) fn find(&mut self, name: &str) -> Result<Option<Array>, ArrayError> {
        let member = format!("{name}.npy");
        if self.zip.index_for_name(&member).is_none() {
            return Ok(None);
        }
        let most_bytes = self.most_bytes;
        let array = (self.zip.by_name(&member).map_err(|error| error.to_string()))
            .and_then(|mut file| read_array(&mut file, most_bytes));
        array
            .map(Some)
            .map_err(|what| ArrayError::damaged(&self.path, what).of(name))
    }

    /// The array called `name`.
    ///
    /// # Errors
    /// If it is missing or cannot be read.
    pub(crate) fn array(&mut self, name: &str) -> Result<Array, ArrayError> {
        self.find(name)?.ok_or_else(|| {
            let has = self.names().join(", ");
            ArrayError {
                remedy: "write it with numpy.savez",
                ..ArrayError::damaged(
                    &self.path,
                    format!("there is no array `{name}` (there are: {has})"),
                )
            }
        })
    }
}

/// The bytes of an archive of arrays. Each array is given by a name, a shape, numpy's name of its type, and
/// little-endian elements. The same arrays give the same bytes.
pub(crate) fn npz(arrays: &[(&str, &[usize], &str, Vec<u8>)]) -> Vec<u8> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::DEFAULT);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, shape, descr, bytes) in arrays {
        let large = bytes.len() as u64 >= u64::from(u32::MAX) / 2;
        zip.start_file(format!("{name}.npy"), options.large_file(large))
            .and_then(|()| Ok(zip.write_all(&header(descr, shape))?))
            .and_then(|()| Ok(zip.write_all(bytes)?))
            .expect("memory takes all");
    }
    zip.finish().expect("memory takes all").into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened(bytes: &[u8]) -> (tempfile::TempDir, Result<Npz, ArrayError>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.npz");
        std::fs::write(&path, bytes).unwrap();
        let archive = Npz::open(&path);
        (folder, archive)
    }

    fn floats(values: &[f32]) -> Vec<u8> {
        values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect()
    }

    #[test]
    fn what_is_written_comes_back() {
        let numbers = [1.5, -2.0, 0.25, 1e-7, 3.0, 4.0];
        let bytes = npz(&[
            ("a", &[3, 2], "<f4", floats(&numbers)),
            (
                "n",
                &[2],
                "<i8",
                [7i64, -1].iter().flat_map(|n| n.to_le_bytes()).collect(),
            ),
        ]);
        let (_folder, archive) = opened(&bytes);
        let mut archive = archive.unwrap();
        assert_eq!(archive.names(), ["a", "n"]);
        assert_eq!(archive.stated_shape("a"), Some(vec![3, 2]));
        assert_eq!(archive.stated_shape("c"), None);
        assert_eq!(archive.stated_elements(), [[6, 4], [2, 8]]);
        let a = archive.array("a").unwrap();
        assert_eq!(a.rows(2), Ok(3));
        assert_eq!(a.to_vec(), numbers.map(f64::from));
        assert_eq!(archive.array("n").unwrap().to_vec(), [7.0, -1.0]);
        let mut archive = archive.with_arrays_of(16);
        assert!(archive.array("n").is_ok());
        assert!(archive.array("a").unwrap_err().what().contains("is larger"));
        let message = archive.array("c").unwrap_err().what();
        assert!(
            message.contains("no array `c` (there are: a, n)"),
            "{message}"
        );
        assert!(
            Npz::open(Path::new("/"))
                .unwrap_err()
                .what
                .contains("file is needed")
        );
    }

    #[test]
    fn another_compression_is_not_called_a_cut() {
        const BZIP2: u8 = 12;
        let mut bytes = npz(&[("a", &[1], "<f4", floats(&[1.5]))]);
        let listed = bytes
            .windows(4)
            .position(|four| four == b"PK\x01\x02")
            .unwrap();
        (bytes[8], bytes[listed + 10]) = (BZIP2, BZIP2);
        let (_folder, archive) = opened(&bytes);
        let error = archive.unwrap().array("a").unwrap_err().what();
        assert!(
            error.contains("compression method not supported") && !error.contains("cut off"),
            "{error}"
        );
    }

    #[test]
    fn every_cut_of_an_archive_is_an_error() {
        let bytes = npz(&[("a", &[3, 2], "<f4", floats(&[0.0; 6]))]);
        for length in 0..bytes.len() {
            let (_folder, archive) = opened(&bytes[..length]);
            let read = archive.and_then(|mut archive| archive.array("a"));
            assert!(read.is_err(), "{length} of {} bytes", bytes.len());
        }
    }
}
