//! Checks arrays that come from Python, and makes the arrays that are returned.
//!
//! The message of a refusal names the argument, its dtype and shape, and what is expected. Pixels, points and
//! descriptors are copied once, into the types of the library.

use matchbench::counted::counted;
use matchbench::datasets::{check_size, gray_of_rgb};
use matchbench::external::wrong_descriptor;
use matchbench_vision::features::{BinaryRows, DescriptorKind, Descriptors, FloatRows};
use matchbench_vision::image::{GrayImage, Size};
use nalgebra::{Matrix3, Point2};
use numpy::{
    AllowTypeChange, Element, PyArray2, PyArray3, PyArrayDescrMethods, PyArrayLike1, PyArrayLike2,
    PyArrayMethods, PyReadonlyArray, PyUntypedArray, PyUntypedArrayMethods,
    ndarray::{ArrayView, Dimension, IntoDimension},
};
use pyo3::exceptions::{PyIndexError, PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use crate::errors::value_error;

/// An image: `uint8`, h x w (grey) or h x w x 3 (red, green, blue; converted to grey as a colour PNG file is).
///
/// # Errors
/// If it is anything else, or larger than an image in a file may be.
pub(crate) fn image(value: &Bound<'_, PyAny>) -> PyResult<GrayImage> {
    refuse_masked(value, "image")?;
    if let Ok(gray) = value.cast::<PyArray2<u8>>() {
        let gray = gray.try_readonly()?;
        let [height, width] = *gray.shape() else {
            unreachable!("it has two dimensions")
        };
        let size = image_size(width, height)?;
        return Ok(GrayImage::from_vec(size, flat(&gray)?));
    }
    if let Ok(rgb) = value.cast::<PyArray3<u8>>()
        && rgb.shape()[2] == 3
    {
        let rgb = rgb.try_readonly()?;
        let size = image_size(rgb.shape()[1], rgb.shape()[0])?;
        return Ok(gray_of_rgb(size, &flat(&rgb)?));
    }
    let expected =
        "an image is a numpy array of uint8, height x width (grey) or height x width x 3 (RGB)";
    let Ok(array) = value.cast::<PyUntypedArray>() else {
        return Err(PyTypeError::new_err(format!(
            "{expected}; this is {}",
            kind_of(value)
        )));
    };
    if array.dtype().is_equiv_to(&numpy::dtype::<u8>(value.py())) {
        return Err(PyValueError::new_err(format!(
            "{expected}; this one has shape {:?}{}",
            array.shape(),
            remedy_of_shape(array.shape())
        )));
    }
    let remedy = match array.dtype().kind() {
        b'b' => "; convert it by image * numpy.uint8(255)",
        b'f' => {
            "; convert values from 0 to 1 by (image * 255).round().astype(numpy.uint8), values from 0 to 255 \
             by image.round().astype(numpy.uint8)"
        }
        // As 16-bit files are read.
        b'u' if array.dtype().itemsize() == 2 => {
            "; convert values that fill 16 bits by (image >> 8).astype(numpy.uint8), others bring to 0 to 255 first"
        }
        _ => "; bring its values to 0 to 255, then convert it by image.astype(numpy.uint8)",
    };
    Err(PyTypeError::new_err(format!(
        "{expected}; this one has dtype {}{remedy}",
        array.dtype()
    )))
}

/// How an array of this shape, which is none of an image here, becomes one.
fn remedy_of_shape(shape: &[usize]) -> &'static str {
    match shape {
        [_, _, 1] => "; take its only channel by image[:, :, 0]",
        [_, _, 4] => "; leave out the fourth channel (alpha) by image[:, :, :3]",
        [1, _, _] => "; take its only channel by image[0]",
        [3 | 4, _, _] => "; bring its channels to the end by image.transpose(1, 2, 0)",
        _ => "",
    }
}

/// The size of an image, before its pixels are copied.
fn image_size(width: usize, height: usize) -> PyResult<Size> {
    check_size(Size::new(width, height))
        .map_err(|error| value_error(format!("{error}; make it smaller first")))
}

