//! numpy's archives: `.npz`, a zip file of arrays in the `.npy` format.
//!
//! An `.npy` begins with `\x93NUMPY`, a version (2 bytes), the length of the header (2 bytes in
//! version 1, 4 in 2 and 3, little-endian) and the header, the text of a Python dictionary
//! `{'descr': '<f4', 'fortran_order': False, 'shape': (30, 2), }`; then come the elements. (numpy,
//! "NEP 1, A Simple File Format for NumPy Arrays".) Only arrays of numbers are read: arrays of
//! objects are pickles, which can run code, and are refused.
//!
//! The header is scanned here rather than parsed as Python: three known keys, no recursion, so
//! that no header can exhaust the stack. The zip container is read by the `zip` crate.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Write};
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::ExchangeError;
use super::array::{Array, Element, Kind, MOST_BYTES, bytes_of};

const MAGIC: &[u8] = b"\x93NUMPY";
/// numpy itself refuses longer headers.
const MOST_HEADER: usize = 10_000;
/// The most members that an archive may have; each name is held in memory.
const MOST_MEMBERS: usize = 4096;

/// An opened `.npz`.
pub(super) struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
}

impl Archive {
    /// Opens the archive.
    ///
    /// # Errors
    /// If it cannot be read or is no zip file.
    pub(super) fn open(path: &Path) -> Result<Self, ExchangeError> {
        let file = super::regular::open_regular(path)?;
        let zip = ZipArchive::new(BufReader::new(file))
            .map_err(|error| ExchangeError::damaged(path, format!("no zip file ({error})")))?;
        if zip.len() > MOST_MEMBERS {
            let what = format!("{} arrays in one file", zip.len());
            return Err(ExchangeError::damaged(path, what));
        }
        Ok(Self {
            path: path.into(),
            zip,
        })
    }

    /// Names of the arrays.
    pub(super) fn names(&self) -> Vec<String> {
        let names = self.zip.file_names().filter_map(Result::ok);
        names
            .filter_map(|name| Some(name.strip_suffix(".npy")?.to_owned()))
            .collect()
    }

    /// The array called `name`, if there is one.
    ///
    /// # Errors
    /// If it cannot be read, or is no array of numbers.
    pub(super) fn find(&mut self, name: &str) -> Result<Option<Array>, ExchangeError> {
        let member = format!("{name}.npy");
        if self.zip.index_for_name(&member).is_none() {
            return Ok(None);
        }
        let array = (self.zip.by_name(&member).map_err(|error| error.to_string()))
            .and_then(|mut file| read_array(&mut file));
        array
            .map(Some)
            .map_err(|what| ExchangeError::damaged(&self.path, what).at(format!("array `{name}`")))
    }

    /// The array called `name`.
    ///
    /// # Errors
    /// If it is missing or cannot be read.
    pub(super) fn array(&mut self, name: &str) -> Result<Array, ExchangeError> {
        self.find(name)?.ok_or_else(|| {
            let has = self.names().join(", ");
            ExchangeError::new(
                &self.path,
                format!("there is no array `{name}` (there are: {has})"),
                "write it with numpy.savez",
            )
        })
    }
}

/// The bytes of an archive of arrays, each a name, a shape and an array of little-endian elements
/// with numpy's name of their type. The same arrays give the same bytes.
pub(super) fn archive(arrays: &[(&str, &[usize], &str, Vec<u8>)]) -> Vec<u8> {
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

/// The header of an array, padded so that the elements begin at a multiple of 64 bytes.
fn header(descr: &str, shape: &[usize]) -> Vec<u8> {
    let sides: String = shape
        .iter()
        .flat_map(|side| [side.to_string(), ", ".into()])
        .collect();
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({sides}), }}");
    let before = MAGIC.len() + 4;
    let padding = (before + text.len() + 1).next_multiple_of(64) - (before + text.len() + 1);
    text.push_str(&" ".repeat(padding));
    text.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend(
        u16::try_from(text.len())
            .expect("a short header")
            .to_le_bytes(),
    );
    bytes.extend(text.as_bytes());
    bytes
}

fn read_array(file: &mut impl Read) -> Result<Array, String> {
    let mut start = [0; 8];
    read(file, &mut start)?;
    if !start.starts_with(MAGIC) {
        return Err("it is no .npy array".into());
    }
    let length = match start[6] {
        1 => {
            let mut length = [0; 2];
            read(file, &mut length)?;
            usize::from(u16::from_le_bytes(length))
        }
        2 | 3 => {
            let mut length = [0; 4];
            read(file, &mut length)?;
            u32::from_le_bytes(length) as usize
        }
        version => return Err(format!(".npy version {version} is not known")),
    };
    if length > MOST_HEADER {
        return Err(format!("its header claims {length} bytes"));
    }
    let mut header = vec![0; length];
    read(file, &mut header)?;
    let header = String::from_utf8_lossy(&header);
    let (element, shape) = parse_header(&header)
        .ok_or_else(|| format!("its header `{}` is not understood", header.trim_end()))??;
    let size = bytes_of(&shape, element).filter(|&bytes| bytes <= MOST_BYTES);
    let size = size.ok_or_else(|| format!("its shape {shape:?} is larger than 1 GiB"))?;
    let mut bytes = Vec::new();
    // Memory grows with what is there, not with what is claimed.
    (file.take(size + 1).read_to_end(&mut bytes)).map_err(|error| error.to_string())?;
    if bytes.len() as u64 > size {
        return Err("it is longer than its header says".into());
    }
    Array::new(shape, element, bytes)
}

