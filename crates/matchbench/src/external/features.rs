//! Features of images as a child process writes them: an `.npz` file. Nothing of it is believed; everything
//! is checked.
//!
//! | array | shape | type | |
//! | --- | --- | --- | --- |
//! | `keypoints` | n x 2 | float | x and y in pixels of the original image |
//! | `descriptors` | n x d | float16, float32 or uint8 | bits in bytes, lowest first, if `hamming` is set |
//! | `scales` | n | float | diameter of what was described, in pixels, not below 0; default: 1 |
//! | `angles` | n | float | orientation in radians, from x towards y; NaN: none; default: none |
//! | `scores` | n | float | strength, higher is better; default: 0 |
//!
//! Bytes without `hamming` are real values, as in COLMAP's SIFT.

use std::f32::consts::TAU;
use std::path::Path;

use matchbench_vision::features::{BinaryRows, Descriptors, Features, FloatRows, Keypoint};
use matchbench_vision::image::Size;
use nalgebra::Point2;

use super::answer::is_inside;
use crate::arrays::{Array, ArrayError, Npz};
use crate::counted::counted;
use crate::memory::{Reserved, TooMuch, reserve};

/// Most features of an image.
const MAX_FEATURES: usize = 1_000_000;
/// Longest descriptor, in values or bytes.
const LONGEST_DESCRIPTOR: usize = 4096;
/// Largest angle in radians: a turn, with room for rounding.
const LARGEST_ANGLE: f32 = TAU + 0.01;
/// Arrays that are known.
const KNOWN: [&str; 5] = ["keypoints", "descriptors", "scales", "angles", "scores"];

/// Memory for the features in this file, from when they are read until they are saved.
///
/// # Errors
/// If there is not so much.
pub(super) fn memory_for(path: &Path) -> Result<Option<Reserved<'static>>, TooMuch> {
    needed_for(path).map(reserve).transpose()
}

/// The bytes that the features in this file take. An array is held as it is stored, as numbers (`f32`, whatever the file
/// has), and as it is saved, where bytes may be bytes again; and searches keep less than these numbers once more.
fn needed_for(path: &Path) -> Option<usize> {
    const NUMBER: u64 = size_of::<f32>() as u64;
    // What is wrong with the file shows when it is read.
    let stated = Npz::open(path).ok()?.stated_elements();
    let needed = stated.into_iter().map(|[elements, stored]| {
        let saved = if stored == 1 { 1 } else { NUMBER };
        elements.saturating_mul(stored + NUMBER + saved + NUMBER)
    });
    let needed = needed.fold(0, u64::saturating_add);
    Some(usize::try_from(needed).unwrap_or(usize::MAX))
}

/// Reads the `count` features of an image of this size.
///
/// # Errors
/// If they are not what was promised, in words.
pub(super) fn read_features(
    path: &Path,
    count: usize,
    size: Size,
    pixel_center: f32,
    hamming: bool,
) -> Result<Features, String> {
    let wrong = |error: ArrayError| format!("its file of features: {}", error.what());
    if count > MAX_FEATURES {
        return Err(format!(
            "it promises {count} features; {MAX_FEATURES} are the most"
        ));
    }
    // No array of so many features is larger, whatever the file says or becomes.
    let most_bytes = (count + 1) * LONGEST_DESCRIPTOR * size_of::<f64>();
    let mut file = (Npz::open(path).map_err(wrong)?).with_arrays_of(most_bytes);
    if let Some(unknown) = (file.names().iter()).find(|name| !KNOWN.contains(&name.as_str())) {
        let known = KNOWN.join(", ");
        return Err(format!("it wrote an array `{unknown}`; there are {known}"));
    }
    let points = array(&mut file, "keypoints", &[count, 2])?.ok_or("it wrote no `keypoints`")?;
    let mut column = |name: &str| array(&mut file, name, &[count]);
    let (scales, angles, scores) = (column("scales")?, column("angles")?, column("scores")?);
    if let Some(wrong) = scales.as_deref().and_then(wrong_size) {
        return Err(format!("its `scales` are {wrong}"));
    }
    if let Some(wrong) = angles.as_deref().and_then(wrong_angle) {
        return Err(format!("its `angles`: {wrong}"));
    }
    let keypoint = |index: usize| {
        let [x, y] = [2 * index, 2 * index + 1].map(|at| points[at] - pixel_center);
        if !is_inside(x, y, size) {
            return Err(format!(
                "keypoint {index} lies outside the image: ({x}, {y}) of {size} pixels; points are \
                 pixels of the original image, x before y"
            ));
        }
        let at = |column: &Option<Vec<f32>>| column.as_ref().map(|column| column[index]);
        Ok(Keypoint {
            at: Point2::new(x, y),
            size: at(&scales).unwrap_or(1.0),
            angle: at(&angles).filter(|angle| !angle.is_nan()),
            response: at(&scores).unwrap_or(0.0),
            octave: 0,
        })
    };
    let keypoints = (0..count).map(keypoint).collect::<Result<_, _>>()?;
    let descriptors = file.find("descriptors").map_err(wrong)?;
    let descriptors = descriptors.ok_or("it wrote no `descriptors`")?;
    Ok(Features::new(
        size,
        keypoints,
        read_descriptors(&descriptors, count, hamming)?,
    ))
}