/// Points: n x 2, of any real type, or an empty list. `name` is the name of the argument.
///
/// # Errors
/// If it is anything else, or contains a number that is not finite.
pub(crate) fn points(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<Point2<f64>>> {
    let expected = "an array of numbers, n x 2 (x, y in pixels)";
    let numbers = numbers(value, name, expected)?;
    // An empty list is an array without columns.
    if numbers.shape() == [0] {
        return Ok(Vec::new());
    }
    if let [_, 1, 2] = numbers.shape() {
        let remedy = format!("; bring cv2's n x 1 x 2 to n x 2 by {name}.reshape(-1, 2)");
        return Err(refused_with(value, name, expected, &remedy));
    }
    let array: PyArrayLike2<'_, f64, AllowTypeChange> =
        converted(&numbers, || refused(value, name, expected))?;
    let view = array.as_array();
    if view.ncols() != 2 {
        return Err(refused(value, name, "n x 2 (x, y in pixels)"));
    }
    let mut points = room(view.nrows())?;
    let rows = view.rows().into_iter();
    points.extend(rows.map(|row| Point2::new(row[0], row[1])));
    let finite = |p: &Point2<f64>| p.x.is_finite() && p.y.is_finite();
    all_finite(name, points.iter().map(finite))?;
    Ok(points)
}

/// A matrix of 3 x 3 numbers of any real type.
///
/// # Errors
/// If it is anything else.
pub(crate) fn matrix_3x3(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Matrix3<f64>> {
    let expected = "an array of numbers, 3 x 3";
    let numbers = numbers(value, name, expected)?;
    let array: PyArrayLike2<'_, f64, AllowTypeChange> =
        converted(&numbers, || refused(value, name, expected))?;
    let view = array.as_array();
    if view.shape() != [3, 3] {
        return Err(refused(value, name, expected));
    }
    Ok(Matrix3::from_fn(|row, column| view[[row, column]]))
}

/// Checks that all rows of the argument `name` are finite.
///
/// # Errors
/// If one is not.
pub(crate) fn all_finite(name: &str, mut rows: impl Iterator<Item = bool>) -> PyResult<()> {
    match rows.position(|finite| !finite) {
        None => Ok(()),
        Some(row) => Err(value_error(format!(
            "`{name}` holds a number that is not finite, in row {row}; leave such rows out"
        ))),
    }
}

/// The same for consecutive rows of single precision.
fn rows_finite(name: &str, values: &[f32], columns: usize) -> PyResult<()> {
    let finite = |row: &[f32]| row.iter().all(|value| value.is_finite());
    all_finite(name, values.chunks(columns).map(finite))
}

/// One number for each of `count` items.
///
/// # Errors
/// If their number differs, or they are not numbers.
pub(crate) fn column(value: &Bound<'_, PyAny>, name: &str, count: usize) -> PyResult<Vec<f32>> {
    let expected = format!("an array of {count} numbers");
    let numbers = numbers(value, name, &expected)?;
    // Before anything is copied: an array may claim any length.
    if numbers.shape() != [count] {
        return Err(refused(value, name, &expected));
    }
    let array: PyArrayLike1<'_, f32, AllowTypeChange> =
        converted(&numbers, || refused(value, name, &expected))?;
    flat(&array)
}

/// Rows of `columns` numbers in single precision, row after row.
///
/// # Errors
/// If it is anything else, or contains a number that is not finite.
pub(crate) fn rows(value: &Bound<'_, PyAny>, name: &str, columns: usize) -> PyResult<Vec<f32>> {
    let expected = format!("an array of numbers, n x {columns}");
    let numbers = numbers(value, name, &expected)?;
    let array: PyArrayLike2<'_, f32, AllowTypeChange> =
        converted(&numbers, || refused(value, name, &expected))?;
    if array.as_array().ncols() != columns {
        return Err(refused(value, name, &expected));
    }
    let values = flat(&array)?;
    rows_finite(name, &values, columns)?;
    Ok(values)
}

/// Which of `count` items are selected, by indices or by a mask with one bool per item.
///
/// # Errors
/// If it is anything else, or an index is out of range.
pub(crate) fn chosen(value: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<usize>> {
    let expected = format!("a list of whole numbers, or a mask of {count} bools");
    let refuse = || refused(value, "indices", &expected);
    let array = array_or(value, refuse)?;
    if array.len() == 0 && array.ndim() == 1 && array.dtype().kind() != b'b' {
        return Ok(Vec::new());
    }
    match array.dtype().kind() {
        b'b' => {
            // A byte of a mask may be neither 0 nor 1 (`cv2_mask.view(bool)`), which is no bool here.
            let bytes = array.call_method1("view", ("uint8",))?;
            let mask: PyArrayLike1<'_, u8> = converted(&bytes, refuse)?;
            let mask = mask.as_array();
            if mask.len() != count {
                return Err(refuse());
            }
            Ok((0..count).filter(|&i| mask[i] != 0).collect())
        }
        b'i' | b'u' => {
            let indices: PyArrayLike1<'_, i64, AllowTypeChange> = converted(&array, refuse)?;
            let within = |&index: &i64| usize::try_from(index).ok().filter(|&index| index < count);
            let indices = indices.as_array();
            let mut chosen = room(indices.len())?;
            for index in indices {
                chosen.push(
                    within(index).ok_or_else(|| {
                        PyIndexError::new_err(format!("feature {index} of {count}"))
                    })?,
                );
            }
            Ok(chosen)
        }
        _ => Err(refuse()),
    }
}

/// The value as a numpy array of real numbers. Complex numbers would lose a part; times and texts are not numbers.
///
/// A value that is not an array yet must not be converted element by element: its length would be asked for, and
/// memory for that many elements would be allocated at once, whatever it says.
fn numbers<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    expected: &str,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    refuse_masked(value, name)?;
    let array = array_or(value, || refused(value, name, expected))?;
    match array.dtype().kind() {
        b'b' | b'f' | b'i' | b'u' | b'O' => Ok(array),
        _ => Err(refused(value, name, expected)),
    }
}

/// Refuses a masked array of numpy, unless nothing in it is masked: the mask would be lost.
fn refuse_masked(value: &Bound<'_, PyAny>, name: &str) -> PyResult<()> {
    // Most values are plain arrays, which have no mask.
    if value.cast_exact::<PyUntypedArray>().is_ok() {
        return Ok(());
    }
    let numpy = value.py().import("numpy.ma")?;
    if numpy.call_method1("is_masked", (value,))?.is_truthy()? {
        return Err(value_error(format!(
            "`{name}` has masked elements, which would be taken for values; leave them out, or fill them by .filled(value)"
        )));
    }
    Ok(())
}

/// The value as an array, or the refusal, see [`refusal_of`].
fn array_or<'py>(
    value: &Bound<'py, PyAny>,
    refusal: impl Fn() -> PyErr,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    as_array(value).map_err(|error| refusal_of(value.py(), error, refusal))
}

/// The array as one of another type, or the refusal, see [`refusal_of`].
fn converted<'a, 'py, T>(array: &'a Bound<'py, PyAny>, refusal: impl Fn() -> PyErr) -> PyResult<T>
where
    T: FromPyObject<'a, 'py, Error: Into<PyErr>>,
{
    array
        .extract()
        .map_err(|error: T::Error| refusal_of(array.py(), error.into(), refusal))
}

/// The refusal, caused by what numpy says of a value that is no such array. Other errors are not about the value (too
/// little memory, Ctrl-C) and stay what they are.
fn refusal_of(py: Python<'_>, error: PyErr, refusal: impl Fn() -> PyErr) -> PyErr {
    if !error.is_instance_of::<PyTypeError>(py) && !error.is_instance_of::<PyValueError>(py) {
        return error;
    }
    let refusal = refusal();
    refusal.set_cause(py, Some(error));
    refusal
}

/// The value as a numpy array whose elements are aligned.
fn as_array<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let numpy = value.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (value,))?;
    Ok(aligned(&array)?.cast_into::<PyUntypedArray>()?)
}

