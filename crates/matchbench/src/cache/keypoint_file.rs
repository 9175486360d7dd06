//! The file format of cached keypoints, which several matchers share.
//!
//! All numbers are little-endian.
//!
//! | bytes | what |
//! | --- | --- |
//! | 8 | `MBKEYP01`: the format and its version |
//! | 32 | the key that the keypoints were saved under |
//! | 8 | how long finding them took, in seconds (`f64`) |
//! | 8 | number n of keypoints |
//! | n x 23 | keypoints, as in a [`feature_file`](super::feature_file) |
//! | 32 | BLAKE3 of all the above |

use matchbench_vision::features::Keypoint;

use super::Key;
use super::reader::{self, CHECKSUM, Reader, push_keypoint};
use crate::matchers::check_seconds;

const MAGIC: [u8; 8] = *b"MBKEYP01";
/// Bytes before the keypoints.
pub(super) const HEAD: usize = 56;

/// The file that holds `keypoints` under `key`.
pub(super) fn to_bytes(keypoints: &[Keypoint], seconds: f64, key: Key) -> Vec<u8> {
    let mut file = MAGIC.to_vec();
    file.extend(key.0);
    file.extend(seconds.to_le_bytes());
    file.extend((keypoints.len() as u64).to_le_bytes());
    for keypoint in keypoints {
        push_keypoint(&mut file, keypoint);
    }
    let checksum = blake3::hash(&file);
    file.extend(checksum.as_bytes());
    file
}

/// How long the file is that begins so, if it is one that was saved under `key`.
pub(super) fn length(head: &[u8; HEAD], key: Key) -> Option<u64> {
    let (_, count) = read_head(&mut Reader(head), key)?;
    reader::length(HEAD, count, 0)
}

/// The keypoints in a file and the seconds that they took, if they were saved under `key` and the file is
/// complete.
pub(super) fn from_bytes(file: &[u8], key: Key) -> Option<(Vec<Keypoint>, f64)> {
    let (content, checksum) = file.split_at_checked(file.len().checked_sub(CHECKSUM)?)?;
    if blake3::hash(content) != *<&[u8; CHECKSUM]>::try_from(checksum).ok()? {
        return None;
    }
    let mut reader = Reader(content);
    let (seconds, count) = read_head(&mut reader, key)?;
    let keypoints = (0..count)
        .map(|_| reader.keypoint())
        .collect::<Option<_>>()?;
    reader.0.is_empty().then_some((keypoints, seconds))
}

/// The seconds, and the number of keypoints.
fn read_head(reader: &mut Reader<'_>, key: Key) -> Option<(f64, usize)> {
    if reader.array()? != MAGIC || reader.array()? != key.0 {
        return None;
    }
    let seconds = f64::from_le_bytes(reader.array()?);
    // A cache can come from somebody else.
    check_seconds(seconds).ok()?;
    Some((seconds, reader.number()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: Key = Key([7; 32]);

    #[test]
    fn keypoints_come_back_and_damaged_files_do_not() {
        let keypoint = |index: u8| Keypoint {
            at: [f32::from(index) + 0.1, -0.0].into(),
            size: 3.5,
            angle: (index == 1).then_some(1.25),
            response: 1e-30,
            octave: -1,
        };
        let seconds = |seconds| from_bytes(&to_bytes(&[], seconds, KEY), KEY);
        assert!(seconds(2.0).is_some() && seconds(-1.0).is_none() && seconds(1e300).is_none());
        for keypoints in [vec![], vec![keypoint(0), keypoint(1)]] {
            let file = to_bytes(&keypoints, 0.25, KEY);
            let head = file.first_chunk().unwrap();
            assert_eq!(length(head, KEY), Some(file.len() as u64));
            assert_eq!(length(head, Key([8; 32])), None);
            assert_eq!(from_bytes(&file, KEY), Some((keypoints, 0.25)));
            assert_eq!(from_bytes(&file, Key([8; 32])), None);
            for length in 0..file.len() {
                assert_eq!(from_bytes(&file[..length], KEY), None);
                let mut damaged = file.clone();
                damaged[length] ^= 0x10;
                assert_eq!(from_bytes(&damaged, KEY), None);
            }
        }
    }
}
