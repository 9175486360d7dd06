//! What the functions of a pickle would give: numpy's `ndarray`, `dtype`, `_reconstruct` (whose contents come with
//! BUILD), `_frombuffer` (arrays, in protocol 5) and `scalar`, and `_codecs.encode` (bytes, in protocol 2).

use super::{Id, Machine, Value};
use crate::arrays::{Array, Element, MAX_SIDES};
use crate::datasets::text::brief;

/// The functions and classes that a pickle may name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::datasets::importers) enum Known {
    NdArray,
    Dtype,
    Reconstruct,
    FromBuffer,
    Scalar,
    Encode,
}

/// The function or class of that name.
///
/// # Errors
/// If it is not on the list.
pub(super) fn known(module: &str, name: &str) -> Result<Known, String> {
    match (module, name) {
        ("numpy", "ndarray") => Ok(Known::NdArray),
        ("numpy", "dtype") => Ok(Known::Dtype),
        ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => {
            Ok(Known::Reconstruct)
        }
        ("numpy.core.numeric" | "numpy._core.numeric", "_frombuffer") => Ok(Known::FromBuffer),
        ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Ok(Known::Scalar),
        ("_codecs", "encode") => Ok(Known::Encode),
        _ => Err(format!(
            "the pickle calls {module}.{name}, which no list of pairs needs; it was not executed"
        )),
    }
}

impl Machine<'_> {
    /// The result of a known function for its arguments.
    pub(super) fn reduce(&mut self, function: Id, arguments: Id) -> Result<Value, String> {
        let copied = match self.list(arguments)?.first().map(|id| &self.values[*id]) {
            Some(Value::Bytes(data)) => data.len(),
            Some(Value::Text(text)) => text.len(),
            _ => 0,
        };
        if let Value::Known(Known::FromBuffer | Known::Encode) = self.values[function] {
            self.copy(copied)?;
        }
        let arguments = self.list(arguments)?;
        let argument = |index: usize| arguments.get(index).map(|&id| &self.values[id]);
        match (&self.values[function], argument(0), argument(1)) {
            (Value::Known(Known::Reconstruct), Some(Value::Known(Known::NdArray)), _) => {
                Ok(Value::Promise)
            }
            (Value::Known(Known::FromBuffer), Some(Value::Bytes(data)), Some(kind)) => {
                let by_columns = match argument(3) {
                    Some(Value::Text(order)) if order == "C" => false,
                    Some(Value::Text(order)) if order == "F" => true,
                    _ => return Err("an array is in an order that is not read".to_owned()),
                };
                let shape = argument(2).ok_or("the shape of an array is missing")?;
                self.array(shape, kind, by_columns, data)
            }
            (Value::Known(Known::Dtype), Some(Value::Text(kind)), _) => {
                let read = Element::of_numpy(kind);
                Ok(Value::Kind(read.ok_or_else(|| brief(kind))))
            }
            (Value::Known(Known::Scalar), Some(Value::Kind(kind)), Some(Value::Bytes(bytes))) => {
                let one = Array::new(vec![1], element(kind)?, bytes.clone())?;
                Ok(Value::Number(one.to_decimals()[0]))
            }
            (Value::Known(Known::Encode), Some(Value::Text(text)), Some(Value::Text(code)))
                if code == "latin1" =>
            {
                let bytes = text.chars().map(|c| u8::try_from(u32::from(c)));
                let bytes = bytes.collect::<Result<_, _>>();
                Ok(Value::Bytes(bytes.map_err(|_| "text is no bytes")?))
            }
            _ => Err("a function is called in a way that is not known".to_owned()),
        }
    }

    /// The object after its state was set.
    pub(super) fn build(&mut self, object: Id, state: Id) -> Result<Value, String> {
        let contents = self.list(state)?.get(4).map(|id| &self.values[*id]);
        self.copy(match contents {
            Some(Value::Bytes(data)) => data.len(),
            Some(Value::List(items)) => size_of_val(&items[..]),
            _ => 0,
        })?;
        let state = self.list(state)?;
        let part = |index: usize| -> Result<&Value, String> {
            let id = state
                .get(index)
                .ok_or("the state of an object is too short")?;
            Ok(&self.values[*id])
        };
        match &self.values[object] {
            Value::Kind(kind) => match part(1)? {
                Value::Text(order) if order != ">" => Ok(Value::Kind(kind.clone())),
                _ => Err("numbers in this byte order are not read".to_owned()),
            },
            Value::Promise => {
                let (shape, kind) = (part(1)?, part(2)?);
                let Value::Bool(by_columns) = part(3)? else {
                    return Err("the state of an array is not known".to_owned());
                };
                match part(4)? {
                    Value::Bytes(data) => self.array(shape, kind, *by_columns, data),
                    Value::List(items) if self.sides(shape)? == [items.len()] => {
                        Ok(Value::Objects(items.clone()))
                    }
                    _ => Err("the contents of an array are not known".to_owned()),
                }
            }
            _ => Err("the state of this object cannot be set".to_owned()),
        }
    }

    /// An array of numbers.
    fn array(
        &self,
        shape: &Value,
        kind: &Value,
        by_columns: bool,
        data: &[u8],
    ) -> Result<Value, String> {
        let shape = self.sides(shape)?;
        let Value::Kind(kind) = kind else {
            return Err("the type of an array is missing".to_owned());
        };
        let array = if by_columns {
            Array::by_columns
        } else {
            Array::new
        };
        Ok(Value::Array(array(shape, element(kind)?, data.to_vec())?))
    }

    /// The shape of an array.
    fn sides(&self, shape: &Value) -> Result<Vec<usize>, String> {
        let Value::List(sides) = shape else {
            return Err("the shape of an array is no tuple".to_owned());
        };
        if sides.len() > MAX_SIDES {
            return Err(format!("an array has {} dimensions", sides.len()));
        }
        (sides.iter())
            .map(|id| match self.values[*id] {
                Value::Number(side) if (0.0..1e15).contains(&side) => Ok(side as usize),
                _ => Err("a side of an array is no number".to_owned()),
            })
            .collect()
    }
}