/// The array itself, or a copy of it if its elements are not aligned (those of a column of records, for example).
/// Elements that are not aligned must not be read through references.
fn aligned<'py>(array: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = array.py().import("numpy")?;
    numpy.call_method1("require", (array, array.py().None(), ["A"]))
}

/// Pairs of indices: m x 2, each below its count, or an empty list.
///
/// # Errors
/// If they are anything else, or an index is out of range.
pub(crate) fn index_pairs(value: &Bound<'_, PyAny>, counts: [usize; 2]) -> PyResult<Vec<[u32; 2]>> {
    let expected = "an array of whole numbers, m x 2 (feature of a, feature of b)";
    let refuse = || refused(value, "indices", expected);
    // A conversion to integers would drop fractions, and would turn a mask into zeros and ones.
    let whole = array_or(value, refuse)?;
    if whole.len() > 0 && !matches!(whole.dtype().kind(), b'i' | b'u') {
        return Err(refuse());
    }
    // An empty list is an array without columns.
    if whole.shape() == [0] {
        return Ok(Vec::new());
    }
    let array: PyArrayLike2<'_, i64, AllowTypeChange> = converted(&whole, refuse)?;
    let view = array.as_array();
    if view.ncols() != 2 {
        return Err(refuse());
    }
    let mut pairs = room(view.nrows())?;
    for (number, row) in view.rows().into_iter().enumerate() {
        let mut pair = [0; 2];
        for side in 0..2 {
            let index = usize::try_from(row[side]).ok();
            let index = index.filter(|&index| index < counts[side]);
            pair[side] = index
                .and_then(|index| u32::try_from(index).ok())
                .ok_or_else(|| {
                    PyValueError::new_err(format!(
                        "match {number} names feature {} of image {}, which has {}",
                        row[side],
                        ["a", "b"][side],
                        counts[side]
                    ))
                })?;
        }
        pairs.push(pair);
    }
    Ok(pairs)
}

