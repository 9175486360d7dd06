//! Writes a table of typed columns as a Parquet file, which data frame libraries load with types and nulls.
//!
//! <https://parquet.apache.org/docs/file-format>: the pages of each column, one after the other, then a footer
//! that says where they are. Of the many possible layouts this is the simplest: one row group, one page per
//! column, uncompressed. Names are stored once, in a dictionary page, and the rows hold their numbers as runs.
//! Unknown values are left out, and runs of levels (1: known, 0: not) say where. This file and the one beside
//! it replace a dependency that takes two minutes to build.

mod thrift;

use std::collections::BTreeMap;

use thrift::{Struct, varint};

use super::pair_table::{Column, Values};

const MAGIC: &[u8] = b"PAR1";
const DATA_PAGE: i32 = 0;
const DICTIONARY_PAGE: i32 = 2;
const PLAIN: i32 = 0;
const RLE: i32 = 3;
const RLE_DICTIONARY: i32 = 8;

/// The table as a file.
pub(super) fn render(columns: &[Column<'_>]) -> Vec<u8> {
    let mut file = MAGIC.to_vec();
    let chunks: Vec<Struct> = columns
        .iter()
        .map(|column| chunk(&mut file, column))
        .collect();
    let rows = columns.first().map_or(0, |column| column.values.len());
    let group = Struct::new()
        .structs(1, chunks)
        .i64(2, file.len() - MAGIC.len())
        .i64(3, rows);
    let root = Struct::new().text(4, "schema").i32(5, columns.len() as i32);
    let schema = std::iter::once(root).chain(columns.iter().map(schema));
    let footer = Struct::new()
        .i32(1, 1) // version of the format
        .structs(2, schema.collect())
        .i64(3, rows)
        .structs(4, vec![group])
        .text(6, concat!("matchbench version ", env!("CARGO_PKG_VERSION")))
        .finish();
    file.extend(&footer);
    file.extend((footer.len() as u32).to_le_bytes());
    file.extend(MAGIC);
    file
}

/// Name and type of a column.
fn schema(column: &Column<'_>) -> Struct {
    const UTF8: i32 = 0;
    const UINT_32: i32 = 13;
    let optional = matches!(column.values, Values::Count(_) | Values::Number(_));
    let base = Struct::new()
        .i32(1, physical(&column.values))
        .i32(3, optional.into())
        .text(4, column.name);
    // What the bytes mean, for older readers and for newer ones.
    match column.values {
        Values::Text(_) => base
            .i32(6, UTF8)
            .nested(10, Struct::new().nested(1, Struct::new())),
        Values::Index(_) | Values::Count(_) => {
            let unsigned = Struct::new().i8(1, 32).bool(2, false);
            base.i32(6, UINT_32)
                .nested(10, Struct::new().nested(10, unsigned))
        }
        Values::Number(_) => base,
    }
}

/// How the values are stored: 4-byte integers, doubles, or bytes.
fn physical(values: &Values<'_>) -> i32 {
    match values {
        Values::Index(_) | Values::Count(_) => 1,
        Values::Number(_) => 5,
        Values::Text(_) => 6,
    }
}

/// Appends the pages of a column and returns what the footer says of them.
fn chunk(file: &mut Vec<u8>, column: &Column<'_>) -> Struct {
    let start = file.len();
    let rows = column.values.len();
    let mut data = file.len();
    let encoding = match &column.values {
        Values::Text(values) => {
            let mut numbers = BTreeMap::new();
            let mut dictionary = Vec::new();
            for value in values {
                let next = numbers.len() as u32;
                numbers.entry(*value).or_insert_with(|| {
                    dictionary.extend((value.len() as u32).to_le_bytes());
                    dictionary.extend(value.as_bytes());
                    next
                });
            }
            let head = Struct::new().i32(1, numbers.len() as i32).i32(2, PLAIN);
            page(file, DICTIONARY_PAGE, (7, head), &dictionary);
            data = file.len();
            let bytes = if numbers.len() <= 256 { 1 } else { 4 };
            let mut indices = vec![8 * bytes];
            runs(
                &mut indices,
                bytes,
                values.iter().map(|value| numbers[value]),
            );
            data_page(file, rows, RLE_DICTIONARY, &indices);
            RLE_DICTIONARY
        }
        Values::Index(values) => {
            let bytes: Vec<u8> = values
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect();
            data_page(file, rows, PLAIN, &bytes);
            PLAIN
        }
        Values::Count(values) => {
            data_page(file, rows, PLAIN, &optional(values, u32::to_le_bytes));
            PLAIN
        }
        Values::Number(values) => {
            data_page(file, rows, PLAIN, &optional(values, f64::to_le_bytes));
            PLAIN
        }
    };
    let size = file.len() - start;
    let meta = Struct::new()
        .i32(1, physical(&column.values))
        .i32s(2, &[PLAIN, RLE, encoding])
        .texts(3, &[column.name])
        .i32(4, 0) // uncompressed
        .i64(5, rows)
        .i64(6, size)
        .i64(7, size)
        .i64(9, data);
    let meta = if data > start {
        meta.i64(11, start)
    } else {
        meta
    };
    Struct::new().i64(2, start).nested(3, meta)
}

/// Appends a page and its header. The part of the header for this kind of page is field `head.0`.
fn page(file: &mut Vec<u8>, kind: i32, head: (u8, Struct), body: &[u8]) {
    let size = body.len() as i32;
    let header = Struct::new()
        .i32(1, kind)
        .i32(2, size)
        .i32(3, size)
        .nested(head.0, head.1);
    file.extend(header.finish());
    file.extend(body);
}

fn data_page(file: &mut Vec<u8>, rows: usize, encoding: i32, body: &[u8]) {
    let head = Struct::new()
        .i32(1, rows as i32)
        .i32(2, encoding)
        .i32(3, RLE) // of the levels that say what is known
        .i32(4, RLE); // of the levels of nesting, which there are none of
    page(file, DATA_PAGE, (5, head), body);
}

/// Levels, then the values that are known.
fn optional<T: Copy, const N: usize>(values: &[Option<T>], bytes: fn(T) -> [u8; N]) -> Vec<u8> {
    let mut levels = Vec::new();
    runs(
        &mut levels,
        1,
        values.iter().map(|value| value.is_some().into()),
    );
    let mut body = (levels.len() as u32).to_le_bytes().to_vec();
    body.extend(levels);
    body.extend(values.iter().flatten().flat_map(|&value| bytes(value)));
    body
}

/// Numbers as runs of equal ones. A run is twice its length, then the number in `bytes` bytes.
fn runs(out: &mut Vec<u8>, bytes: u8, numbers: impl Iterator<Item = u32>) {
    let mut numbers = numbers.peekable();
    while let Some(number) = numbers.next() {
        let mut length = 1;
        while numbers.next_if_eq(&number).is_some() {
            length += 1;
        }
        varint(out, length << 1);
        out.extend(&number.to_le_bytes()[..usize::from(bytes)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_numbers_are_one_run() {
        let mut out = Vec::new();
        runs(&mut out, 1, [7; 100].into_iter().chain([0, 0, 9]));
        assert_eq!(out, [0xc8, 0x01, 7, 4, 0, 2, 9]);
    }

    #[test]
    fn unknown_values_are_levels_alone() {
        let body = optional(&[Some(1.0), None, None], f64::to_le_bytes);
        assert_eq!(body[..8], [4, 0, 0, 0, 2, 1, 4, 0]);
        assert_eq!(body[8..], 1.0_f64.to_le_bytes());
    }

    #[test]
    fn file_begins_and_ends_as_it_must_and_its_footer_is_inside() {
        for values in [vec![], vec![Some(1), None]] {
            let columns = [
                Column {
                    name: "name",
                    values: Values::Text(vec!["é"; values.len()]),
                },
                Column {
                    name: "count",
                    values: Values::Count(values),
                },
            ];
            let file = render(&columns);
            assert!(file.starts_with(MAGIC) && file.ends_with(MAGIC));
            let at = file.len() - 8;
            let length = u32::from_le_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]]);
            assert!((length as usize) < at - 4);
            assert_eq!(file, render(&columns));
        }
    }
}
