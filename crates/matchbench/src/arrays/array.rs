//! An array of numbers as numpy and HDF5 store it: bytes, a shape, and a type of element.
//!
//! The bytes stay as they are in the file, and an element is converted when it is read. So an array costs no
//! more memory than its file. Half precision (float16), which hloc writes by default, is decoded here: 1 sign
//! bit, 5 bits of exponent (bias 15), 10 bits of fraction (IEEE 754-2008, binary16).

use std::fmt;

use crate::counted::counted;

/// The most bytes that one array may have. Ten million matches with two points each take 160 MB. An array that
/// claims more than the limit is damaged or hostile.
pub(crate) const MAX_BYTES: u64 = 1 << 30;

/// An array in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    shape: Vec<usize>,
    element: Element,
    bytes: Vec<u8>,
}

/// How an element is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Element {
    pub(crate) kind: Kind,
    /// Bytes of an element: 1, 2, 4 or 8; not 1 for [`Kind::Float`].
    pub(crate) size: usize,
    pub(crate) big_endian: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Float,
    Signed,
    Unsigned,
}

impl Element {
    /// An element of this kind and size, if there is one.
    pub(crate) fn new(kind: Kind, size: usize, big_endian: bool) -> Option<Self> {
        let exists = matches!(
            (kind, size),
            (_, 2 | 4 | 8) | (Kind::Signed | Kind::Unsigned, 1)
        );
        exists.then_some(Self {
            kind,
            size,
            big_endian,
        })
    }

    /// The element that numpy calls `descr`, for example `<f4` or, without a byte order, `u1`. A Boolean (`b1`)
    /// is read as a byte.
    pub(crate) fn of_numpy(descr: &str) -> Option<Self> {
        let big_endian = descr.starts_with('>');
        let mut letters = descr
            .strip_prefix(['<', '>', '|', '='])
            .unwrap_or(descr)
            .chars();
        let kind = match letters.next()? {
            'f' => Kind::Float,
            'i' => Kind::Signed,
            'u' => Kind::Unsigned,
            'b' if letters.as_str() == "1" => Kind::Unsigned,
            _ => return None,
        };
        Self::new(kind, letters.as_str().parse().ok()?, big_endian)
    }

    /// The largest rounding error of a stored number of magnitude up to `most`: half the distance of
    /// neighbouring floats, and zero for integers.
    pub(crate) fn rounding(self, most: f64) -> f64 {
        let digits = match (self.kind, self.size) {
            (Kind::Float, 2) => 11,
            (Kind::Float, 4) => 24,
            (Kind::Float, _) => 53,
            _ => return 0.0,
        };
        most * (0.5_f64).powi(digits)
    }
}

impl fmt::Display for Element {
    /// The name of the type as numpy and other programs write it: `float32`, `uint8`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            Kind::Float => "float",
            Kind::Signed => "int",
            Kind::Unsigned => "uint",
        };
        write!(f, "{kind}{}", 8 * self.size)
    }
}

impl Array {
    /// The array of this `shape` in `bytes`.
    ///
    /// # Errors
    /// If the shape needs another number of bytes.
    pub(crate) fn new(shape: Vec<usize>, element: Element, bytes: Vec<u8>) -> Result<Self, String> {
        if bytes_of(&shape, element) != Some(bytes.len() as u64) {
            return Err(format!(
                "its shape {shape:?} of {} each does not fit its {}",
                counted(element.size, "byte"),
                counted(bytes.len(), "byte")
            ));
        }
        Ok(Self {
            shape,
            element,
            bytes,
        })
    }

    /// The array of this `shape` in `bytes`, which are in column-major order, as for Fortran and for transposed
    /// views in numpy.
    ///
    /// # Errors
    /// As [`Array::new`]; also if it has more than two dimensions.
    pub(crate) fn by_columns(
        shape: Vec<usize>,
        element: Element,
        bytes: Vec<u8>,
    ) -> Result<Self, String> {
        let stored = Self::new(shape, element, bytes)?;
        let (rows, columns) = match stored.shape[..] {
            // One without columns may claim any number of rows.
            _ if stored.shape.len() < 2 || stored.len() == 0 => return Ok(stored),
            [rows, columns] => (rows, columns),
            _ => {
                return Err(
                    "it is stored column by column; write numpy.ascontiguousarray of it".into(),
                );
            }
        };
        let size = element.size;
        let mut bytes = Vec::with_capacity(stored.bytes.len());
        for row in 0..rows {
            for column in 0..columns {
                bytes.extend(&stored.bytes[(column * rows + row) * size..][..size]);
            }
        }
        Ok(Self { bytes, ..stored })
    }

