//! Patches around keypoints, turned upright and brought to one size.
//!
//! Learned describers see nothing but such a patch. Its side is a multiple of the keypoint's size
//! (6.75 for the keypoints of SIFT in the evaluation of MatchBench, Bian et al.). It is taken from the octave of the
//! image whose pixels are nearest in size to those of the patch, so that an image seen from nearer
//! gives the same patch and nothing is aliased.

use super::Keypoint;
use crate::image::{GrayImage, Size, shrink_u8};
use crate::simd::{Source, sample_line};

/// Patch pixels are wider than this many pixels of the octave they are taken from, where there is
/// a finer one, and at most twice as wide.
const NARROWEST: f32 = 0.75;

/// An image and its octaves, each of half the size of the one before.
#[derive(Clone, Debug)]
pub struct PatchSource {
    octaves: Vec<GrayImage>,
}

impl PatchSource {
    /// Builds the octaves of `image`, down to the last of at least 8 pixels on each side.
    pub fn new(image: &GrayImage) -> Self {
        let mut octaves = vec![image.clone()];
        loop {
            let last = &octaves[octaves.len() - 1];
            let half = Size::new(last.width() / 2, last.height() / 2);
            if half.width.min(half.height) < 8 {
                return Self { octaves };
            }
            octaves.push(shrink_u8(last, half));
        }
    }

    /// Whether the patch of `keypoint` can be taken: the image has at least 2 x 2 pixels, and the
    /// keypoint lies in it and has a size.
    pub fn holds(&self, keypoint: &Keypoint) -> bool {
        let size = self.octaves[0].size();
        size.width.min(size.height) >= 2 && keypoint.is_describable_in(size)
    }

    /// Fills `patch`, square and row after row, from the square about `keypoint` whose side is
    /// `factor` times its size and whose x axis points along its angle (along that of the image
    /// if it has none). Beyond the border the outermost pixels are repeated.
    ///
    /// # Panics
    /// Unless the source [holds](Self::holds) the keypoint and `patch` has `side * side` pixels.
    pub fn rectify(&self, keypoint: &Keypoint, factor: f32, side: usize, patch: &mut [u8]) {
        assert!(self.holds(keypoint), "no patch about {keypoint:?}");
        assert_eq!(patch.len(), side * side, "a square of {side} pixels");
        let width = factor * keypoint.size / side as f32;
        let (mut octave, mut scale) = (0, 1.0_f32);
        while width * scale >= 2.0 * NARROWEST && octave + 1 < self.octaves.len() {
            octave += 1;
            scale *= 0.5;
        }
        let image = &self.octaves[octave];
        let source = Source {
            data: image.data(),
            width: image.width(),
            height: image.height(),
        };
        let angle = keypoint.angle.unwrap_or(0.0);
        let (cos, sin) = (libm::cosf(angle), libm::sinf(angle));
        // Pixels of octaves of odd size are not quite square.
        let whole = self.octaves[0].size();
        let ratio = [
            image.width() as f32 / whole.width as f32,
            image.height() as f32 / whole.height as f32,
        ];
        let right = [width * cos * ratio[0], width * sin * ratio[1]];
        let down = [-width * sin * ratio[0], width * cos * ratio[1]];
        let centre = [
            (keypoint.at.x + 0.5) * ratio[0] - 0.5,
            (keypoint.at.y + 0.5) * ratio[1] - 0.5,
        ];
        let middle = 0.5 * (side as f32 - 1.0);
        for (y, row) in patch.chunks_exact_mut(side).enumerate() {
            let dy = y as f32 - middle;
            let start = [0, 1].map(|i| centre[i] + dy * down[i] - middle * right[i]);
            sample_line(source, start, right, row);
        }
    }
}

#[cfg(test)]
mod tests {
    use core::f32::consts::FRAC_PI_2;

    use nalgebra::Point2;

    use super::*;

    fn keypoint(x: f32, y: f32, size: f32, angle: f32) -> Keypoint {
        Keypoint {
            at: Point2::new(x, y),
            size,
            angle: Some(angle),
            response: 0.0,
            octave: 0,
        }
    }

    #[test]
    fn a_patch_of_the_images_own_scale_is_cut_out() {
        let image = GrayImage::from_fn(Size::new(40, 30), |x, y| (5 * x + y) as u8);
        let source = PatchSource::new(&image);
        let mut patch = [0; 16];
        source.rectify(&keypoint(10.5, 12.5, 2.0, 0.0), 2.0, 4, &mut patch);
        let expected: Vec<u8> = (0..16).map(|i| image.at(9 + i % 4, 11 + i / 4)).collect();
        assert_eq!(patch[..], expected);
    }

    #[test]
    fn a_turned_image_gives_the_same_patch() {
        let image = GrayImage::from_fn(Size::new(64, 64), |x, y| ((x * x + 3 * y * x) % 251) as u8);
        // Turned by 90 degrees clockwise on the screen: (x, y) moves to (63 - y, x).
        let turned = GrayImage::from_fn(Size::new(64, 64), |x, y| image.at(y, 63 - x));
        let (mut upright, mut other) = ([0; 256], [0; 256]);
        PatchSource::new(&image).rectify(&keypoint(30.0, 25.0, 8.0, 0.0), 2.0, 16, &mut upright);
        PatchSource::new(&turned).rectify(
            &keypoint(38.0, 30.0, 8.0, FRAC_PI_2),
            2.0,
            16,
            &mut other,
        );
        for (a, b) in upright.iter().zip(&other) {
            assert!(a.abs_diff(*b) <= 1);
        }
    }

    #[test]
    fn a_large_keypoint_is_seen_without_its_finest_detail() {
        // A chessboard of single pixels is grey from afar.
        let image = GrayImage::from_fn(Size::new(256, 256), |x, y| 255 * ((x + y) % 2) as u8);
        let mut patch = [0; 64];
        PatchSource::new(&image).rectify(&keypoint(128.0, 128.0, 80.0, 0.3), 1.0, 8, &mut patch);
        assert!(patch.iter().all(|&v| (126..=129).contains(&v)), "{patch:?}");
    }

    #[test]
    fn what_has_no_patch_is_not_held() {
        let source = PatchSource::new(&GrayImage::filled(Size::new(20, 10), 9));
        assert!(source.holds(&keypoint(19.4, 0.0, 3.0, 1.0)));
        for (x, y, size, angle) in [
            (19.6, 0.0, 3.0, 1.0),
            (f32::NAN, 0.0, 3.0, 1.0),
            (5.0, 5.0, 0.0, 1.0),
            (5.0, 5.0, f32::INFINITY, 1.0),
            (5.0, 5.0, 3.0, f32::NAN),
        ] {
            assert!(!source.holds(&keypoint(x, y, size, angle)));
        }
        for size in [Size::new(0, 0), Size::new(1, 1), Size::new(1, 50)] {
            let source = PatchSource::new(&GrayImage::filled(size, 0));
            assert!(!source.holds(&keypoint(0.0, 0.0, 3.0, 1.0)));
        }
    }
}
