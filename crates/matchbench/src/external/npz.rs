//! Arrays in numpy's file format, of which nothing is believed.
//!
//! An `.npz` file is a zip of `.npy` files, stored or deflated. An `.npy` file is the bytes `\x93NUMPY`,
//! a version, the length of a header, the header as the text of a Python dictionary (`{'descr': '<f4',
//! 'fortran_order': False, 'shape': (498, 2), }`), and the values ("NEP 1: A simple file format for
//! NumPy arrays").

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use zip::ZipArchive;

/// Most bytes of one array.
const MOST_BYTES: usize = 1 << 30;
/// Most arrays of a file.
const MOST_ARRAYS: usize = 64;
/// Longest header of an array.
const LONGEST_HEADER: usize = 1 << 16;

/// An array in row-major order.
#[derive(Debug)]
pub(super) struct Array {
    /// Type of the values as numpy writes it, `<f4` or `|u1`.
    pub(super) kind: String,
    /// Its extents.
    pub(super) shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// The arrays of the file at `path` by name.
///
/// # Errors
/// If it is no such file, in words.
pub(super) fn read_npz(path: &Path) -> Result<BTreeMap<String, Array>, String> {
    let about = std::fs::metadata(path).map_err(|error| error.to_string())?;
    if !about.is_file() {
        return Err("is no file".into());
    }
    let file = File::open(path).map_err(|error| error.to_string())?;
    let mut archive = ZipArchive::new(BufReader::new(file))
        .map_err(|error| format!("is no .npz file: {error}"))?;
    if archive.len() > MOST_ARRAYS {
        return Err(format!("has {} arrays", archive.len()));
    }
    let mut arrays = BTreeMap::new();
    for index in 0..archive.len() {
        let entry = (archive.by_index(index)).map_err(|error| format!("is damaged: {error}"))?;
        let name = entry
            .name()
            .map_err(|error| format!("is damaged: {error}"))?;
        let name = name.trim_end_matches(".npy").to_owned();
        let array = read_npy(entry).map_err(|wrong| format!("array `{name}` {wrong}"))?;
        arrays.insert(name, array);
    }
    Ok(arrays)
}

fn read_npy(mut stream: impl Read) -> Result<Array, String> {
    let damaged = |error: std::io::Error| format!("is damaged: {error}");
    let mut start = [0; 8];
    stream.read_exact(&mut start).map_err(damaged)?;
    let [magic @ .., major, _minor] = start;
    if magic != *b"\x93NUMPY" {
        return Err("is no array of numpy".into());
    }
    let mut length = [0; 4];
    let digits = if major == 1 { 2 } else { 4 };
    stream.read_exact(&mut length[..digits]).map_err(damaged)?;
    let length = u32::from_le_bytes(length) as usize;
    if length > LONGEST_HEADER {
        return Err(format!("has a header of {length} bytes"));
    }
    let mut header = vec![0; length];
    stream.read_exact(&mut header).map_err(damaged)?;
    let header = String::from_utf8_lossy(&header);
    let (kind, shape) = parse_header(&header).ok_or("has a header that is not understood")?;
    let value = bytes_of(&kind).ok_or_else(|| format!("has values of type {kind}"))?;
    let bytes = (shape.iter()).try_fold(value, |bytes, &extent| bytes.checked_mul(extent));
    let bytes = bytes
        .filter(|&bytes| bytes <= MOST_BYTES)
        .ok_or_else(|| format!("is too large: {shape:?}"))?;
    let mut values = Vec::new();
    // One more than there should be, to notice it. Memory grows with what is there.
    (stream.take(bytes as u64 + 1).read_to_end(&mut values)).map_err(damaged)?;
    if values.len() != bytes {
        return Err(format!(
            "does not have the {bytes} bytes of its shape {shape:?}"
        ));
    }
    Ok(Array {
        kind,
        shape,
        bytes: values,
    })
}

/// Type and shape; `None` if they are not there, or the array is stored column by column.
fn parse_header(header: &str) -> Option<(String, Vec<usize>)> {
    let after = |key: &str| Some(header.split_once(&format!("'{key}':"))?.1.trim_start());
    let kind = after("descr")?.strip_prefix('\'')?.split_once('\'')?.0;
    if !after("fortran_order")?.starts_with("False") {
        return None;
    }
    let shape = after("shape")?.strip_prefix('(')?.split_once(')')?.0;
    let extents = shape
        .split(',')
        .map(str::trim)
        .filter(|extent| !extent.is_empty());
    let shape: Option<Vec<usize>> = extents.map(|extent| extent.parse().ok()).collect();
    Some((kind.to_owned(), shape?))
}

fn bytes_of(kind: &str) -> Option<usize> {
    match kind {
        "|u1" => Some(1),
        "<f2" => Some(2),
        "<f4" => Some(4),
        "<f8" => Some(8),
        _ => None,
    }
}

impl Array {
    /// The values as `f32`.
    pub(super) fn to_f32(&self) -> Vec<f32> {
        fn values<const N: usize>(bytes: &[u8], value: impl Fn([u8; N]) -> f32) -> Vec<f32> {
            bytes
                .as_chunks()
                .0
                .iter()
                .map(|&bytes| value(bytes))
                .collect()
        }
        match self.kind.as_str() {
            "|u1" => self.bytes.iter().map(|&byte| f32::from(byte)).collect(),
            "<f2" => values(&self.bytes, |bytes| half(u16::from_le_bytes(bytes))),
            "<f8" => values(&self.bytes, |bytes| f64::from_le_bytes(bytes) as f32),
            _ => values(&self.bytes, f32::from_le_bytes),
        }
    }

