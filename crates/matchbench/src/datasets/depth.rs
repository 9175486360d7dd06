//! Depth images: for each pixel, the distance in front of the camera of the scene point that it shows.
//!
//! A file holds the z coordinate in the frame of the camera (not the length of the ray), as 16-bit grey values
//! of PNG or PGM, or as numbers of an HDF5 file. The value 0 means that nothing was measured:
//!
//! | data | stored values per metre | means "not measured" | aligned with the colour image |
//! | --- | --- | --- | --- |
//! | TUM RGB-D | 5000 | 0 | yes |
//! | 7-Scenes | 1000 | 0, 65535 | no: the two lenses are some centimetres apart, and the poses ignore that |
//! | ScanNet | 1000 | 0 | nearly; smaller than the colour image |
//! | MegaDepth | 1 (HDF5; unit of the reconstruction) | 0 and below | yes |
//! | rendered scenes | 5000, outdoors 1000 | 0 | yes |
//!
//! A depth image may have another resolution than its colour image, but must show the same part of the scene.
//! So both must have the same aspect ratio, and pixel positions are scaled about the corner of the image.
//!
//! *Choice*: between pixels, depth is interpolated if the four pixels around belong to one surface (see
//! [`SMOOTH`]). Otherwise the depth of the nearest pixel is taken.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use blake3::Hash;
use matchbench_vision::image::Size;
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use super::stored_depth::StoredDepth;
use super::{DatasetError, Turn};
use crate::files::read_file;

/// Neighbouring depths belong to one surface if the largest is at most this multiple of the smallest.
const SMOOTH: f64 = 1.05;
/// Largest relative difference of the aspect ratios of an image and its depth. ScanNet's 1296 x 968 and 640 x
/// 480 differ by 0.4 %.
const SAME_ASPECT: f64 = 0.01;

/// How depth is stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthUnit {
    /// Stored values per unit of length of the poses of the dataset.
    pub per_unit: f64,
    /// A stored value that, like 0, means that nothing was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub invalid: Option<u16>,
}

impl DepthUnit {
    /// Thousandths of a unit of length, as Kinects store them.
    pub const MILLIMETRES: Self = Self {
        per_unit: 1000.0,
        invalid: None,
    };

    /// Units of length, as MegaDepth stores them in HDF5 files.
    pub const UNITS: Self = Self {
        per_unit: 1.0,
        invalid: None,
    };

    /// Says why depth cannot be stored in this way, if it cannot.
    pub(super) fn check(self) -> Result<(), String> {
        // Lengths of stored values must be numbers of single precision, which depth is kept in.
        const SOUND: RangeInclusive<f64> = 1e-30..=1e30;
        let per_unit = self.per_unit;
        if SOUND.contains(&per_unit) {
            return Ok(());
        }
        Err(format!(
            "`per_unit` of depth is {per_unit:e}; it is from 1e-30 to 1e30"
        ))
    }
}

/// The file that holds the depth of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthFile {
    /// The file.
    pub path: PathBuf,
    /// How it is stored.
    pub unit: DepthUnit,
}

/// The depth of an image, turned as the image is.
#[derive(Clone, Debug, PartialEq)]
pub struct Depth {
    stored: StoredDepth,
    unit: DepthUnit,
    /// Pixels of depth in a pixel of the image, along x and y.
    scale: [f64; 2],
    hash: Hash,
}

impl DepthFile {
    /// Reads the depth for an image that has the size `image` before it is turned.
    ///
    /// # Errors
    /// If the file cannot be read, is neither an image of one 16-bit value per pixel nor an HDF5 file with an array
    /// `depth` of height x width numbers, or has another aspect ratio than the image.
    pub fn read(&self, image: Size, turn: Turn) -> Result<Depth, DatasetError> {
        let bytes = read_file(&self.path).map_err(|error| DatasetError::io(&self.path, &error))?;
        let hash = blake3::hash(&bytes);
        let stored = StoredDepth::decode(&self.path, bytes)?;
        let depth = Depth::new(stored, self.unit, image, turn).map_err(|what| {
            let remedy = "give the depth of the same image, or take `depth` of this frame out of dataset.toml";
            DatasetError::new(&self.path, what, remedy)
        })?;
        Ok(Depth { hash, ..depth })
    }
}

/// The stored value of a depth, rounded; 0 if the depth is too large or there is none.
pub(super) fn stored_value(depth: f32, unit: DepthUnit) -> u16 {
    let value = (f64::from(depth) * unit.per_unit).round();
    let fits = value >= 1.0 && value <= f64::from(u16::MAX) && unit.invalid != Some(value as u16);
    if fits { value as u16 } else { 0 }
}

