//! Code that both kinds of cache files share: numbers, keypoints, the checksum at the end.
//!
//! No features have numbers that are not finite, so a file with one is as good as torn, whatever its checksum says.

use matchbench_vision::features::Keypoint;
use nalgebra::Point2;

/// Length of the BLAKE3 hash at the end of a file.
pub(super) const CHECKSUM: usize = 32;
/// Bytes of a keypoint.
const KEYPOINT: usize = 23;

/// The length of a file with a head of so many bytes and so many keypoints, each of which has so many bytes `beside`;
/// `None` if no file is so long.
pub(super) fn length(head: usize, keypoints: usize, beside: usize) -> Option<u64> {
    let body = keypoints.checked_mul(beside.checked_add(KEYPOINT)?)?;
    u64::try_from(body.checked_add(head + CHECKSUM)?).ok()
}

/// Appends the [`KEYPOINT`] bytes of a keypoint: x, y, size, response, angle, whether there is an angle, octave.
pub(super) fn push_keypoint(file: &mut Vec<u8>, keypoint: &Keypoint) {
    let angle = keypoint.angle.unwrap_or_default();
    let Point2 { coords: at } = keypoint.at;
    for number in [at.x, at.y, keypoint.size, keypoint.response, angle] {
        file.extend(number.to_le_bytes());
    }
    file.push(u8::from(keypoint.angle.is_some()));
    file.extend(keypoint.octave.to_le_bytes());
}

/// The part of a file that was not read yet.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    /// The next `N` bytes.
    pub(super) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (array, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*array)
    }

    /// A number of 8 bytes.
    pub(super) fn number(&mut self) -> Option<usize> {
        usize::try_from(u64::from_le_bytes(self.array()?)).ok()
    }

    /// A number that is finite.
    fn float(&mut self) -> Option<f32> {
        (self.array().map(f32::from_le_bytes)).filter(|number| number.is_finite())
    }

    /// An affine frame: four numbers, row after row.
    pub(super) fn frame(&mut self) -> Option<[f32; 4]> {
        Some([self.float()?, self.float()?, self.float()?, self.float()?])
    }

    /// A keypoint, as [`push_keypoint`] writes it.
    pub(super) fn keypoint(&mut self) -> Option<Keypoint> {
        let at = Point2::new(self.float()?, self.float()?);
        let (size, response, angle) = (self.float()?, self.float()?, self.float()?);
        let [has_angle] = self.array()?;
        Some(Keypoint {
            at,
            size,
            angle: (has_angle != 0).then_some(angle),
            response,
            octave: self.array().map(i16::from_le_bytes)?,
        })
    }
}
