//! Quarter turns, for images that a camera stored sideways.
//!
//! Lists of photographs from the web say how each photograph must be turned to be upright. This comes from EXIF
//! data, which the published images have often lost. If a frame has a turn, its pixels are turned when they are
//! decoded, and its camera, pose and pairs are those of the turned image. So no other code has to handle turns.
//! One quarter turn counterclockwise takes the pixel `(x, y)` of an image of width `w` to `(y, w - 1 - x)`, and
//! so the ray `(X, Y, Z)` to `(Y, -X, Z)`.

use matchbench_vision::geometry::{Camera, Distortion, Lens};
use matchbench_vision::image::{Image, Size};
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Quarter turns counterclockwise from the stored pixels to the pixels that are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub enum Turn {
    /// As stored: no turn.
    #[default]
    None,
    /// 90 degrees counterclockwise.
    Quarter,
    /// 180 degrees.
    Half,
    /// 270 degrees counterclockwise.
    ThreeQuarters,
}

impl TryFrom<u8> for Turn {
    type Error = String;

    fn try_from(quarters: u8) -> Result<Self, String> {
        match quarters {
            0 => Ok(Self::None),
            1 => Ok(Self::Quarter),
            2 => Ok(Self::Half),
            3 => Ok(Self::ThreeQuarters),
            more => Err(format!(
                "a turn of {more} quarters; 0 to 3 (counterclockwise) are understood"
            )),
        }
    }
}

impl From<Turn> for u8 {
    fn from(turn: Turn) -> Self {
        turn as Self
    }
}

impl Turn {
    /// Whether pixels stay as they are stored.
    // By reference, since serde requires it.
    #[allow(clippy::trivially_copy_pass_by_ref)]
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// The turn that undoes this one.
    #[must_use]
    pub fn inverse(self) -> Self {
        match self {
            Self::Quarter => Self::ThreeQuarters,
            Self::ThreeQuarters => Self::Quarter,
            same => same,
        }
    }

    /// The size of an image after the turn.
    pub fn size(self, before: Size) -> Size {
        match self {
            Self::None | Self::Half => before,
            Self::Quarter | Self::ThreeQuarters => Size::new(before.height, before.width),
        }
    }

    /// The image, turned.
    #[must_use]
    pub fn pixels<T: Copy>(self, image: Image<T>) -> Image<T> {
        let (right, down) = (
            image.width().saturating_sub(1),
            image.height().saturating_sub(1),
        );
        let turned = |before: fn(usize, usize, usize, usize) -> (usize, usize)| {
            Image::from_fn(self.size(image.size()), |x, y| {
                let (x, y) = before(x, y, right, down);
                image.at(x, y)
            })
        };
        match self {
            Self::None => image,
            Self::Quarter => turned(|x, y, right, _| (right - y, x)),
            Self::Half => turned(|x, y, right, down| (right - x, down - y)),
            Self::ThreeQuarters => turned(|x, y, _, down| (y, down - x)),
        }
    }

    /// The camera of the turned image, from the camera and the size, in pixels, of the image before the turn.
    /// (If the true size is unknown, a value that replaces it may be a fraction.)
    pub(super) fn camera(self, camera: &Camera, width: f64, height: f64) -> Camera {
        let mut turned = *camera;
        let (mut width, mut height) = (width, height);
        for _ in 0..u8::from(self) {
            turned = Camera {
                fx: turned.fy,
                fy: turned.fx,
                cx: turned.cy,
                cy: width - 1.0 - turned.cx,
                distortion: turned.distortion.map(|lens| match lens {
                    Lens::Brown(lens) => Lens::Brown(Distortion {
                        p1: -lens.p2,
                        p2: lens.p1,
                        ..lens
                    }),
                    // The same in all directions.
                    Lens::Fisheye(_) => lens,
                }),
            };
            (width, height) = (height, width);
        }
        turned
    }

    /// The rotation that takes rays of the camera before the turn to those after it.
    pub(super) fn rotation(self) -> UnitQuaternion<f64> {
        let quarter =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -std::f64::consts::FRAC_PI_2);
        (0..u8::from(self)).fold(UnitQuaternion::identity(), |turned, _| quarter * turned)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use matchbench_vision::geometry::Fisheye;
    use matchbench_vision::image::GrayImage;

    use super::*;

    const TURNS: [Turn; 4] = [Turn::None, Turn::Quarter, Turn::Half, Turn::ThreeQuarters];

    fn image() -> GrayImage {
        GrayImage::from_fn(Size::new(4, 3), |x, y| (10 * y + x) as u8)
    }

    #[test]
    fn a_quarter_turn_brings_the_right_column_to_the_top() {
        let turned = Turn::Quarter.pixels(image());
        assert_eq!(turned.size(), Size::new(3, 4));
        assert_eq!(turned.data()[..6], [3, 13, 23, 2, 12, 22]);
        for turn in TURNS {
            assert_eq!(turn.inverse().pixels(turn.pixels(image())), image());
            let quarters = (0..u8::from(turn)).fold(image(), |i, _| Turn::Quarter.pixels(i));
            assert_eq!(turn.pixels(image()), quarters);
        }
    }

    /// A point in space is seen at the turned pixel by the turned camera, lens and all.
    #[test]
    fn camera_and_rotation_turn_with_the_pixels() {
        let brown = Distortion {
            k1: 0.1,
            k2: -0.02,
            p1: 0.003,
            p2: -0.004,
            k3: 0.01,
        };
        let fisheye = Fisheye {
            k1: 0.1,
            k2: -0.02,
            k3: 0.003,
            k4: 0.01,
        };
        let ray = Vector3::new(0.2, -0.1, 1.0);
        let lenses = [Lens::Brown(brown), Lens::Fisheye(fisheye)];
        for (lens, turn) in lenses
            .iter()
            .flat_map(|lens| TURNS.map(|turn| (lens, turn)))
        {
            let camera = Camera {
                distortion: Some(*lens),
                ..Camera::pinhole(5.0, 6.0, 1.25, 0.75)
            };
            let seen = camera.project(Point2::new(ray.x, ray.y));
            let turned = turn.rotation() * ray;
            let found = turn
                .camera(&camera, 4.0, 3.0)
                .project(Point2::new(turned.x, turned.y));
            let expected = match turn {
                Turn::None => seen,
                Turn::Quarter => Point2::new(seen.y, 3.0 - seen.x),
                Turn::Half => Point2::new(3.0 - seen.x, 2.0 - seen.y),
                Turn::ThreeQuarters => Point2::new(2.0 - seen.y, seen.x),
            };
            assert!((found - expected).norm() < 1e-12, "{turn:?}");
        }
    }

    #[test]
    fn more_than_three_quarters_are_refused() {
        for quarters in 0..4 {
            assert_eq!(u8::from(Turn::try_from(quarters).unwrap()), quarters);
        }
        assert!(Turn::try_from(4).unwrap_err().contains("4 quarters"));
    }
}
