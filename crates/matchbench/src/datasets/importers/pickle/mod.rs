//! Reads Python pickles, as far as numbers, names and NumPy arrays need it.
//!
//! A pickle is a program for a stack machine that may call any Python function. Nothing is called here: an
//! opcode or function that is not on the list below is an error that names it. The others build lists, tuples,
//! dictionaries, text, numbers and arrays (of numbers, or of further values). All values are in one store and
//! refer to each other by number. So a value that refers to itself, or that is nested deeply, needs no more
//! memory than its bytes. The contents of an array are copied from another value; all copies together may be
//! some times as large as the pickle.
//!
//! Opcodes (of protocols 2 to 5): PROTO FRAME STOP MARK MEMOIZE BINPUT LONG_BINPUT BINGET
//! LONG_BINGET NONE NEWTRUE NEWFALSE BININT BININT1 BININT2 LONG1 BINFLOAT BINUNICODE
//! SHORT_BINUNICODE BINBYTES SHORT_BINBYTES EMPTY_LIST APPEND APPENDS EMPTY_TUPLE TUPLE TUPLE1
//! TUPLE2 TUPLE3 EMPTY_DICT SETITEM SETITEMS GLOBAL STACK_GLOBAL REDUCE BUILD BYTEARRAY8. Functions: those of
//! [`calls`].

mod calls;

use std::collections::BTreeMap;

use crate::arrays::{Array, Element};

pub(super) use calls::Known;
use calls::known;

/// Number of a value in the store.
pub(super) type Id = usize;

/// A value of a pickle.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    None,
    Bool(bool),
    Number(f64),
    Text(String),
    Bytes(Vec<u8>),
    /// A list or a tuple.
    List(Vec<Id>),
    Dict(Vec<(Id, Id)>),
    /// An array of numbers.
    Array(Array),
    /// An array of values, row by row.
    Objects(Vec<Id>),
    /// A function or class that is on the list.
    Known(Known),
    /// An array whose contents come later in the pickle.
    Promise,
    /// A type of numbers, or the name of one that is not read.
    Kind(Result<Element, String>),
}

/// A pickle after it was read.
#[derive(Debug)]
pub(super) struct Pickled {
    values: Vec<Value>,
    root: Id,
}

impl Pickled {
    /// Reads a pickle.
    ///
    /// # Errors
    /// If it is invalid or uses something that is not on the list; the message has the position in the file.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, String> {
        let mut machine = Machine {
            bytes,
            at: 0,
            values: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: BTreeMap::new(),
            left: bytes.len().saturating_mul(MAX_COPIES),
        };
        loop {
            let at = machine.at;
            match machine.step() {
                Ok(None) => {}
                Ok(Some(root)) => {
                    let values = machine.values;
                    return Ok(Self { values, root });
                }
                Err(what) => return Err(format!("at byte {at}: {what}")),
            }
        }
    }

    pub(super) fn root(&self) -> &Value {
        &self.values[self.root]
    }

    pub(super) fn value(&self, id: Id) -> &Value {
        &self.values[id]
    }

    /// The value of a dictionary under a key.
    pub(super) fn get(&self, dict: &Value, key: &str) -> Option<&Value> {
        let Value::Dict(entries) = dict else {
            return None;
        };
        let is_key = |id: Id| matches!(self.value(id), Value::Text(text) if text == key);
        let found = entries.iter().rev().find(|(id, _)| is_key(*id));
        found.map(|(_, value)| self.value(*value))
    }
}

struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    values: Vec<Value>,
    stack: Vec<Id>,
    /// Heights of the stack at its marks.
    marks: Vec<usize>,
    /// Values by the slots that remember them. Slots may be left out, so that they take no memory.
    memo: BTreeMap<usize, Id>,
    /// Bytes that may still be copied.
    left: usize,
}

/// Values that a pickle may have in any case: `None` is a byte there and takes many here. A larger pickle may have
/// more, which take [`MAX_COPIES`] times its bytes.
const MAX_VALUES: usize = 1_000_000;

/// How many times as large as the pickle all contents of arrays may be: each is copied once, and a number of a
/// value, which can be a byte in the pickle, takes eight here.
const MAX_COPIES: usize = 16;

