//! numpy's file format for one array, `.npy`.
//!
//! It begins with `\x93NUMPY`, a version (2 bytes), the length of the header (2 bytes in version 1, 4 in
//! 2 and 3, little-endian) and the header, the text of a Python dictionary
//! `{'descr': '<f4', 'fortran_order': False, 'shape': (30, 2), }`; then come the elements. (numpy,
//! "NEP 1, A Simple File Format for NumPy Arrays".) Only arrays of numbers are read: arrays of
//! objects are pickles, which can run code, and are refused.
//!
//! The header is scanned here and not parsed as Python: it has three known keys and no recursion, so no header
//! can exhaust the stack.

use std::io::{ErrorKind, Read};

use super::array::{Array, Element, bytes_of};

const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header; numpy itself refuses longer ones.
const MAX_HEADER: usize = 10_000;
/// The most dimensions of an array.
pub(crate) const MAX_SIDES: usize = 8;

/// The header of an array, padded so that the elements begin at a multiple of 64 bytes.
pub(super) fn header(descr: &str, shape: &[usize]) -> Vec<u8> {
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

/// The array in `file`; nothing may follow it.
///
/// # Errors
/// If it is not an array, or does not agree with its header.
pub(super) fn read_array(file: &mut impl Read, most_bytes: u64) -> Result<Array, String> {
    let Header {
        element,
        by_columns,
        shape,
    } = read_header(file)?;
    let size = bytes_of(&shape, element).filter(|&bytes| bytes <= most_bytes);
    let size =
        size.ok_or_else(|| format!("its shape {shape:?} is larger than {most_bytes} bytes"))?;
    let mut bytes = Vec::new();
    // Memory grows with the bytes that exist, not with the claimed size.
    (file.take(size + 1).read_to_end(&mut bytes)).map_err(|error| error.to_string())?;
    if bytes.len() as u64 > size {
        return Err("it is longer than its header says".into());
    }
    if by_columns {
        Array::by_columns(shape, element, bytes)
    } else {
        Array::new(shape, element, bytes)
    }
}

/// How many elements the header of an array of numbers says it has, and how many bytes each of them.
pub(super) fn stated_elements(file: &mut impl Read) -> Option<[u64; 2]> {
    let Header { element, shape, .. } = read_header(file).ok()?;
    let size = element.size as u64;
    Some([bytes_of(&shape, element)? / size, size])
}

/// What the header of an array of numbers says of its shape.
pub(super) fn stated_shape(file: &mut impl Read) -> Option<Vec<usize>> {
    read_header(file).ok().map(|header| header.shape)
}

fn read_header(file: &mut impl Read) -> Result<Header, String> {
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
    if length > MAX_HEADER {
        return Err(format!("its header claims {length} bytes"));
    }
    let mut header = vec![0; length];
    read(file, &mut header)?;
    let header = String::from_utf8_lossy(&header);
    parse_header(&header)
        .ok_or_else(|| format!("its header `{}` is not understood", header.trim_end()))?
}

fn read(file: &mut impl Read, into: &mut [u8]) -> Result<(), String> {
    file.read_exact(into).map_err(|error| match error.kind() {
        ErrorKind::UnexpectedEof => format!("it is cut off ({error})"),
        _ => error.to_string(),
    })
}

struct Header {
    element: Element,
    by_columns: bool,
    shape: Vec<usize>,
}

/// The content of a header. `None` if it has another form; an error if it is understood but refused.
fn parse_header(header: &str) -> Option<Result<Header, String>> {
    let value = |key: &str| {
        let (_, rest) = header.split_once(&format!("'{key}':"))?;
        Some(rest.trim_start())
    };
    let descr = value("descr")?.strip_prefix('\'')?.split_once('\'')?.0;
    let by_columns = match value("fortran_order")? {
        text if text.starts_with("False") => false,
        text if text.starts_with("True") => true,
        _ => return None,
    };
    let sides = value("shape")?.strip_prefix('(')?.split_once(')')?.0;
    let mut shape = Vec::new();
    for side in (sides.split(',').map(str::trim)).filter(|side| !side.is_empty()) {
        shape.push(side.parse().ok()?);
    }
    if shape.len() > MAX_SIDES {
        return None;
    }
    let header = Element::of_numpy(descr).map(|element| Header {
        element,
        by_columns,
        shape,
    });
    Some(header.ok_or_else(|| format!("its elements are `{descr}`, not numbers")))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::array::MAX_BYTES;
    use super::super::testing::npy;
    use super::*;

    #[test]
    fn headers_that_lie_are_refused_without_memory() {
        let good = npy("<f4", "(1, 2)", &[0; 8]);
        assert!(read_array(&mut &good[..], MAX_BYTES).is_ok());
        for (kind, shape, named) in [
            ("<f4", "(1, 3)", "does not fit"),
            ("<f4", "(1, 1)", "longer"),
            ("<f4", "(99999999999, 2)", "larger than 1073741824 bytes"),
            (
                "<f4",
                "(18446744073709551615, 99)",
                "larger than 1073741824 bytes",
            ),
            ("<f4", "(400000000,)", "larger than 1073741824 bytes"),
            ("|O", "(1, 2)", "not numbers"),
            ("<f4", "(-1, 2)", "not understood"),
            ("<f4", "(2", "not understood"),
            ("<f4", "(1,1,1,1,1,1,1,1,2)", "not understood"),
        ] {
            let message = read_array(&mut &npy(kind, shape, &[0; 8])[..], MAX_BYTES).unwrap_err();
            assert!(message.contains(named), "{shape}: {message}");
        }
        let message = read_array(&mut &good[..20], MAX_BYTES).unwrap_err();
        assert!(message.contains("cut off"), "{message}");
        for (bytes, named) in [
            (&b"PK\x03\x04 no array"[..], "no .npy"),
            (b"\x93NUMPY\x04\x00\x00\x00", "version 4"),
            (b"\x93NUMPY\x02\x00\xff\xff\xff\xff", "claims"),
        ] {
            let message = read_array(&mut &bytes[..], MAX_BYTES).unwrap_err();
            assert!(message.contains(named), "{message}");
        }
    }

    #[test]
    fn either_order_is_read() {
        let bytes: Vec<u8> = (0..6_u16).flat_map(u16::to_le_bytes).collect();
        let rows = npy("<u2", "(2, 3)", &bytes);
        let text = "{'descr': '<u2', 'fortran_order': True, 'shape': (2, 3), }\n";
        let mut columns = b"\x93NUMPY\x01\x00".to_vec();
        columns.extend((text.len() as u16).to_le_bytes());
        columns.extend(text.as_bytes());
        columns.extend(&bytes);
        let read = |file: &[u8]| read_array(&mut &file[..], MAX_BYTES).unwrap().to_vec();
        assert_eq!(read(&rows), [0., 1., 2., 3., 4., 5.]);
        assert_eq!(read(&columns), [0., 2., 4., 1., 3., 5.]);
    }

    proptest! {
        #[test]
        fn no_bytes_panic(header in ".{0,80}", tail in proptest::collection::vec(any::<u8>(), 0..40)) {
            let mut file = b"\x93NUMPY\x01\x00".to_vec();
            file.extend((header.len() as u16).to_le_bytes());
            file.extend(header.as_bytes());
            file.extend(&tail);
            let _ = read_array(&mut &file[..], MAX_BYTES);
            let _ = read_array(&mut &tail[..], MAX_BYTES);
        }
    }
}
