//! The file format of cached features.
//!
//! All numbers are little-endian.
//!
//! | bytes | what |
//! | --- | --- |
//! | 8 | `MBFEAT02`: the format and its version |
//! | 32 | the key that the features were saved under |
//! | 8, 8, 8 | width and height of the image, number n of features |
//! | 1, 8 | layout of the descriptors, values or bits in each |
//! | 1 | whether there are affine frames: 0 or 1 |
//! | n x 23 | keypoints: x, y, size, response, angle (`f32`), whether there is an angle (1 byte), octave (`i16`) |
//! | n x 16 | frames, if there are: four `f32`, row after row |
//! | n x row | descriptors, row after row: `f32` (layout 0), bytes (1) or `u64` words (2) |
//! | 32 | BLAKE3 of all the above |
//!
//! Real values that are all whole numbers from 0 to 255, such as SIFT's, are stored as bytes. The features that
//! are read equal those that were written, bit for bit.

use matchbench_vision::features::{BinaryRows, Descriptors, Features, FloatRows};
use matchbench_vision::image::Size;

use super::Key;
use super::reader::{self, CHECKSUM, Reader, push_keypoint};

const MAGIC: [u8; 8] = *b"MBFEAT02";
/// Bytes of an affine frame.
const FRAME: usize = 16;
/// Bytes before the keypoints.
pub(super) const HEAD: usize = 74;

const FLOATS: u8 = 0;
const BYTES: u8 = 1;
const WORDS: u8 = 2;

/// The file that holds `features` under `key`.
pub(super) fn to_bytes(features: &Features, key: Key) -> Vec<u8> {
    let (layout, width) = match &features.descriptors {
        Descriptors::Float(rows) if rows.data().iter().all(|&x| is_byte(x)) => (BYTES, rows.dim()),
        Descriptors::Float(rows) => (FLOATS, rows.dim()),
        Descriptors::Binary(rows) => (WORDS, rows.bits()),
    };
    let frame = features.frames.as_ref().map_or(0, |_| FRAME);
    let beside = row_bytes(layout, width).and_then(|row| row.checked_add(frame));
    let length = beside.and_then(|beside| reader::length(HEAD, features.len(), beside));
    // At once: a file that doubles as it grows takes up to three times its length.
    let mut file = Vec::with_capacity(length.expect("features are less than memory") as usize);
    file.extend(MAGIC);
    file.extend(key.0);
    for number in [features.size.width, features.size.height, features.len()] {
        file.extend((number as u64).to_le_bytes());
    }
    file.push(layout);
    file.extend((width as u64).to_le_bytes());
    file.push(u8::from(features.frames.is_some()));
    for keypoint in &features.keypoints {
        push_keypoint(&mut file, keypoint);
    }
    for frame in features.frames.iter().flatten() {
        file.extend(frame.iter().flat_map(|x| x.to_le_bytes()));
    }
    match &features.descriptors {
        Descriptors::Float(rows) if layout == BYTES => {
            file.extend(rows.data().iter().map(|&x| x as u8));
        }
        Descriptors::Float(rows) => file.extend(rows.data().iter().flat_map(|x| x.to_le_bytes())),
        Descriptors::Binary(rows) => file.extend(rows.data().iter().flat_map(|x| x.to_le_bytes())),
    }
    let checksum = blake3::hash(&file);
    file.extend(checksum.as_bytes());
    file
}

/// How long the file is that begins so, if it is one that was saved under `key`.
pub(super) fn length(head: &[u8; HEAD], key: Key) -> Option<u64> {
    let head = Head::read(&mut Reader(head), key)?;
    let frame = if head.has_frames { FRAME } else { 0 };
    reader::length(HEAD, head.count, head.row.checked_add(frame)?)
}

/// What stands before the keypoints.
struct Head {
    size: Size,
    /// The number of features.
    count: usize,
    layout: u8,
    /// Values or bits of a descriptor.
    width: usize,
    /// Bytes of a descriptor.
    row: usize,
    has_frames: bool,
}