/// Descriptors: n x d, `float32` (real values) or `uint8` (bits, eight per byte, the least significant first).
/// `bits` is the number of bits of a row that are used; `None` means all.
///
/// # Errors
/// If it is anything else, contains a number that is not finite, or one with which distances would not be.
pub(crate) fn descriptors(value: &Bound<'_, PyAny>, bits: Option<usize>) -> PyResult<Descriptors> {
    let expected = "an array n x d, of float32 (real values) or uint8 (bits, eight in a byte)";
    refuse_masked(value, "descriptors")?;
    // Anything else than an array is refused below, in words.
    let value = &match value.cast::<PyUntypedArray>() {
        Ok(array) => aligned(array)?,
        Err(_) => value.clone(),
    };
    if let Ok(floats) = value.cast::<PyArray2<f32>>() {
        let floats = floats.try_readonly()?;
        let dim = floats.shape()[1];
        if bits.is_some() {
            let message = "`bits` is for descriptors of uint8; these are float32";
            return Err(PyValueError::new_err(message));
        }
        if dim == 0 {
            return Err(refused(value, "descriptors", expected));
        }
        let values = flat(&floats)?;
        rows_finite("descriptors", &values, dim)?;
        if let Some(wrong) = wrong_descriptor(&values, dim) {
            return Err(value_error(format!("`descriptors`: {wrong}")));
        }
        return Ok(Descriptors::Float(FloatRows::from_vec(dim, values)));
    }
    let Ok(bytes) = value.cast::<PyArray2<u8>>() else {
        let is_float = |array: &Bound<'_, PyUntypedArray>| array.dtype().kind() == b'f';
        let remedy = match value.cast::<PyUntypedArray>() {
            Ok(array) if is_float(array) && array.ndim() == 2 => {
                "; convert it by descriptors.astype(numpy.float32)"
            }
            _ => "",
        };
        return Err(refused_with(value, "descriptors", expected, remedy));
    };
    let bytes = bytes.try_readonly()?;
    let width = bytes.shape()[1];
    let bits = bits.unwrap_or(8 * width);
    if bits.div_ceil(8) != width || bits == 0 {
        let message = format!("{bits} bits do not fill rows of {width} bytes");
        return Err(PyValueError::new_err(message));
    }
    let bytes_flat = flat(&bytes)?;
    let words = room(bytes.shape()[0] * bits.div_ceil(64))?;
    let mut rows = BinaryRows::from_vec(bits, words);
    for row in bytes_flat.chunks(width) {
        rows.push_bytes(row);
    }
    Ok(Descriptors::Binary(rows))
}

/// The descriptors as an array, see [`descriptors`].
pub(crate) fn descriptors_out<'py>(
    py: Python<'py>,
    descriptors: &Descriptors,
) -> PyResult<Bound<'py, PyAny>> {
    let count = descriptors.len();
    match (descriptors, descriptors.kind()) {
        (Descriptors::Float(rows), DescriptorKind::Float { dim }) => {
            matrix(py, rows.data().to_vec(), [count, dim])
        }
        (Descriptors::Binary(rows), _) => matrix(py, rows.to_bytes(), [count, rows.bytes()]),
        _ => unreachable!("the kind is that of the descriptors"),
    }
}

