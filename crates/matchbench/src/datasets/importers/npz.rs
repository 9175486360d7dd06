//! NumPy's arrays: `.npy`, and `.npz`, a zip of them.
//!
//! An array is a text header, a dictionary that names type, order and shape, and then the numbers.
//! Arrays of Python objects, which are pickles, are refused here (`pickle` reads one kind of them).
//! What a header claims is compared with the bytes that are there before memory is asked for.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use crate::datasets::DatasetError;

/// Most bytes that one array may have: lists of pairs have some hundred thousand.
const MAX_BYTES: u64 = 1 << 28;
const REMEDY: &str = "give the file as its authors publish it";
const MAGIC: &[u8] = b"\x93NUMPY";

/// An array of numbers, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
}

/// An open `.npz`.
#[derive(Debug)]
pub(super) struct Npz {
    path: PathBuf,
    zip: zip::ZipArchive<BufReader<File>>,
}

impl Npz {
    pub(super) fn open(path: &Path) -> Result<Self, DatasetError> {
        let file = File::open(path).map_err(|error| DatasetError::io(path, &error))?;
        let zip = zip::ZipArchive::new(BufReader::new(file)).map_err(|error| {
            let what = format!("this is no .npz: {error}");
            DatasetError::new(path, what, "give the file as numpy.savez writes it")
        })?;
        let path = path.to_owned();
        Ok(Self { path, zip })
    }

    /// The array of that name.
    pub(super) fn array(&mut self, name: &str) -> Result<Array, DatasetError> {
        let path = &self.path;
        let fail = |what: String| DatasetError::new(path, what, REMEDY);
        let stored = self.zip.by_name(&format!("{name}.npy"));
        let stored = stored.map_err(|error| fail(format!("the array `{name}`: {error}")))?;
        let mut bytes = Vec::new();
        let read = stored.take(MAX_BYTES + 1).read_to_end(&mut bytes);
        read.map_err(|error| fail(format!("the array `{name}`: {error}")))?;
        if bytes.len() as u64 > MAX_BYTES {
            return Err(fail(format!(
                "the array `{name}` has more than {MAX_BYTES} bytes"
            )));
        }
        parse(&bytes).map_err(|what| fail(format!("the array `{name}`: {what}")))
    }

    /// An error about one of the arrays.
    pub(super) fn error(&self, what: String) -> DatasetError {
        DatasetError::new(&self.path, what, REMEDY)
    }
}

/// The array of an `.npy` file.
fn parse(bytes: &[u8]) -> Result<Array, String> {
    let cut = || "the header is cut off".to_owned();
    let rest = bytes.strip_prefix(MAGIC).ok_or("this is no .npy")?;
    let (&[version, _minor], rest) = rest.split_first_chunk().ok_or_else(cut)?;
    let (length, rest) = match version {
        1 => {
            let (length, rest) = rest.split_first_chunk().ok_or_else(cut)?;
            (usize::from(u16::from_le_bytes(*length)), rest)
        }
        2 | 3 => {
            let (length, rest) = rest.split_first_chunk().ok_or_else(cut)?;
            (u32::from_le_bytes(*length) as usize, rest)
        }
        other => return Err(format!("version {other} of .npy is not known")),
    };
    let (header, data) = rest.split_at_checked(length).ok_or_else(cut)?;
    let header = std::str::from_utf8(header).map_err(|_| "the header is no text".to_owned())?;
    let kind = quoted(after(header, "'descr':")?)?;
    let by_columns = match after(header, "'fortran_order':")? {
        text if text.starts_with("False") => false,
        text if text.starts_with("True") => true,
        _ => return Err("fortran_order is neither True nor False".to_owned()),
    };
    let shape = shape(after(header, "'shape':")?)?;
    Array::new(&kind, shape, by_columns, data)
}

/// What follows a key of the header.
fn after<'a>(header: &'a str, key: &str) -> Result<&'a str, String> {
    let at = header
        .find(key)
        .ok_or_else(|| format!("the header has no {key}"))?;
    Ok(header[at + key.len()..].trim_start())
}

fn quoted(text: &str) -> Result<String, String> {
    let inside = text
        .strip_prefix('\'')
        .and_then(|text| text.split_once('\''));
    let (inside, _) = inside.ok_or("the type of the numbers is not a plain one")?;
    Ok(inside.to_owned())
}

fn shape(text: &str) -> Result<Vec<usize>, String> {
    let inside = text.strip_prefix('(').and_then(|text| text.split_once(')'));
    let (inside, _) = inside.ok_or("the shape is not in brackets")?;
    (inside.split(','))
        .map(str::trim)
        .filter(|side| !side.is_empty())
        .map(|side| {
            side.parse()
                .map_err(|_| format!("`{side}` is no side of a shape"))
        })
        .collect()
}