impl Head {
    fn read(reader: &mut Reader<'_>, key: Key) -> Option<Self> {
        if reader.array()? != MAGIC || reader.array()? != key.0 {
            return None;
        }
        let size = Size::new(reader.number()?, reader.number()?);
        let count = reader.number()?;
        let [layout] = reader.array()?;
        let width = reader.number().filter(|&width| width > 0)?;
        let [has_frames @ 0..=1] = reader.array()? else {
            return None;
        };
        Some(Self {
            size,
            count,
            layout,
            width,
            row: row_bytes(layout, width)?,
            has_frames: has_frames == 1,
        })
    }
}

/// Bytes of a descriptor of so many values or bits.
fn row_bytes(layout: u8, width: usize) -> Option<usize> {
    match layout {
        FLOATS => width.checked_mul(4),
        BYTES => Some(width),
        WORDS => width.div_ceil(64).checked_mul(8),
        _ => None,
    }
}

/// The features in a file, if they were saved under `key`, the file is complete, and all its numbers are finite, as are the
/// distances of its descriptors.
pub(super) fn from_bytes(file: &[u8], key: Key) -> Option<Features> {
    let (content, checksum) = file.split_at_checked(file.len().checked_sub(CHECKSUM)?)?;
    if blake3::hash(content) != *<&[u8; CHECKSUM]>::try_from(checksum).ok()? {
        return None;
    }
    let mut reader = Reader(content);
    let head = Head::read(&mut reader, key)?;
    let (count, width) = (head.count, head.width);
    let keypoints = (0..count)
        .map(|_| reader.keypoint())
        .collect::<Option<Vec<_>>>()?;
    let frames = if head.has_frames {
        let frames = (0..count).map(|_| reader.frame());
        Some(frames.collect::<Option<Vec<_>>>()?)
    } else {
        None
    };
    let Reader(rows) = reader;
    if rows.len() != count.checked_mul(head.row)? {
        return None;
    }
    let descriptors = match head.layout {
        FLOATS => {
            let data: Vec<f32> = (rows.as_chunks().0.iter())
                .map(|x| f32::from_le_bytes(*x))
                .collect();
            let largest = FloatRows::largest_value(width);
            if !data.iter().all(|value| value.abs() <= largest) {
                return None;
            }
            Descriptors::Float(FloatRows::from_vec(width, data))
        }
        BYTES => {
            let data = rows.iter().map(|&x| f32::from(x));
            Descriptors::Float(FloatRows::from_vec(width, data.collect()))
        }
        _ => {
            let data = rows.as_chunks().0.iter().map(|x| u64::from_le_bytes(*x));
            Descriptors::Binary(BinaryRows::from_vec(width, data.collect()))
        }
    };
    let features = Features::new(head.size, keypoints, descriptors);
    Some(match frames {
        Some(frames) => features.with_frames(frames),
        None => features,
    })
}

/// Whether `x` can be stored as a byte without changing a bit; fractions and -0 cannot.
fn is_byte(x: f32) -> bool {
    f32::from(x as u8).to_bits() == x.to_bits()
}

#[cfg(test)]
mod tests {
    use matchbench_vision::features::Keypoint;
    use nalgebra::Point2;

    use super::*;

    const KEY: Key = Key([7; 32]);

    fn keypoints(count: usize) -> Vec<Keypoint> {
        (0..count)
            .map(|i| Keypoint {
                at: Point2::new(i as f32 + 0.1, -0.0),
                size: 3.5,
                angle: (i % 2 == 0).then_some(1.25),
                response: 1e-30,
                octave: -1 - i as i16,
            })
            .collect()
    }

    fn features(descriptors: Descriptors) -> Features {
        Features::new(Size::new(64, 48), keypoints(descriptors.len()), descriptors)
    }