    /// Number of elements.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len() / self.element.size
    }

    pub(crate) fn shape(&self) -> &[usize] {
        &self.shape
    }

    pub(crate) fn element(&self) -> Element {
        self.element
    }

    /// Number of rows; each row must have `columns` elements. An array without elements has no rows, whatever
    /// its shape.
    ///
    /// # Errors
    /// If it has another shape.
    pub(crate) fn rows(&self, columns: usize) -> Result<usize, String> {
        match self.shape[..] {
            [rows, found] if found == columns => Ok(rows),
            _ if self.len() == 0 => Ok(0),
            _ => Err(format!("its shape is {:?}, not [n, {columns}]", self.shape)),
        }
    }

    /// Its length; it must have one dimension.
    ///
    /// # Errors
    /// If it has another number of dimensions.
    pub(crate) fn length(&self) -> Result<usize, String> {
        match self.shape[..] {
            [length] => Ok(length),
            _ if self.len() == 0 => Ok(0),
            _ => Err(format!("its shape is {:?}, not [n]", self.shape)),
        }
    }

    /// Element number `index` in row-major order.
    ///
    /// # Panics
    /// If there is no such element.
    pub(crate) fn get(&self, index: usize) -> f64 {
        let Element {
            kind,
            size,
            big_endian,
        } = self.element;
        let stored = &self.bytes[index * size..][..size];
        let mut bits = [0; 8];
        for (place, &byte) in stored.iter().enumerate() {
            bits[if big_endian { size - 1 - place } else { place }] = byte;
        }
        let bits = u64::from_le_bytes(bits);
        match (kind, size) {
            (Kind::Float, 2) => half(bits as u16),
            (Kind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (Kind::Float, _) => f64::from_bits(bits),
            (Kind::Unsigned, _) => bits as f64,
            (Kind::Signed, 1) => f64::from(bits as i8),
            (Kind::Signed, 2) => f64::from(bits as i16),
            (Kind::Signed, 4) => f64::from(bits as i32),
            (Kind::Signed, _) => bits as i64 as f64,
        }
    }

    /// The first two numbers of row `row`, in an array with `columns` columns.
    pub(crate) fn point(&self, row: usize, columns: usize) -> [f64; 2] {
        let first = row * columns;
        [self.get(first), self.get(first + 1)]
    }

    /// Element number `index`, read as an index below `end`. `None` for -1, which means "none".
    ///
    /// # Errors
    /// If it is neither.
    pub(crate) fn index(&self, index: usize, end: usize) -> Result<Option<usize>, String> {
        let value = self.get(index);
        if value == -1.0 {
            return Ok(None);
        }
        if value >= 0.0 && value < end as f64 && value.fract() == 0.0 {
            return Ok(Some(value as usize));
        }
        Err(format!(
            "entry {index} is {value}, not the index of one of {end}"
        ))
    }

    /// All elements.
    pub(crate) fn to_vec(&self) -> Vec<f64> {
        (0..self.len()).map(|index| self.get(index)).collect()
    }

    /// All elements in single precision.
    pub(crate) fn to_f32(&self) -> Vec<f32> {
        (0..self.len())
            .map(|index| self.get(index) as f32)
            .collect()
    }

    /// All elements. Those in single precision are converted to the shortest decimals that round to them, so
    /// numbers that were printed with a few digits are restored exactly.
    pub(crate) fn to_decimals(&self) -> Vec<f64> {
        let mut values = self.to_vec();
        if self.element.kind == Kind::Float && self.element.size == 4 {
            for value in &mut values {
                *value = (*value as f32).to_string().parse().unwrap_or(f64::NAN);
            }
        }
        values
    }

    /// The bytes, if its elements are bytes.
    pub(crate) fn as_bytes(&self) -> Option<&[u8]> {
        let Element { kind, size, .. } = self.element;
        ((kind, size) == (Kind::Unsigned, 1)).then_some(&self.bytes)
    }
}

/// Number of bytes of an array; `None` if that is unreasonably large.
pub(super) fn bytes_of(shape: &[usize], element: Element) -> Option<u64> {
    (shape.iter()).try_fold(element.size as u64, |bytes, &side| {
        bytes.checked_mul(side as u64)
    })
}