/// What is wrong with sizes of keypoints: one is below 0, and no diameter.
pub fn wrong_size(sizes: &[f32]) -> Option<String> {
    let row = sizes.iter().position(|size| *size < 0.0)?;
    Some(format!(
        "diameters, not below 0; row {row} is {}",
        sizes[row]
    ))
}

/// What is wrong with angles in radians, of which those that are NaN are none: one is more than a turn, as degrees are,
/// or all are the -1 by which cv2 says that there is none.
pub fn wrong_angle(angles: &[f32]) -> Option<String> {
    const REMEDY: &str = "cv2 has degrees, and -1 where there is none; give \
                          numpy.where(angles < 0, numpy.nan, numpy.deg2rad(angles))";
    if let Some(row) = angles.iter().position(|angle| angle.abs() > LARGEST_ANGLE) {
        let angle = angles[row];
        return Some(format!(
            "radians are from -2 pi to 2 pi, and row {row} is {angle}. {REMEDY}"
        ));
    }
    (angles.len() > 1 && angles.iter().all(|angle| *angle == -1.0))
        .then(|| format!("every row is -1, and these are radians. {REMEDY}"))
}

/// What is wrong with the values of descriptors of this length: one is so large that squared distances overflow.
pub fn wrong_descriptor(values: &[f32], length: usize) -> Option<String> {
    let largest = FloatRows::largest_value(length);
    let at = values.iter().position(|value| value.abs() > largest)?;
    Some(format!(
        "row {} has the value {:e}, and beyond about {largest:.0e} distances of rows of {} are infinite; divide all \
         descriptors by one number",
        at / length,
        values[at],
        counted(length, "value"),
    ))
}

/// The values of an array, if it is there: of this shape, and all finite, or NaN among `angles`.
fn array(file: &mut Npz, name: &str, shape: &[usize]) -> Result<Option<Vec<f32>>, String> {
    let found = file.find(name);
    let Some(array) = found.map_err(|error| format!("its file of features: {}", error.what()))?
    else {
        return Ok(None);
    };
    if array.shape() != shape {
        let found = array.shape();
        return Err(format!(
            "its `{name}` have the shape {found:?}, not {shape:?}"
        ));
    }
    let values = array.to_f32();
    let is_wrong = |value: &&f32| !(value.is_finite() || (value.is_nan() && name == "angles"));
    match values.iter().find(is_wrong) {
        Some(value) => Err(format!("its `{name}` hold {value}")),
        None => Ok(Some(values)),
    }
}