impl Machine<'_> {
    /// Executes one instruction. Returns the result of the program when it stops.
    #[expect(
        clippy::too_many_lines,
        reason = "one arm for each opcode that is allowed"
    )]
    fn step(&mut self) -> Result<Option<Id>, String> {
        match self.take::<1>()?[0] {
            0x80 => {
                let [protocol] = self.take()?;
                if !(2..=5).contains(&protocol) {
                    return Err(format!("protocol {protocol} is not read"));
                }
            }
            0x95 => drop(self.take::<8>()?),
            b'.' => return self.pop().map(Some),
            b'(' => self.marks.push(self.stack.len()),
            0x94 => self.remember(self.memo.len())?,
            b'q' => {
                let [slot] = self.take()?;
                self.remember(slot.into())?;
            }
            b'r' => {
                let slot = u32::from_le_bytes(self.take()?) as usize;
                self.remember(slot)?;
            }
            b'h' => {
                let [slot] = self.take()?;
                self.recall(slot.into())?;
            }
            b'j' => {
                let slot = u32::from_le_bytes(self.take()?) as usize;
                self.recall(slot)?;
            }
            b'N' => self.push(Value::None)?,
            0x88 => self.push(Value::Bool(true))?,
            0x89 => self.push(Value::Bool(false))?,
            b'J' => {
                let number = i32::from_le_bytes(self.take()?);
                self.push(Value::Number(number.into()))?;
            }
            b'K' => {
                let [number] = self.take()?;
                self.push(Value::Number(number.into()))?;
            }
            b'M' => {
                let number = u16::from_le_bytes(self.take()?);
                self.push(Value::Number(number.into()))?;
            }
            0x8a => {
                let [length] = self.take()?;
                let number = long(self.slice(length.into())?)?;
                self.push(Value::Number(number))?;
            }
            b'G' => {
                let number = f64::from_be_bytes(self.take()?);
                self.push(Value::Number(number))?;
            }
            0x8c => {
                let [length] = self.take()?;
                self.text(length.into())?;
            }
            b'X' => {
                let length = u32::from_le_bytes(self.take()?);
                self.text(length as usize)?;
            }
            b'C' => {
                let [length] = self.take()?;
                let bytes = self.slice(length.into())?.to_vec();
                self.push(Value::Bytes(bytes))?;
            }
            b'B' => {
                let length = u32::from_le_bytes(self.take()?);
                let bytes = self.slice(length as usize)?.to_vec();
                self.push(Value::Bytes(bytes))?;
            }
            0x96 => {
                let length = u64::from_le_bytes(self.take()?);
                let length = usize::try_from(length).map_err(|_| "the file is cut off")?;
                let bytes = self.slice(length)?.to_vec();
                self.push(Value::Bytes(bytes))?;
            }
            b']' | b')' => self.push(Value::List(Vec::new()))?,
            b'a' => {
                let item = self.pop()?;
                self.append(vec![item])?;
            }
            b'e' => {
                let items = self.pop_to_mark()?;
                self.append(items)?;
            }
            b't' => {
                let items = self.pop_to_mark()?;
                self.push(Value::List(items))?;
            }
            count @ 0x85..=0x87 => {
                let count = usize::from(count - 0x84);
                let from = self.above(count)?;
                let items = self.stack.split_off(from);
                self.push(Value::List(items))?;
            }
            b'}' => self.push(Value::Dict(Vec::new()))?,
            b's' => {
                let from = self.above(2)?;
                let items = self.stack.split_off(from);
                self.set(&items)?;
            }
            b'u' => {
                let items = self.pop_to_mark()?;
                self.set(&items)?;
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.push(Value::Known(known(&module, &name)?))?;
            }
            0x93 => {
                let (name, module) = (self.pop()?, self.pop()?);
                let (Value::Text(module), Value::Text(name)) =
                    (&self.values[module], &self.values[name])
                else {
                    return Err("the name of a function is no text".to_owned());
                };
                let known = known(module, name)?;
                self.push(Value::Known(known))?;
            }
            b'R' => {
                let (arguments, function) = (self.pop()?, self.pop()?);
                let made = self.reduce(function, arguments)?;
                self.push(made)?;
            }
            b'b' => {
                let state = self.pop()?;
                let object = self.pop()?;
                let built = self.build(object, state)?;
                self.values[object] = built;
                self.stack.push(object);
            }
            other => {
                return Err(format!(
                    "the instruction {other:#04x} is not on the list of those that lists of pairs need"
                ));
            }
        }
        Ok(None)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let bytes = self.slice(N)?;
        Ok(bytes.try_into().expect("N bytes"))
    }

    fn slice(&mut self, length: usize) -> Result<&[u8], String> {
        let rest = &self.bytes[self.at..];
        let slice = rest.get(..length).ok_or("the file is cut off")?;
        self.at += length;
        Ok(slice)
    }

    fn line(&mut self) -> Result<String, String> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&byte| byte == b'\n');
        let line = self.slice(end.ok_or("the file is cut off")? + 1)?;
        Ok(String::from_utf8_lossy(&line[..line.len() - 1]).into_owned())
    }

    fn text(&mut self, length: usize) -> Result<(), String> {
        let text = std::str::from_utf8(self.slice(length)?).map_err(|_| "text is not UTF-8")?;
        let text = text.to_owned();
        self.push(Value::Text(text))?;
        Ok(())
    }

    fn push(&mut self, value: Value) -> Result<(), String> {
        let most = MAX_VALUES + MAX_COPIES * self.bytes.len() / size_of::<Value>();
        if self.values.len() >= most {
            return Err(format!("it makes more than {most} values"));
        }
        self.stack.push(self.values.len());
        self.values.push(value);
        Ok(())
    }

    fn pop(&mut self) -> Result<Id, String> {
        let from = self.above(1)?;
        Ok(self.stack.remove(from))
    }

    /// The height of the stack below its last `count` items, which must be above the last mark.
    fn above(&self, count: usize) -> Result<usize, String> {
        let floor = self.marks.last().copied().unwrap_or(0);
        let from = self.stack.len().checked_sub(count);
        from.filter(|&from| from >= floor)
            .ok_or_else(|| "the stack is empty".to_owned())
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Id>, String> {
        let from = self.marks.pop().ok_or("there is no mark")?;
        Ok(self.stack.split_off(from))
    }

    fn last(&self) -> Result<Id, String> {
        Ok(self.stack[self.above(1)?])
    }

    fn remember(&mut self, slot: usize) -> Result<(), String> {
        let value = self.last()?;
        // Slots are numbered in the order in which they are filled, so a valid pickle has no slot far beyond
        // the others.
        let next = self.memo.last_key_value().map_or(0, |(last, _)| last + 1);
        if slot > next + 1000 {
            return Err(format!("value {slot} is remembered before its time"));
        }
        self.memo.insert(slot, value);
        Ok(())
    }

    fn recall(&mut self, slot: usize) -> Result<(), String> {
        let value = self.memo.get(&slot).copied();
        let value = value.ok_or_else(|| format!("value {slot} was not remembered"))?;
        self.stack.push(value);
        Ok(())
    }

    fn append(&mut self, items: Vec<Id>) -> Result<(), String> {
        let list = self.last()?;
        match &mut self.values[list] {
            Value::List(list) => list.extend(items),
            _ => return Err("something is appended to what is no list".to_owned()),
        }
        Ok(())
    }

    fn set(&mut self, items: &[Id]) -> Result<(), String> {
        let dict = self.last()?;
        match &mut self.values[dict] {
            Value::Dict(dict) if items.len().is_multiple_of(2) => {
                dict.extend(items.chunks_exact(2).map(|pair| (pair[0], pair[1])));
                Ok(())
            }
            _ => Err("entries are set in what is no dictionary".to_owned()),
        }
    }

    /// Contents of so many bytes are copied.
    fn copy(&mut self, bytes: usize) -> Result<(), String> {
        let left = self.left.checked_sub(bytes);
        self.left = left.ok_or("its arrays share their contents too often")?;
        Ok(())
    }

    fn list(&self, id: Id) -> Result<&[Id], String> {
        match &self.values[id] {
            Value::List(items) => Ok(items),
            _ => Err("a tuple is missing".to_owned()),
        }
    }
}