    fn examples() -> [Features; 6] {
        let floats = |data: &[f32]| Descriptors::Float(FloatRows::from_vec(2, data.to_vec()));
        [
            features(floats(&[0.0, 255.0, 17.0, 1.0])),
            features(floats(&[0.5, 255.0, -1.0, 256.0])),
            features(floats(&[1.0, -0.0])),
            features(floats(&[])),
            features(floats(&[2.0, 1.0])).with_frames(vec![[1.5, -0.0, 1e-30, 4.0]]),
            features(Descriptors::Binary(BinaryRows::from_vec(
                486,
                (0..24).map(|word| u64::MAX / (word + 1)).collect(),
            ))),
        ]
    }

    #[test]
    fn features_come_back_bit_for_bit() {
        for features in examples() {
            let file = to_bytes(&features, KEY);
            let head = file.first_chunk().expect("it is longer");
            assert_eq!(length(head, KEY), Some(file.len() as u64));
            assert_eq!(file.capacity(), file.len(), "its memory never grew");
            assert_eq!(length(head, Key([8; 32])), None);
            let back = from_bytes(&file, KEY).expect("the file is whole");
            assert_eq!(back, features);
            // If the bytes are equal, the bits are equal, also those of zeros with a sign.
            assert_eq!(to_bytes(&back, KEY), file);
        }
    }

    #[test]
    fn whole_numbers_take_a_byte_each() {
        let [bytes, floats, ..] = examples();
        let difference = to_bytes(&floats, KEY).len() - to_bytes(&bytes, KEY).len();
        assert_eq!(difference, 3 * 4);
    }

    #[test]
    fn torn_and_damaged_files_are_no_features() {
        for features in examples() {
            let file = to_bytes(&features, KEY);
            for length in 0..file.len() {
                assert_eq!(from_bytes(&file[..length], KEY), None);
            }
            for index in 0..file.len() {
                let mut damaged = file.clone();
                damaged[index] ^= 0x10;
                assert_eq!(from_bytes(&damaged, KEY), None);
            }
            assert_eq!(from_bytes(&file, Key([8; 32])), None);
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_no_features_whatever_the_checksum() {
        for wrong in [f32::NAN, f32::INFINITY] {
            let [_, floats, ..] = examples();
            let [.., framed, _] = examples();
            let mut of_keypoints = floats.clone();
            of_keypoints.keypoints[1].at.x = wrong;
            let mut of_sizes = floats.clone();
            of_sizes.keypoints[0].size = wrong;
            let mut of_angles = floats;
            of_angles.keypoints[0].angle = Some(wrong);
            let data = vec![0.5, 1.0, wrong, 1.0];
            let of_values = features(Descriptors::Float(FloatRows::from_vec(2, data)));
            let of_frames = framed.with_frames(vec![[1.0, 0.0, wrong, 1.0]]);
            for forged in [of_keypoints, of_sizes, of_angles, of_values, of_frames] {
                assert_eq!(from_bytes(&to_bytes(&forged, KEY), KEY), None);
            }
        }
        let data = vec![0.5, 1.0, 3e38, 1.0];
        let far = features(Descriptors::Float(FloatRows::from_vec(2, data)));
        assert_eq!(from_bytes(&to_bytes(&far, KEY), KEY), None);
    }

    #[test]
    fn a_header_that_contradicts_the_rest_is_no_features() {
        let [features, ..] = examples();
        let file = to_bytes(&features, KEY);
        let content = &file[..file.len() - CHECKSUM];
        // The number of features, the layout, the width and whether there are frames.
        for (index, value) in [
            (56, 1),
            (56, 3),
            (63, 255),
            (64, 0),
            (64, 9),
            (65, 0),
            (65, 3),
            (72, 255),
            (73, 1),
            (73, 2),
        ] {
            let mut forged = content.to_vec();
            forged[index] = value;
            forged.extend(*blake3::hash(&forged).as_bytes());
            assert_eq!(
                from_bytes(&forged, KEY),
                None,
                "byte {index} set to {value}"
            );
        }
    }
}
