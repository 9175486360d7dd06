//! Thrift's compact protocol, as far as the headers of a Parquet file need it.
//!
//! <https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md>: a struct is a list of
//! fields and ends with a zero. Each field begins with its type and the difference of its number to that of the
//! field before. Whole numbers are zigzag-coded and written seven bits at a time.

/// A struct that is being written.
#[derive(Default)]
pub(super) struct Struct {
    bytes: Vec<u8>,
    last: u8,
}

const TRUE: u8 = 1;
const FALSE: u8 = 2;
const I8: u8 = 3;
const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

impl Struct {
    pub(super) fn new() -> Self {
        Self::default()
    }

    pub(super) fn bool(mut self, id: u8, value: bool) -> Self {
        self.head(id, if value { TRUE } else { FALSE });
        self
    }

    pub(super) fn i8(mut self, id: u8, value: i8) -> Self {
        self.head(id, I8);
        self.bytes.push(value as u8);
        self
    }

    pub(super) fn i32(mut self, id: u8, value: i32) -> Self {
        self.head(id, I32);
        zigzag(&mut self.bytes, value.into());
        self
    }

    pub(super) fn i64(mut self, id: u8, value: usize) -> Self {
        self.head(id, I64);
        zigzag(&mut self.bytes, value as i64);
        self
    }

    pub(super) fn text(mut self, id: u8, value: &str) -> Self {
        self.head(id, BINARY);
        text(&mut self.bytes, value);
        self
    }

    pub(super) fn nested(mut self, id: u8, value: Self) -> Self {
        self.head(id, STRUCT);
        self.bytes.extend(value.finish());
        self
    }

    pub(super) fn i32s(mut self, id: u8, values: &[i32]) -> Self {
        self.list(id, I32, values.len());
        for &value in values {
            zigzag(&mut self.bytes, value.into());
        }
        self
    }

    pub(super) fn texts(mut self, id: u8, values: &[&str]) -> Self {
        self.list(id, BINARY, values.len());
        for value in values {
            text(&mut self.bytes, value);
        }
        self
    }

    pub(super) fn structs(mut self, id: u8, values: Vec<Self>) -> Self {
        self.list(id, STRUCT, values.len());
        for value in values {
            self.bytes.extend(value.finish());
        }
        self
    }

    /// The bytes of the struct.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }

    /// The head of field `id`. Fields must come in the order of their numbers. The numbers of Parquet are close
    /// enough that the short form is always possible.
    fn head(&mut self, id: u8, kind: u8) {
        let step = id - self.last;
        debug_assert!((1..=15).contains(&step), "fields come in order");
        self.bytes.push(step << 4 | kind);
        self.last = id;
    }

    fn list(&mut self, id: u8, kind: u8, len: usize) {
        self.head(id, LIST);
        if len < 15 {
            self.bytes.push((len as u8) << 4 | kind);
        } else {
            self.bytes.push(0xf0 | kind);
            varint(&mut self.bytes, len as u64);
        }
    }
}

fn text(bytes: &mut Vec<u8>, value: &str) {
    varint(bytes, value.len() as u64);
    bytes.extend(value.as_bytes());
}

/// Zigzag coding: small numbers of either sign become small numbers without a sign.
fn zigzag(bytes: &mut Vec<u8>, value: i64) {
    varint(bytes, (value << 1 ^ value >> 63) as u64);
}

/// Seven bits at a time, the lowest first.
pub(super) fn varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_written_as_the_specification_says() {
        let inner = Struct::new().bool(2, false);
        let bytes = Struct::new()
            .i32(1, -1)
            .i64(3, 150)
            .text(4, "ab")
            .nested(5, inner)
            .finish();
        let expected = [
            0x15, 0x01, // field 1, i32: zigzag of -1 is 1
            0x26, 0xac, 0x02, // field 3, i64: zigzag of 150 is 300
            0x18, 0x02, b'a', b'b', // field 4, two bytes
            0x1c, 0x22, 0x00, // field 5, a struct with field 2 false
            0x00,
        ];
        assert_eq!(bytes, expected);
    }

    #[test]
    fn long_lists_have_their_length_apart() {
        let short = Struct::new().i32s(1, &[3; 14]).finish();
        assert_eq!(short[..3], [0x19, 0xe5, 0x06]);
        let long = Struct::new().i32s(1, &[3; 15]).finish();
        assert_eq!(long[..4], [0x19, 0xf5, 15, 0x06]);
    }
}