/// An integer of up to eight bytes, little-endian, in two's complement.
fn long(bytes: &[u8]) -> Result<f64, String> {
    let negative = bytes.last().is_some_and(|&byte| byte >= 0x80);
    let mut wide = [if negative { 0xff } else { 0 }; 8];
    let place = wide.get_mut(..bytes.len());
    place
        .ok_or("a number has more than 64 bits")?
        .copy_from_slice(bytes);
    Ok(i64::from_le_bytes(wide) as f64)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// `pickle.dumps({"a": [1, -2, 2.5, None, True], "b": "é"}, 4)`, by CPython 3.11.
    const PLAIN: &[u8] =
        b"\x80\x04\x95(\0\0\0\0\0\0\0}\x94(\x8c\x01a\x94]\x94(K\x01J\xfe\xff\xff\xff\
        G@\x04\0\0\0\0\0\0N\x88e\x8c\x01b\x94\x8c\x02\xc3\xa9\x94u.";

    #[test]
    fn plain_values_are_read() {
        let found = Pickled::parse(PLAIN).unwrap();
        let Some(Value::List(items)) = found.get(found.root(), "a") else {
            panic!("{found:?}");
        };
        let items: Vec<_> = items.iter().map(|&id| found.value(id).clone()).collect();
        let numbers = [1.0, -2.0, 2.5].map(Value::Number);
        assert_eq!(items[..3], numbers);
        assert_eq!(items[3..], [Value::None, Value::Bool(true)]);
        assert_eq!(found.get(found.root(), "b"), Some(&Value::Text("é".into())));
        assert_eq!(found.get(found.root(), "c"), None);
    }

    #[test]
    fn nothing_is_executed() {
        // `os.system("true")`, as protocol 2 writes it.
        let error =
            Pickled::parse(b"\x80\x02cposix\nsystem\nq\0X\x04\0\0\0trueq\x01\x85q\x02Rq\x03.");
        let error = error.unwrap_err();
        assert!(
            error.contains("posix.system") && error.contains("not executed"),
            "{error}"
        );
        let error = Pickled::parse(b"\x80\x02(S'x'\ni").unwrap_err();
        assert!(error.contains("0x53"), "{error}");
    }

    #[test]
    fn what_is_damaged_or_endless_is_refused() {
        for bytes in [
            &b""[..],
            b"\x80\x02",
            b"\x80\x01.",
            b".",
            b"(.",
            b"a",
            b"K\x01a.",
            b"h\x07.",
            b"]r\xff\xff\xff\xff.",
            b"B\xff\xff\xff\xffx",
            b"\x8a\x09123456789.",
        ] {
            assert!(Pickled::parse(bytes).is_err(), "{bytes:?}");
        }
        // A thousand arrays with one state.
        let a_thousand = |mut bytes: Vec<u8>, state: &[u8]| {
            for _ in 0..1000 {
                bytes.extend(
                    b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\0\x85C\x01b\x87R",
                );
                bytes.extend(state);
            }
            bytes.push(b'.');
            Pickled::parse(&bytes).unwrap_err()
        };
        // All with the same contents.
        let mut shared = b"\x80\x02B\x00\x10\x00\x00".to_vec();
        shared.extend([0; 4096]);
        shared.extend(b"q\0cnumpy\ndtype\nq\x01X\x02\0\0\0u1K\0K\x01\x87Rq\x02");
        let error = a_thousand(shared, b"(K\x01M\x00\x10\x85h\x02\x89h\0tb");
        assert!(error.contains("share their contents too often"), "{error}");
        // Of one byte each, all with one shape of a thousand sides.
        let mut sides = b"\x80\x02cnumpy\ndtype\nq\x01X\x02\0\0\0u1K\0K\x01\x87Rq\x02(".to_vec();
        sides.extend(b"K\x01".repeat(1000));
        sides.extend(b"tq\x03");
        let error = a_thousand(sides, b"(K\x01h\x03h\x02\x89C\x01xtb");
        assert!(error.contains("1000 dimensions"), "{error}");
        // A type of numbers with a long name, made many times from one text; a long run of values of one byte.
        let mut types = b"\x80\x02cnumpy\ndtype\nq\0X\x40\x42\x0f\0".to_vec();
        types.extend(b"x".repeat(1_000_000));
        types.extend(b"\x85q\x01");
        types.extend(b"h\0h\x01R".repeat(1000));
        types.push(b'.');
        let found = Pickled::parse(&types).unwrap();
        let Value::Kind(Err(name)) = found.root() else {
            panic!("no type of numbers");
        };
        assert!(name.len() < 1000, "{}", name.len());
        let error = Pickled::parse(&b"N".repeat(3_000_000)).unwrap_err();
        assert!(error.contains("values"), "{error}");
        // A list that holds itself, and one hundred thousand lists in each other.
        let own = Pickled::parse(b"]q\0h\0a.").unwrap();
        assert_eq!(own.root(), &Value::List(vec![0]));
        let mut deep = b"]".repeat(100_000);
        deep.extend(b"a".repeat(99_999));
        deep.push(b'.');
        assert!(Pickled::parse(&deep).is_ok());
    }

    proptest! {
        #[test]
        fn no_bytes_panic(
            bytes in proptest::collection::vec(prop_oneof![
                any::<u8>(),
                proptest::sample::select(&b"(](})KK\x94h\0ueatRbsq\x85\x86\x87\x93N."[..]),
            ], 0..60),
        ) {
            let _ = Pickled::parse(&bytes);
        }
    }
}