    /// The bytes, if that is what its values are.
    pub(super) fn as_bytes(&self) -> Option<&[u8]> {
        (self.kind == "|u1").then_some(&self.bytes)
    }
}

/// The value of an IEEE 754 half-precision number, exactly.
fn half(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * 2.0_f32.powi(-24),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (fraction + 1024.0) * 2.0_f32.powi(exponent - 25),
    }
}

#[cfg(test)]
pub(super) mod testing {
    use std::io::Write;
    use std::path::Path;

    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    /// An `.npy` file.
    pub(in super::super) fn npy(kind: &str, shape: &str, bytes: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(bytes);
        file
    }

    /// An array of `f32`.
    pub(in super::super) fn floats(shape: &str, values: &[f32]) -> Vec<u8> {
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        npy("<f4", shape, &bytes)
    }

    /// Writes `arrays` as an `.npz` file.
    pub(in super::super) fn write_npz(path: &Path, arrays: &[(&str, Vec<u8>)]) {
        let mut archive = ZipWriter::new(std::fs::File::create(path).unwrap());
        for (name, array) in arrays {
            let options = SimpleFileOptions::default();
            archive.start_file(format!("{name}.npy"), options).unwrap();
            archive.write_all(array).unwrap();
        }
        archive.finish().unwrap();
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::testing::{npy, write_npz};
    use super::*;

    #[test]
    fn arrays_of_all_types_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npz");
        let doubles: Vec<u8> = [0.5_f64, -3.0]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        write_npz(
            &path,
            &[
                ("bytes", npy("|u1", "(3,)", &[0, 7, 255])),
                (
                    "halves",
                    npy("<f2", "(1, 4)", &[0, 60, 0, 192, 1, 0, 255, 123]),
                ),
                ("doubles", npy("<f8", "(2, 1)", &doubles)),
                ("none", npy("<f4", "(0, 128)", &[])),
            ],
        );
        let arrays = read_npz(&path).unwrap();
        assert_eq!(arrays["bytes"].to_f32(), [0.0, 7.0, 255.0]);
        assert_eq!(
            arrays["halves"].to_f32(),
            [1.0, -2.0, 2.0_f32.powi(-24), 65504.0]
        );
        assert_eq!(arrays["doubles"].to_f32(), [0.5, -3.0]);
        assert_eq!(arrays["doubles"].shape, [2, 1]);
        assert_eq!(arrays["none"].shape, [0, 128]);
        assert!(half(0x7c00) == f32::INFINITY && half(0xfe00).is_nan());
    }

    #[test]
    fn what_is_no_array_is_refused() {
        for (bytes, named) in [
            (npy("<f4", "(2,)", &[0; 7]), "8 bytes"),
            (npy("<f4", "(2,)", &[0; 9]), "8 bytes"),
            (npy("<f4", "(99999999999, 99999999999)", &[]), "too large"),
            (npy("<f4", "(400000000,)", &[]), "too large"),
            (npy("|O", "(2,)", &[0; 8]), "|O"),
            (npy("<f4", "(2", &[0; 8]), "not understood"),
            (b"PK".to_vec(), "damaged"),
        ] {
            let wrong = read_npy(&bytes[..]).unwrap_err();
            assert!(wrong.contains(named), "{wrong}");
        }
        let columns = String::from_utf8_lossy(&npy("<f4", "(1, 2)", &[0; 8])).into_owned();
        assert!(parse_header(&columns.replace("False", "True")).is_none());
        assert!(read_npz(Path::new("/")).unwrap_err().contains("no file"));
    }

    proptest! {
        #[test]
        fn no_bytes_panic(header in ".{0,80}", tail in proptest::collection::vec(any::<u8>(), 0..40)) {
            let mut file = b"\x93NUMPY\x01\x00".to_vec();
            file.extend((header.len() as u16).to_le_bytes());
            file.extend(header.as_bytes());
            file.extend(&tail);
            let _ = read_npy(&file[..]);
            let _ = read_npy(&tail[..]);
        }
    }
}