impl Array {
    /// Numbers of NumPy's type `kind` (`<f8`, `u2` ...) from their bytes. Values of single
    /// precision become the shortest decimals that round to them: what was printed with a few
    /// digits comes back as it was printed.
    pub(super) fn new(
        kind: &str,
        shape: Vec<usize>,
        by_columns: bool,
        data: &[u8],
    ) -> Result<Self, String> {
        let plain = kind.trim_start_matches(['<', '|', '=']);
        let width = match plain {
            "f8" | "i8" | "u8" => 8,
            "f4" | "i4" | "u4" => 4,
            "i2" | "u2" => 2,
            "i1" | "u1" | "b1" => 1,
            _ => return Err(format!("numbers of type `{kind}` are not read")),
        };
        let count = shape
            .iter()
            .try_fold(1_usize, |count, &side| count.checked_mul(side));
        let fits = |count: &usize| count.checked_mul(width) == Some(data.len());
        let Some(count) = count.filter(fits) else {
            return Err(format!(
                "{} bytes for {shape:?} numbers of {width} bytes",
                data.len()
            ));
        };
        let number = |bytes: &[u8]| -> f64 {
            fn le<const N: usize>(bytes: &[u8]) -> [u8; N] {
                bytes.try_into().expect("chunks have this width")
            }
            match plain {
                "f8" => f64::from_le_bytes(le(bytes)),
                "f4" => decimal(f32::from_le_bytes(le(bytes))),
                "i8" => i64::from_le_bytes(le(bytes)) as f64,
                "u8" => u64::from_le_bytes(le(bytes)) as f64,
                "i4" => i32::from_le_bytes(le(bytes)).into(),
                "u4" => u32::from_le_bytes(le(bytes)).into(),
                "i2" => i16::from_le_bytes(le(bytes)).into(),
                "u2" => u16::from_le_bytes(le(bytes)).into(),
                "i1" => i8::from_le_bytes(le(bytes)).into(),
                _ => bytes[0].into(),
            }
        };
        let mut values: Vec<f64> = data.chunks_exact(width).map(number).collect();
        if by_columns && shape.len() > 1 {
            let [rows, columns] = shape[..] else {
                return Err("an array of three sides in Fortran's order is not read".to_owned());
            };
            values = (0..count)
                .map(|k| values[k % columns * rows + k / columns])
                .collect();
        }
        Ok(Self { shape, values })
    }

    /// The rows of a table of that many columns.
    pub(super) fn rows(&self, columns: usize) -> Result<std::slice::ChunksExact<'_, f64>, String> {
        match self.shape[..] {
            [_, found] if found == columns && columns > 0 => Ok(self.values.chunks_exact(columns)),
            _ => Err(format!(
                "the shape is {:?} where N x {columns} is expected",
                self.shape
            )),
        }
    }
}

fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn types_orders_and_shapes_are_read() {
        let f4 = [0.97598_f32, -0.05925].map(f32::to_le_bytes).concat();
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (2,), }  \n";
        let found = parse(&npy(header, &f4)).unwrap();
        assert_eq!(found.shape, [2]);
        assert_eq!(found.values, [0.97598, -0.05925], "as they were printed");
        let u2: Vec<u8> = (0..6_u16).flat_map(u16::to_le_bytes).collect();
        let header = "{'descr': '<u2', 'fortran_order': True, 'shape': (2, 3)}";
        let found = parse(&npy(header, &u2)).unwrap();
        assert_eq!(found.values, [0., 2., 4., 1., 3., 5.]);
        assert_eq!(found.rows(3).unwrap().count(), 2);
        assert!(found.rows(2).is_err());
    }

    #[test]
    fn what_is_claimed_must_be_there() {
        let header = |kind: &str, shape: &str| {
            format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape})}}")
        };
        for (kind, shape, word) in [
            ("<f8", "99999999999, 99999999999", "bytes for"),
            ("<f8", "3", "bytes for"),
            ("|O", "2", "type `|O`"),
            (">f8", "2", "type `>f8`"),
            ("<f8", "-1", "no side"),
        ] {
            let error = parse(&npy(&header(kind, shape), &[0; 16])).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
        assert!(parse(&npy(&header("<f8", "2"), &[0; 16])).is_ok());
        assert!(parse(&npy(&header("<f8", "2"), &[0; 16])[..20]).is_err());
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..80), text in ".{0,60}") {
            let _ = parse(&bytes);
            let _ = parse(&npy(&text, &bytes));
        }
    }
}