fn element(kind: &Result<Element, String>) -> Result<Element, String> {
    (kind.clone()).map_err(|name| format!("numbers of type `{name}` are not read"))
}

#[cfg(test)]
mod tests {
    use super::super::Pickled;
    use super::*;

    /// `pickle.dumps(numpy.array([[1, 2, 3], [4, 5, 6]], "<u2"), 5)`, by numpy 2.4.
    const BUFFER: &[u8] = b"\x80\x05\x95\x82\0\0\0\0\0\0\0\x8c\x13numpy._core.numeric\x94\x8c\x0b_frombuffer\x94\
        \x93\x94(\x96\x0c\0\0\0\0\0\0\0\x01\0\x02\0\x03\0\x04\0\x05\0\x06\0\x94\x8c\x05numpy\x94\x8c\x05dtype\x94\
        \x93\x94\x8c\x02u2\x94\x89\x88\x87\x94R\x94(K\x03\x8c\x01<\x94NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0t\x94b\
        K\x02K\x03\x86\x94\x8c\x01C\x94t\x94R\x94.";

    /// The same in protocol 2, by columns.
    const ENCODED: &[u8] = b"\x80\x02cnumpy._core.multiarray\n_reconstruct\nq\0cnumpy\nndarray\nq\x01K\0\x85q\x02\
        c_codecs\nencode\nq\x03X\x01\0\0\0bq\x04X\x06\0\0\0latin1q\x05\x86q\x06Rq\x07\x87q\x08Rq\t(K\x01K\x02K\x03\
        \x86q\ncnumpy\ndtype\nq\x0bX\x02\0\0\0u2q\x0c\x89\x88\x87q\rRq\x0e(K\x03X\x01\0\0\0<q\x0fNNNJ\xff\xff\xff\xff\
        J\xff\xff\xff\xffK\0tq\x10b\x88h\x03X\x0c\0\0\0\x01\0\x04\0\x02\0\x05\0\x03\0\x06\0q\x11h\x05\x86q\x12R\
        q\x13tq\x14b.";

    #[test]
    fn arrays_of_all_protocols_are_read() {
        for bytes in [BUFFER, ENCODED] {
            let found = Pickled::parse(bytes).expect("numpy wrote it");
            let Value::Array(array) = found.root() else {
                panic!("{found:?}");
            };
            assert_eq!(array.shape(), [2, 3]);
            assert_eq!(array.to_vec(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        }
        let with = |bytes: &[u8], from: &[u8], to: &[u8]| {
            let at = bytes.windows(from.len()).position(|part| part == from);
            let at = at.expect("it is there");
            let changed = [&bytes[..at], to, &bytes[at + from.len()..]].concat();
            Pickled::parse(&changed).expect_err("changed")
        };
        let error = with(BUFFER, b"\x01C\x94", b"\x01K\x94");
        assert!(error.contains("order that is not read"), "{error}");
        let error = with(BUFFER, b"K\x02K\x03\x86", b"K\x02K\x04\x86");
        assert!(error.contains("12"), "{error}");
        let error = with(BUFFER, b"\x96\x0c\0", b"\x96\xff\xff");
        assert!(error.contains("cut off"), "{error}");
        let error = with(ENCODED, b"\x04\0\x02\0", "\u{100}\0\0".as_bytes());
        assert!(error.contains("text is no bytes"), "{error}");
        let error = with(ENCODED, b"latin1", b"utf-16");
        assert!(error.contains("not known"), "{error}");
    }

    #[test]
    fn contents_are_not_copied_without_end() {
        // 4096 bytes, from which a thousand arrays are made, and as text a thousand times bytes.
        let mut shared = b"\x80\x05\x96\0\x10\0\0\0\0\0\0".to_vec();
        shared.extend([0; 4096]);
        shared.extend(b"q\0cnumpy\ndtype\nX\x02\0\0\0u1\x85Rq\x01");
        shared.extend(
            b"cnumpy.core.numeric\n_frombuffer\n(h\0h\x01M\0\x10\x85X\x01\0\0\0CtR".repeat(1000),
        );
        let mut text = b"\x80\x02X\0\x10\0\0".to_vec();
        text.extend([b'a'; 4096]);
        text.extend(b"q\0");
        text.extend(b"c_codecs\nencode\nh\0X\x06\0\0\0latin1\x86R".repeat(1000));
        for mut bytes in [shared, text] {
            bytes.push(b'.');
            let error = Pickled::parse(&bytes).expect_err("too large");
            assert!(error.contains("share their contents too often"), "{error}");
        }
    }
}