impl Depth {
    /// The depth of an image of the given size; both are turned.
    ///
    /// # Errors
    /// If their aspect ratios differ.
    fn new(stored: StoredDepth, unit: DepthUnit, image: Size, turn: Turn) -> Result<Self, String> {
        let size = stored.size();
        let ratio = |own: usize, of: usize| own as f64 / of.max(1) as f64;
        let scale = [
            ratio(size.width, image.width),
            ratio(size.height, image.height),
        ];
        let skewed = scale[0].max(scale[1]) > (1.0 + SAME_ASPECT) * scale[0].min(scale[1]);
        if skewed || size.area() == 0 {
            return Err(format!("the depth is {size}, the image {image}"));
        }
        let is_on_side = turn.size(image) != image;
        Ok(Self {
            stored: stored.turned(turn),
            unit,
            scale: if is_on_side {
                [scale[1], scale[0]]
            } else {
                scale
            },
            hash: blake3::hash(&[]),
        })
    }

    /// BLAKE3 of the file that it was read from, of no bytes where there was none.
    pub fn hash(&self) -> Hash {
        self.hash
    }

    /// The depth of an image of the same size.
    #[cfg(test)]
    pub(crate) fn of_image(stored: matchbench_vision::image::Image<u16>, unit: DepthUnit) -> Self {
        let size = stored.size();
        Self::new(StoredDepth::Integers(stored), unit, size, Turn::None)
            .expect("it is of the same size")
    }

    /// The depth at a pixel of the image, in the unit of the dataset; `None` if nothing was measured there, and
    /// outside the image.
    pub fn at(&self, pixel: Point2<f64>) -> Option<f64> {
        let place = |at: f64, scale: f64, length: usize| {
            let at = (at + 0.5) * scale - 0.5;
            // Half a pixel beyond the centre of the last one is still on it.
            let most = length as f64 - 1.0;
            (at >= -0.5 && at <= most + 0.5).then_some(at.clamp(0.0, most))
        };
        let size = self.stored.size();
        let x = place(pixel.x, self.scale[0], size.width)?;
        let y = place(pixel.y, self.scale[1], size.height)?;
        let (left, top) = (x as usize, y as usize);
        let right = (left + 1).min(size.width - 1);
        let bottom = (top + 1).min(size.height - 1);
        let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
        let depths = corners.map(|(x, y)| self.value(x, y));
        if let [Some(a), Some(b), Some(c), Some(d)] = depths
            && a.max(b).max(c.max(d)) <= SMOOTH * a.min(b).min(c.min(d))
        {
            let (along, down) = (x - left as f64, y - top as f64);
            let (upper, lower) = (a + along * (b - a), c + along * (d - c));
            return Some(upper + down * (lower - upper));
        }
        self.value((x + 0.5) as usize, (y + 0.5) as usize)
    }

    /// The share of its pixels where depth was measured.
    pub fn coverage(&self) -> f64 {
        let size = self.stored.size();
        let pixels = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y)));
        let measured = pixels.filter(|&(x, y)| self.value(x, y).is_some()).count();
        measured as f64 / size.area() as f64
    }

    /// The size of the image that it belongs to, up to rounding.
    pub(crate) fn image_size(&self) -> [f64; 2] {
        let size = self.stored.size();
        [
            size.width as f64 / self.scale[0],
            size.height as f64 / self.scale[1],
        ]
    }

    /// Bytes of memory that it takes.
    pub(crate) fn bytes(&self) -> usize {
        self.stored.bytes()
    }

    fn value(&self, x: usize, y: usize) -> Option<f64> {
        let stored = self.stored.at(x, y, self.unit.invalid)?;
        Some(stored / self.unit.per_unit)
    }
}

#[cfg(test)]
mod tests {
    use matchbench_vision::image::Image;
    use proptest::prelude::*;

    use super::*;

    const UNIT: DepthUnit = DepthUnit {
        per_unit: 1000.0,
        invalid: Some(65535),
    };

    fn depth(width: usize, values: &[u16], image: Size, turn: Turn) -> Depth {
        let size = Size::new(width, values.len() / width);
        let stored = StoredDepth::Integers(Image::from_vec(size, values.to_vec()));
        Depth::new(stored, UNIT, image, turn).unwrap()
    }