/// The value of a binary16 number with these 16 bits.
fn half(bits: u16) -> f64 {
    let fraction = f64::from(bits & 0x3ff);
    let magnitude = match (bits >> 10) & 0x1f {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        exponent => (1024.0 + fraction) * 2f64.powi(i32::from(exponent) - 25),
    };
    if bits >> 15 == 1 {
        -magnitude
    } else {
        magnitude
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(kind: Kind, size: usize, big_endian: bool, bytes: &[u8]) -> Array {
        let element = Element::new(kind, size, big_endian).unwrap();
        Array::new(vec![bytes.len() / size], element, bytes.to_vec()).unwrap()
    }

    #[test]
    fn half_precision_is_decoded_by_the_standard() {
        // Largest, smallest normal, smallest subnormal, 1, -2, 1/3 rounded, infinity.
        for (bits, expected) in [
            (0x7bff, 65504.0),
            (0x0400, 2f64.powi(-14)),
            (0x0001, 2f64.powi(-24)),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x3555, 0.333_251_953_125),
            (0x7c00, f64::INFINITY),
            (0x0000, 0.0),
        ] {
            assert_eq!(half(bits), expected, "{bits:#x}");
        }
        assert!(half(0x7e00).is_nan());
    }

    #[test]
    fn every_type_is_read_in_both_byte_orders() {
        for (kind, size, little) in [
            (Kind::Signed, 1, (-3i8).to_le_bytes().to_vec()),
            (Kind::Signed, 2, (-3i16).to_le_bytes().to_vec()),
            (Kind::Signed, 4, (-3i32).to_le_bytes().to_vec()),
            (Kind::Signed, 8, (-3i64).to_le_bytes().to_vec()),
            (Kind::Float, 4, (-3f32).to_le_bytes().to_vec()),
            (Kind::Float, 8, (-3f64).to_le_bytes().to_vec()),
        ] {
            let big: Vec<u8> = little.iter().rev().copied().collect();
            assert_eq!(array(kind, size, false, &little).get(0), -3.0);
            assert_eq!(array(kind, size, true, &big).get(0), -3.0);
        }
        assert_eq!(
            array(Kind::Unsigned, 1, false, &[200, 255]).to_vec(),
            [200.0, 255.0]
        );
        assert_eq!(array(Kind::Unsigned, 2, false, &[255, 255]).get(0), 65535.0);
    }

    #[test]
    fn types_are_named_as_numpy_names_them() {
        for (descr, named) in [
            ("<f4", "float32"),
            (">f8", "float64"),
            ("f2", "float16"),
            ("|u1", "uint8"),
            ("=i2", "int16"),
            ("|b1", "uint8"),
        ] {
            assert_eq!(Element::of_numpy(descr).unwrap().to_string(), named);
        }
        for descr in ["|O", "<f1", "<f16", "<U4", "", "<", "b2", "<c8"] {
            assert_eq!(Element::of_numpy(descr), None, "{descr}");
        }
    }

    #[test]
    fn columns_become_rows() {
        let element = Element::new(Kind::Unsigned, 2, false).unwrap();
        let bytes: Vec<u8> = (0..6_u16).flat_map(u16::to_le_bytes).collect();
        let of = |shape: &[usize]| Array::by_columns(shape.to_vec(), element, bytes.clone());
        assert_eq!(of(&[2, 3]).unwrap().to_f32(), [0., 2., 4., 1., 3., 5.]);
        assert_eq!(of(&[6]).unwrap().to_vec(), [0., 1., 2., 3., 4., 5.]);
        assert!(of(&[1, 2, 3]).unwrap_err().contains("column by column"));
        assert!(of(&[2, 2]).is_err());
        // Rows that have nothing in them are not gone through.
        let empty = Array::by_columns(vec![10_usize.pow(18), 0], element, Vec::new());
        assert_eq!(empty.unwrap().len(), 0);
    }

    #[test]
    fn single_precision_comes_back_as_it_was_printed() {
        let bytes = [0.97598_f32, -0.05925].map(f32::to_le_bytes).concat();
        let single = array(Kind::Float, 4, false, &bytes);
        assert_eq!(single.to_decimals(), [0.97598, -0.05925]);
        assert_ne!(single.to_vec(), [0.97598, -0.05925]);
    }

    #[test]
    fn a_shape_that_does_not_fit_is_refused() {
        let element = Element::new(Kind::Float, 4, false).unwrap();
        assert!(Array::new(vec![2, 2], element, vec![0; 12]).is_err());
        assert!(Array::new(vec![usize::MAX, 2], element, vec![0; 8]).is_err());
        let array = Array::new(vec![3, 2], element, vec![0; 24]).unwrap();
        assert_eq!(array.rows(2), Ok(3));
        assert!(array.rows(3).unwrap_err().contains("[3, 2]"));
        assert!(array.length().is_err());
        let empty = Array::new(vec![0], element, vec![]).unwrap();
        assert_eq!(empty.rows(2), Ok(0));
        assert_eq!(Element::new(Kind::Float, 1, false), None);
    }

    #[test]
    fn an_index_is_whole_and_within_bounds() {
        let bytes: Vec<u8> = [-1i16, 4, 5, -2]
            .iter()
            .flat_map(|i| i.to_le_bytes())
            .collect();
        let array = array(Kind::Signed, 2, false, &bytes);
        assert_eq!(array.index(0, 5), Ok(None));
        assert_eq!(array.index(1, 5), Ok(Some(4)));
        assert!(array.index(2, 5).unwrap_err().contains("is 5"));
        assert!(array.index(3, 5).is_err());
    }
}
