//! Reads Python pickles, as far as numbers, names and NumPy arrays need it.
//!
//! A pickle is a program for a stack machine that may call any Python function. Nothing is called here: an
//! opcode or function that is not on the lists below is an error that names it. The others build lists, tuples,
//! dictionaries, text, numbers and arrays (of numbers, or of further values). All values are in one store and
//! refer to each other by number. So a value that refers to itself, or that is nested deeply, needs no more
//! memory than its bytes. The contents of an array are copied from another value; all copies together may be
//! some times as large as the pickle.
//!
//! Opcodes: those of [`opcode`]. Functions: those of [`calls`].

mod calls;
mod opcode;

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
    fn step(&mut self) -> Result<Option<Id>, String> {
        let [opcode] = self.take()?;
        match opcode {
            opcode::PROTO => {
                let [protocol] = self.take()?;
                if !(2..=5).contains(&protocol) {
                    return Err(format!("protocol {protocol} is not read"));
                }
            }
            opcode::FRAME => drop(self.take::<8>()?),
            opcode::STOP => return self.pop().map(Some),

            opcode::MEMOIZE => self.remember(self.memo.len())?,
            opcode::BINPUT => {
                let slot = self.unsigned::<1>()?;
                self.remember(slot)?;
            }
            opcode::LONG_BINPUT => {
                let slot = self.unsigned::<4>()?;
                self.remember(slot)?;
            }
            opcode::BINGET => {
                let slot = self.unsigned::<1>()?;
                self.recall(slot)?;
            }
            opcode::LONG_BINGET => {
                let slot = self.unsigned::<4>()?;
                self.recall(slot)?;
            }

            opcode::MARK => self.marks.push(self.stack.len()),
            opcode::APPEND => {
                let item = self.pop()?;
                self.append(vec![item])?;
            }
            opcode::APPENDS => {
                let items = self.pop_to_mark()?;
                self.append(items)?;
            }
            opcode::SETITEM => {
                let items = self.pop_last(2)?;
                self.set(&items)?;
            }
            opcode::SETITEMS => {
                let items = self.pop_to_mark()?;
                self.set(&items)?;
            }
            opcode::BUILD => {
                let state = self.pop()?;
                let object = self.pop()?;
                let built = self.build(object, state)?;
                self.values[object] = built;
                self.stack.push(object);
            }
            _ => {
                let value = self.made(opcode)?;
                self.push(value)?;
            }
        }
        Ok(None)
    }

    /// The new value that an instruction makes.
    fn made(&mut self, opcode: u8) -> Result<Value, String> {
        Ok(match opcode {
            opcode::NONE => Value::None,
            opcode::NEWTRUE => Value::Bool(true),
            opcode::NEWFALSE => Value::Bool(false),

            opcode::BININT => Value::Number(i32::from_le_bytes(self.take()?).into()),
            opcode::BININT1 => Value::Number(u8::from_le_bytes(self.take()?).into()),
            opcode::BININT2 => Value::Number(u16::from_le_bytes(self.take()?).into()),
            opcode::BINFLOAT => Value::Number(f64::from_be_bytes(self.take()?)),
            opcode::LONG1 => {
                let length = self.unsigned::<1>()?;
                Value::Number(long(self.slice(length)?)?)
            }

            opcode::SHORT_BINUNICODE => Value::Text(self.text::<1>()?),
            opcode::BINUNICODE => Value::Text(self.text::<4>()?),
            opcode::SHORT_BINBYTES => Value::Bytes(self.counted::<1>()?.to_vec()),
            opcode::BINBYTES => Value::Bytes(self.counted::<4>()?.to_vec()),
            opcode::BYTEARRAY8 => Value::Bytes(self.counted::<8>()?.to_vec()),

            opcode::EMPTY_LIST | opcode::EMPTY_TUPLE => Value::List(Vec::new()),
            opcode::EMPTY_DICT => Value::Dict(Vec::new()),
            opcode::TUPLE => Value::List(self.pop_to_mark()?),
            opcode::TUPLE1..=opcode::TUPLE3 => {
                Value::List(self.pop_last(usize::from(opcode - opcode::TUPLE1) + 1)?)
            }

            opcode::GLOBAL => {
                let (module, name) = (self.line()?, self.line()?);
                Value::Known(known(&module, &name)?)
            }
            opcode::STACK_GLOBAL => {
                let (name, module) = (self.pop()?, self.pop()?);
                let (Value::Text(module), Value::Text(name)) =
                    (&self.values[module], &self.values[name])
                else {
                    return Err("the name of a function is no text".to_owned());
                };
                Value::Known(known(module, name)?)
            }
            opcode::REDUCE => {
                let (arguments, function) = (self.pop()?, self.pop()?);
                self.reduce(function, arguments)?
            }
            other => {
                return Err(format!(
                    "the instruction {other:#04x} is not on the list of those that lists of pairs need"
                ));
            }
        })
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

    /// An unsigned integer of N bytes, little-endian.
    fn unsigned<const N: usize>(&mut self) -> Result<usize, String> {
        let mut wide = [0; 8];
        wide[..N].copy_from_slice(&self.take::<N>()?);
        usize::try_from(u64::from_le_bytes(wide)).map_err(|_| "the file is cut off".to_owned())
    }

    /// Bytes that follow their number, which has N bytes.
    fn counted<const N: usize>(&mut self) -> Result<&[u8], String> {
        let length = self.unsigned::<N>()?;
        self.slice(length)
    }

    /// Text that follows the number of its bytes, which has N bytes.
    fn text<const N: usize>(&mut self) -> Result<String, String> {
        let text = std::str::from_utf8(self.counted::<N>()?).map_err(|_| "text is not UTF-8")?;
        Ok(text.to_owned())
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

    /// The last `count` items of the stack, in their order.
    fn pop_last(&mut self, count: usize) -> Result<Vec<Id>, String> {
        let from = self.above(count)?;
        Ok(self.stack.split_off(from))
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