fn read_descriptors(array: &Array, count: usize, hamming: bool) -> Result<Descriptors, String> {
    let &[rows, length] = array.shape() else {
        return Err(format!(
            "its `descriptors` have the shape {:?}",
            array.shape()
        ));
    };
    if rows != count || !(1..=LONGEST_DESCRIPTOR).contains(&length) {
        return Err(format!(
            "its `descriptors` are {rows} of {length} values, for {count} features; a descriptor \
             has 1 to {LONGEST_DESCRIPTOR}"
        ));
    }
    if hamming {
        let bytes = array.as_bytes().ok_or_else(|| {
            format!(
                "its `descriptors` are {}, but bits (`hamming`) come as uint8",
                array.element()
            )
        })?;
        return Ok(Descriptors::Binary(BinaryRows::from_bytes(
            8 * length,
            bytes,
        )));
    }
    let values = array.to_f32();
    if let Some(value) = values.iter().find(|value| !value.is_finite()) {
        return Err(format!("its `descriptors` hold {value}"));
    }
    match wrong_descriptor(&values, length) {
        Some(wrong) => Err(format!("its `descriptors`: {wrong}")),
        None => Ok(Descriptors::Float(FloatRows::from_vec(length, values))),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, OpenOptions};
    use std::io::Write;
    use std::thread;

    use super::*;
    use crate::arrays::testing::{floats, npy, write_npz};

    const SIZE: Size = Size::new(640, 480);

    fn read(arrays: &[(&str, Vec<u8>)], count: usize, hamming: bool) -> Result<Features, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npz");
        write_npz(&path, arrays);
        read_features(&path, count, SIZE, 0.5, hamming)
    }

    #[test]
    fn memory_is_asked_for_numbers_however_few_bytes_they_are_stored_in() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npz");
        let needed = |descr: &str, size: usize| {
            let rows = npy(descr, "(100, 50)", &vec![1; 5000 * size]);
            write_npz(&path, &[("descriptors", rows)]);
            needed_for(&path).unwrap()
        };
        // Stored, as `f32`, as saved, and what searches keep.
        assert_eq!(needed("|u1", 1), 5000 * (1 + 4 + 1 + 4));
        assert_eq!(needed("<f2", 2), 5000 * (2 + 4 + 4 + 4));
        assert_eq!(needed("<f4", 4), 5000 * (4 + 4 + 4 + 4));
        assert_eq!(needed("<f8", 8), 5000 * (8 + 4 + 4 + 4));
        std::fs::write(&path, "no archive").unwrap();
        assert_eq!(needed_for(&path), None);
    }

    #[test]
    fn what_is_given_is_kept_and_the_rest_has_defaults() {
        let points = ("keypoints", floats("(2, 2)", &[0.5, 480.0, 10.0, 20.25]));
        let rows = (
            "descriptors",
            floats("(2, 3)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        );
        let few = read(&[points.clone(), rows.clone()], 2, false).unwrap();
        let expected = Keypoint {
            at: Point2::new(0.0, 479.5),
            size: 1.0,
            angle: None,
            response: 0.0,
            octave: 0,
        };
        assert_eq!(few.keypoints[0], expected);
        assert_eq!(few.size, SIZE);
        let Descriptors::Float(floats_read) = &few.descriptors else {
            panic!("real values")
        };
        assert_eq!(floats_read.row(1), [4.0, 5.0, 6.0]);
        let more = [
            points,
            rows,
            ("scales", floats("(2,)", &[3.0, 4.0])),
            ("angles", floats("(2,)", &[0.0, 1.0])),
            ("scores", floats("(2,)", &[0.25, 0.5])),
        ];
        let all = read(&more, 2, false).unwrap().keypoints[1];
        assert_eq!((all.size, all.angle, all.response), (4.0, Some(1.0), 0.5));
    }

    #[test]
    fn angles_are_radians_or_none() {
        let kept = |angles: &[f32]| {
            let count = angles.len();
            let column = |values: &[f32]| floats(&format!("({count},)"), values);
            let rows = |values: &[f32]| floats(&format!("({count}, 2)"), values);
            let arrays = [
                ("keypoints", rows(&vec![5.0; 2 * count])),
                ("descriptors", rows(&vec![1.0; 2 * count])),
                ("angles", column(angles)),
            ];
            let found = read(&arrays, count, false)?;
            let angles = found.keypoints.iter().map(|keypoint| keypoint.angle);
            Ok::<_, String>(angles.collect::<Vec<_>>())
        };
        let turn = 360f32.to_radians();
        for angles in [
            &[-1.0][..],
            &[-1.0, f32::NAN],
            &[turn, -turn],
            &[f32::NAN; 2],
            &[],
        ] {
            let expected = angles
                .iter()
                .map(|angle| (!angle.is_nan()).then_some(*angle));
            assert_eq!(kept(angles), Ok(expected.collect()), "{angles:?}");
        }
        for (angles, named) in [
            ([0.0, 6.5], "row 1 is 6.5"),
            ([-90.0, 1.0], "row 0 is -90"),
            ([-1.0, -1.0], "every row is -1"),
        ] {
            let wrong = kept(&angles).unwrap_err();
            assert!(
                wrong.starts_with("its `angles`: ")
                    && wrong.contains(named)
                    && wrong.contains("cv2 has degrees"),
                "{wrong}"
            );
        }
        assert_eq!(kept(&[f32::INFINITY]).unwrap_err(), "its `angles` hold inf");
    }

    #[test]
    fn descriptors_whose_distances_overflow_are_refused() {
        let read_rows = |values: &[f32]| {
            let points = ("keypoints", floats("(2, 2)", &[5.0; 4]));
            let rows = ("descriptors", floats("(2, 3)", values));
            read(&[points, rows], 2, false).map(drop)
        };
        let largest = FloatRows::largest_value(3);
        let rows = |value| [1.0, 2.0, 3.0, 4.0, value, 6.0];
        assert_eq!(read_rows(&rows(-largest)), Ok(()));
        let wrong = read_rows(&rows(-3e38)).unwrap_err();
        let named = "its `descriptors`: row 1 has the value -3e38, and beyond about 4e18 distances of rows of 3 values";
        assert!(wrong.starts_with(named), "{wrong}");
        let wrong = read_rows(&rows(f32::NAN)).unwrap_err();
        assert_eq!(wrong, "its `descriptors` hold NaN");
    }

    #[test]
    fn bits_come_in_bytes_lowest_first() {
        let points = floats("(1, 2)", &[1.0, 1.0]);
        let bytes = npy("|u1", "(1, 10)", &[1, 0, 0, 0, 0, 0, 0, 128, 3, 4]);
        let arrays = [("keypoints", points), ("descriptors", bytes)];
        let Descriptors::Binary(bits) = read(&arrays, 1, true).unwrap().descriptors else {
            panic!("bits")
        };
        assert_eq!((bits.bits(), bits.row(0)), (80, &[1 | 1 << 63, 0x403][..]));
        let Descriptors::Float(values) = read(&arrays, 1, false).unwrap().descriptors else {
            panic!("real values")
        };
        assert_eq!(values.row(0)[7..], [128.0, 3.0, 4.0]);
    }

    #[test]
    fn a_file_that_is_being_written_is_refused_or_gives_what_was_promised() {
        let points = ("keypoints", floats("(2, 2)", &[0.5, 480.0, 10.0, 20.25]));
        let rows = (
            "descriptors",
            floats("(2, 3)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npz");
        write_npz(&path, &[points, rows]);
        let read = || read_features(&path, 2, SIZE, 0.5, false);
        let expected = read().unwrap();
        let whole = fs::read(&path).unwrap();
        // As it is seen at any moment while it grows.
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            let wrong = read().unwrap_err();
            assert!(
                wrong.contains("its file of features: no zip file"),
                "{wrong}"
            );
        }
        // While it is read: complete, with its end again behind it, and with more that is none of it.
        thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for _ in 0..200 {
                    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
                    let mut file = OpenOptions::new().append(true).open(&path).unwrap();
                    file.write_all(&whole[whole.len() / 2..]).unwrap();
                    for _ in 0..4 {
                        file.write_all(&whole).unwrap();
                        file.write_all(&[0; 4096]).unwrap();
                    }
                }
            });
            while !writer.is_finished() {
                match read() {
                    Ok(features) => assert!(features == expected),
                    Err(wrong) => assert!(wrong.contains("file of features"), "{wrong}"),
                }
            }
        });
    }

    #[test]
    fn an_array_has_no_more_bytes_than_so_many_features_can_have() {
        let points = ("keypoints", floats("(1, 2)", &[1.0, 1.0]));
        let rows = ("descriptors", floats("(1, 20000)", &vec![0.0; 20_000]));
        let wrong = read(&[points, rows], 1, false).unwrap_err();
        assert!(
            wrong.contains("[1, 20000] is larger than 65536 bytes"),
            "{wrong}"
        );
    }

    #[test]
    fn lies_are_named() {
        let points = |values: &[f32]| ("keypoints", floats("(1, 2)", values));
        let rows = || ("descriptors", floats("(1, 2)", &[1.0, 2.0]));
        let good = [1.0, 2.0];
        for (arrays, count, hamming, named) in [
            (
                vec![points(&good), rows()],
                2,
                false,
                "shape [1, 2], not [2, 2]",
            ),
            (vec![points(&good)], 1, false, "no `descriptors`"),
            (vec![rows()], 1, false, "no `keypoints`"),
            (vec![points(&good), rows()], 1, true, "uint8"),
            (vec![points(&[1.0, 481.0]), rows()], 1, false, "outside"),
            (vec![points(&[f32::NAN, 1.0]), rows()], 1, false, "NaN"),
            (
                vec![
                    points(&good),
                    ("descriptors", floats("(1, 2)", &[1.0, f32::INFINITY])),
                ],
                1,
                false,
                "inf",
            ),
            (
                vec![points(&good), ("descriptors", floats("(1, 0)", &[]))],
                1,
                false,
                "1 of 0 values",
            ),
            (
                vec![points(&good), rows(), ("scales", floats("(1,)", &[-1.0]))],
                1,
                false,
                "`scales` are diameters, not below 0; row 0 is -1",
            ),
            (
                vec![points(&good), rows(), ("sizes", floats("(0,)", &[]))],
                1,
                false,
                "`sizes`",
            ),
            (
                vec![points(&good), rows(), ("scales", floats("(0,)", &[]))],
                1,
                false,
                "`scales`",
            ),
        ] {
            let wrong = read(&arrays, count, hamming).unwrap_err();
            assert!(wrong.contains(named), "{wrong}");
        }
        let nowhere = read_features(Path::new("/nowhere"), 1, SIZE, 0.0, false);
        assert!(nowhere.unwrap_err().contains("file of features"));
    }
}