/// `values`, row after row, as an array of this shape. They are moved, not copied.
pub(crate) fn matrix<T: Element, const N: usize>(
    py: Python<'_>,
    values: Vec<T>,
    shape: [usize; N],
) -> PyResult<Bound<'_, PyAny>>
where
    [usize; N]: IntoDimension,
{
    let flat = numpy::PyArray1::from_vec(py, values);
    Ok(flat.reshape(shape)?.into_any())
}

/// One number for each item as an array, where they are known.
pub(crate) fn known_column<'py>(
    py: Python<'py>,
    values: Option<&Vec<f32>>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let known = values.map(|values| matrix(py, values.clone(), [values.len()]));
    known.transpose()
}

/// The elements in the order of the array, whatever its strides.
///
/// # Errors
/// If there is no memory for them.
fn flat<T: Element + Copy, D: Dimension>(array: &PyReadonlyArray<'_, T, D>) -> PyResult<Vec<T>> {
    let view: ArrayView<'_, T, D> = array.as_array();
    let mut values = room(view.len())?;
    match view.as_slice() {
        Some(slice) => values.extend_from_slice(slice),
        None => values.extend(view.iter().copied()),
    }
    Ok(values)
}

/// A few values, at most so many. A sequence may claim any length (`range(10**12)`), and room for all is asked for before
/// they are read.
pub(crate) fn few<'py, T: FromPyObjectOwned<'py>>(
    value: &Bound<'py, PyAny>,
    name: &str,
    most: usize,
) -> PyResult<Vec<T>> {
    let count = value.len()?;
    if count > most {
        let what = format!("{name}: {count} values, at most {most} are expected");
        return Err(PyValueError::new_err(what));
    }
    value.extract()
}

/// A few numbers in the order of an array of any shape, at most so many: cv2 has coefficients as 1 x 5 or 4 x 1.
///
/// # Errors
/// If they are more, or are not numbers.
pub(crate) fn few_numbers(value: &Bound<'_, PyAny>, name: &str, most: usize) -> PyResult<Vec<f64>> {
    let expected = "a few numbers";
    let too_many = |count| {
        let what = format!("{name}: {count} values, at most {most} are expected");
        Err(PyValueError::new_err(what))
    };
    // Before they are read, as in `few`.
    match value.len() {
        Ok(count) if count > most => return too_many(count),
        _ => {}
    }
    let array = numbers(value, name, expected)?;
    if array.len() > most {
        return too_many(array.len());
    }
    let flat = array.call_method0("ravel")?;
    let array: PyArrayLike1<'_, f64, AllowTypeChange> =
        converted(&flat, || refused(value, name, expected))?;
    self::flat(&array)
}

/// An empty vector with room for so many values. An array may claim any number of values
/// (`numpy.broadcast_to`), and an allocation that fails would end the process.
fn room<T>(count: usize) -> PyResult<Vec<T>> {
    let mut values = Vec::new();
    let reserved = values.try_reserve_exact(count);
    reserved.map_err(|_| {
        PyMemoryError::new_err(format!("no memory for an array of {count} rows or numbers"))
    })?;
    Ok(values)
}

/// The error that the argument `name` is not what is `expected`.
pub(crate) fn refused(value: &Bound<'_, PyAny>, name: &str, expected: &str) -> PyErr {
    refused_with(value, name, expected, "")
}

/// The same, with the `remedy` at the end of its message.
fn refused_with(value: &Bound<'_, PyAny>, name: &str, expected: &str, remedy: &str) -> PyErr {
    let message = format!(
        "`{name}` must be {expected}; this is {}{remedy}",
        kind_of(value)
    );
    match value.cast::<PyUntypedArray>() {
        Ok(array) if matches!(array.dtype().kind(), b'f' | b'i' | b'u') => {
            PyValueError::new_err(message)
        }
        _ => PyTypeError::new_err(message),
    }
}

/// The type of a value, for messages.
pub(crate) fn kind_of(value: &Bound<'_, PyAny>) -> String {
    if let Ok(array) = value.cast::<PyUntypedArray>() {
        return format!(
            "an array of {} with shape {:?}",
            array.dtype(),
            array.shape()
        );
    }
    let kind = value.get_type();
    let name = kind.name();
    let name = name.map_or_else(|_| kind.to_string(), |name| name.to_string());
    // A list may be right but for its length.
    let is_list = value.is_instance_of::<PyTuple>() || value.is_instance_of::<PyList>();
    match value.len() {
        Ok(count) if is_list => format!("a {name} of {}", counted(count, "value")),
        _ => format!("a value of type {name}"),
    }
}