    #[test]
    fn depth_is_interpolated_on_a_surface_and_never_across_its_edge() {
        let values = [1000, 1020, 3000, 1010, 1030, 3000, 0, 65535, 3000];
        let depth = depth(3, &values, Size::new(3, 3), Turn::None);
        let at = |x, y| depth.at(Point2::new(x, y));
        assert!((at(0.5, 0.5).unwrap() - 1.015).abs() < 1e-12);
        assert_eq!((at(1.4, 0.5), at(1.6, 0.5)), (Some(1.03), Some(3.0)));
        assert_eq!((at(0.0, 2.0), at(1.0, 2.0)), (None, None), "not measured");
        assert_eq!(
            (at(-0.6, 0.0), at(2.6, 0.0), at(f64::NAN, 0.0)),
            (None, None, None)
        );
        assert_eq!(at(-0.5, -0.5), Some(1.0));
        assert!((depth.coverage() - 7.0 / 9.0).abs() < 1e-12);
    }

    /// Where one of the four about a place is of another surface, the nearest of them counts.
    #[test]
    fn no_corner_of_another_surface_is_interpolated() {
        for far in 0..4 {
            for other in [1060, 943] {
                let mut values = [1000; 4];
                values[far] = other;
                let found = depth(2, &values, Size::new(2, 2), Turn::None);
                for (nearest, (x, y)) in [(0.45, 0.45), (0.55, 0.45), (0.45, 0.55), (0.55, 0.55)]
                    .into_iter()
                    .enumerate()
                {
                    let expected = f64::from(values[nearest]) / 1000.0;
                    assert_eq!(found.at(Point2::new(x, y)), Some(expected), "{far} {x} {y}");
                }
                // Within a twentieth they are one surface: in the middle there is their mean.
                values[far] = 1040;
                let found = depth(2, &values, Size::new(2, 2), Turn::None);
                let middle = found.at(Point2::new(0.5, 0.5)).unwrap();
                assert!((middle - 1.01).abs() < 1e-12, "{middle}");
            }
        }
    }

    #[test]
    fn coverage_is_that_of_all_pixels_of_an_image_of_any_shape() {
        for width in [1, 2, 4] {
            let size = Size::new(width, 4 / width);
            let found = depth(width, &[7, 0, 65535, 9], size, Turn::None);
            assert_eq!(found.coverage(), 0.5, "{size}");
        }
    }

    #[test]
    fn a_smaller_depth_is_scaled_about_the_corners_of_pixels() {
        let depth = depth(2, &[1000, 1040], Size::new(4, 2), Turn::None);
        // The first pixel of depth covers those at 0 and 1.
        let at = |x: f64| depth.at(Point2::new(x, 0.0)).unwrap();
        assert!((at(0.5) - 1.0).abs() < 1e-12 && (at(2.5) - 1.04).abs() < 1e-12);
        assert!((at(1.5) - 1.02).abs() < 1e-12);
        let other = StoredDepth::Integers(Image::from_vec(Size::new(2, 1), vec![1, 2]));
        let skewed = Depth::new(other, UNIT, Size::new(4, 4), Turn::None).unwrap_err();
        assert!(skewed.contains("2x1") && skewed.contains("4x4"), "{skewed}");
        let high = StoredDepth::Integers(Image::from_vec(Size::new(1, 2), vec![1, 2]));
        assert!(Depth::new(high, UNIT, Size::new(4, 4), Turn::None).is_err());
    }

    #[test]
    fn depth_is_turned_with_its_image() {
        let turned = depth(2, &[1000, 2000], Size::new(4, 2), Turn::Quarter);
        // The right end of the image is up.
        assert_eq!(turned.at(Point2::new(0.0, 0.0)), Some(2.0));
        assert_eq!(turned.at(Point2::new(0.0, 3.0)), Some(1.0));
        assert_eq!(turned.image_size(), [2.0, 4.0]);
    }

    #[test]
    fn what_does_not_fit_is_not_stored() {
        let stored = |depth: f32| stored_value(depth, UNIT);
        assert_eq!([stored(1.2344), stored(65.534)], [1234, 65534]);
        for nothing in [0.0, -1.0, 0.0004, 65.535, 70.0, f32::INFINITY, f32::NAN] {
            assert_eq!(stored(nothing), 0, "{nothing}");
        }
        // Where all values are depths, those from 1 to 65535 are.
        let all = DepthUnit {
            invalid: None,
            ..UNIT
        };
        let ends = [0.0004, 0.001, 65.535, 65.536].map(|depth| stored_value(depth, all));
        assert_eq!(ends, [0, 1, 65535, 0]);
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let unit = DepthUnit {
                per_unit: wrong,
                invalid: None,
            };
            assert!(unit.check().is_err(), "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn no_place_panics(x in -9.0..9.0_f64, y in -9.0..9.0_f64, turn in 0..4_u8) {
            let turn = Turn::try_from(turn).unwrap();
            let depth = depth(3, &[5, 0, 7, 9, 11, 13], Size::new(6, 4), turn);
            let found = depth.at(Point2::new(x, y));
            prop_assert!(found.is_none_or(|z| z > 0.0 && z < 0.02));
        }
    }
}