fn read(file: &mut impl Read, into: &mut [u8]) -> Result<(), String> {
    (file.read_exact(into)).map_err(|error| format!("it is cut off ({error})"))
}

/// Type and shape; `None` where the header has another form, an error where it is understood and
/// refused.
fn parse_header(header: &str) -> Option<Result<(Element, Vec<usize>), String>> {
    let value = |key: &str| {
        let (_, rest) = header.split_once(&format!("'{key}':"))?;
        Some(rest.trim_start())
    };
    let descr = value("descr")?.strip_prefix('\'')?.split_once('\'')?.0;
    let fortran = value("fortran_order")?;
    let shape = value("shape")?.strip_prefix('(')?.split_once(')')?.0;
    let mut sides = Vec::new();
    for side in shape
        .split(',')
        .map(str::trim)
        .filter(|side| !side.is_empty())
    {
        sides.push(side.parse().ok()?);
    }
    if sides.len() > 8 {
        return None;
    }
    let flat = sides.len() < 2 || sides.contains(&0);
    if !fortran.starts_with("False") && !flat {
        return Some(Err(
            "it is stored column by column; write numpy.ascontiguousarray of it".into(),
        ));
    }
    let Some(element) = element(descr) else {
        return Some(Err(format!("its elements are `{descr}`, not numbers")));
    };
    Some(Ok((element, sides)))
}

/// The type that numpy calls `descr`, for example `<f4`; `|i1` has one byte and so no order.
fn element(descr: &str) -> Option<Element> {
    let mut letters = descr.chars();
    let big_endian = match letters.next()? {
        '<' | '|' => false,
        '>' => true,
        _ => return None,
    };
    let kind = match letters.next()? {
        'f' => Kind::Float,
        'i' => Kind::Signed,
        'u' => Kind::Unsigned,
        _ => return None,
    };
    Element::new(kind, letters.as_str().parse().ok()?, big_endian)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened(bytes: &[u8]) -> (tempfile::TempDir, Result<Archive, ExchangeError>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.npz");
        std::fs::write(&path, bytes).unwrap();
        let archive = Archive::open(&path);
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
        let bytes = archive(&[
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
        let a = archive.array("a").unwrap();
        assert_eq!(a.rows(2), Ok(3));
        assert_eq!(a.to_vec(), numbers.map(f64::from));
        assert_eq!(archive.array("n").unwrap().to_vec(), [7.0, -1.0]);
        let message = archive.array("c").unwrap_err().to_string();
        assert!(
            message.contains("no array `c` (there are: a, n)"),
            "{message}"
        );
    }

    /// An array with this header and these elements.
    fn npy(header: &str, elements: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(elements);
        bytes
    }

    #[test]
    fn headers_that_lie_are_refused_without_memory() {
        let good = npy(
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }",
            &[0; 8],
        );
        assert!(read_array(&mut &good[..]).is_ok());
        for (header, named) in [
            (
                "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3), }",
                "does not fit",
            ),
            (
                "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 1), }",
                "longer",
            ),
            (
                "{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999, 2), }",
                "larger than 1 GiB",
            ),
            (
                "{'descr': '<f4', 'fortran_order': False, 'shape': (18446744073709551615, 99), }",
                "larger than 1 GiB",
            ),
            (
                "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 1), }",
                "column by column",
            ),
            (
                "{'descr': '|O', 'fortran_order': False, 'shape': (1, 2), }",
                "not numbers",
            ),
            (
                "{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 2), }",
                "not understood",
            ),
            ("((((((((((((((((((((((((", "not understood"),
        ] {
            let message = read_array(&mut &npy(header, &[0; 8])[..]).unwrap_err();
            assert!(message.contains(named), "{header}: {message}");
        }
        let message = read_array(&mut &good[..20]).unwrap_err();
        assert!(message.contains("cut off"), "{message}");
    }

    #[test]
    fn every_cut_of_an_archive_is_an_error() {
        let bytes = archive(&[("a", &[3, 2], "<f4", floats(&[0.0; 6]))]);
        for length in 0..bytes.len() {
            let (_folder, archive) = opened(&bytes[..length]);
            let read = archive.and_then(|mut archive| archive.array("a"));
            assert!(read.is_err(), "{length} of {} bytes", bytes.len());
        }
    }
}
