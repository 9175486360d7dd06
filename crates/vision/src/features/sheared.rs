//! Features of sheared and stretched images: the simulation of GAIM.
//!
//! T. Collins, P. Mesejo, A. Bartoli: "An Analysis of Errors in Graph-Based Keypoint Matching and
//! Proposed Solutions", European Conference on Computer Vision, 2014.
//!
//! 1. The image is resampled so that its diagonal has 1000 pixels.
//! 2. An extractor that copes with similarities only needs to be shown the other two parameters of a linear
//!    map: a shear `s` and an anisotropic scale `c`, `A = [1 s; 0 c]`. Shears are spaced evenly over [-2, 2],
//!    and 0; scales are the steps `1.5^k`.
//! 3. The extractor works on every view. Its keypoints are carried back into the image, each with
//!    its local affine frame.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | x | `shears` | 4 | the paper: 6 for the first, 4 for the second image |
//! | - | `max_shear` | 2 | the paper |
//! | - | `scale_steps` | 1 | - (k = -1, 0, 1) |
//! | - | `scale_step` | 1.5 | the paper |
//! | - | `max_tilt` | 6 | - |
//! | - | `diagonal_px` | 1000 | the paper |
//! | - | `limit` | 40,000 | - |
//!
//! *Differs from the paper*: both images are shown in the same views, since the features of an image are
//! computed once, whatever its role in a pair. `A` is replaced by the turn and the compression to which its
//! singular value decomposition reduces it. An extractor that copes with similarities cannot tell the
//! difference, and the image is never enlarged. Views compressed by more than `max_tilt` are left out.

use nalgebra::Matrix2;

use super::simulation::{SimulatedView, extract_views, shrink_to, shrunk, views_memory};
use super::{DescriptorKind, Extractor, Features};
use crate::image::{GrayImage, Size, resize};
use crate::params::ParamError;

/// Parameters of [`Sheared`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct ShearedParams {
    /// Number of shears besides 0; at most 20.
    pub shears: usize,
    /// Largest shear, positive and at most 5.
    pub max_shear: f64,
    /// Steps of anisotropic scale in each direction; at most 5.
    pub scale_steps: usize,
    /// Ratio of neighbouring anisotropic scales, above 1 and at most 4.
    pub scale_step: f64,
    /// Views are left out if one of their axes is compressed by more than this; 1 to 100.
    pub max_tilt: f64,
    /// Diagonal of the image in which features are found, in pixels; 1 to 10,000.
    pub diagonal_px: f64,
    /// Keep the features of strongest response, at most this many.
    pub limit: Option<usize>,
}

impl Default for ShearedParams {
    fn default() -> Self {
        Self {
            shears: 4,
            max_shear: 2.0,
            scale_steps: 1,
            scale_step: 1.5,
            max_tilt: 6.0,
            diagonal_px: 1000.0,
            limit: Some(40_000),
        }
    }
}

/// An extractor shown an image under shears and anisotropic scales.
#[derive(Clone, Debug)]
pub struct Sheared<E> {
    extractor: E,
    params: ShearedParams,
}

impl<E: Extractor> Sheared<E> {
    /// `extractor` on simulated views.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(extractor: E, params: ShearedParams) -> Result<Self, ParamError> {
        let ShearedParams {
            shears,
            max_shear,
            scale_steps,
            scale_step,
            max_tilt,
            diagonal_px,
            limit: _,
        } = params;
        ParamError::unless(shears <= 20, "shears", shears, "at most 20")?;
        ParamError::unless(scale_steps <= 5, "scale_steps", scale_steps, "at most 5")?;
        for (name, value, above, to) in [
            ("max_shear", max_shear, 0.0, 5.0),
            ("scale_step", scale_step, 1.0, 4.0),
        ] {
            let range = format!("above {above} and at most {to}");
            ParamError::unless(value > above && value <= to, name, value, &range)?;
        }
        for (name, value, to) in [
            ("max_tilt", max_tilt, 100.0),
            ("diagonal_px", diagonal_px, 10_000.0),
        ] {
            let range = format!("1 to {to}");
            ParamError::unless((1.0..=to).contains(&value), name, value, &range)?;
        }
        Ok(Self { extractor, params })
    }

    /// Every pair of a shear and an anisotropic scale, the image itself first.
    fn views(&self) -> Vec<SimulatedView> {
        let ShearedParams {
            shears, max_shear, ..
        } = self.params;
        let even = |i: usize| match shears {
            1 => max_shear,
            _ => max_shear * (2.0 * i as f64 / (shears - 1) as f64 - 1.0),
        };
        let mut views = vec![SimulatedView::IMAGE];
        for shear in std::iter::once(0.0).chain((0..shears).map(even)) {
            let steps = self.params.scale_steps;
            for step in 0..=2 * steps {
                let view = as_turn_and_tilt(shear, self.scale(step, steps));
                let is_tilted = view.tilt > 1.0 + 1e-9 && view.tilt <= self.params.max_tilt;
                // An odd number of shears has 0 in its middle.
                if is_tilted && !views.contains(&view) {
                    views.push(view);
                }
            }
        }
        views
    }

    /// The anisotropic scale `step - zero` steps from 1.
    fn scale(&self, step: usize, zero: usize) -> f64 {
        let power = (0..step.abs_diff(zero)).fold(1.0, |scale, _| scale * self.params.scale_step);
        if step < zero { 1.0 / power } else { power }
    }

    /// The image with a diagonal of [`ShearedParams::diagonal_px`], give or take rounding.
    fn resample(&self, image: &GrayImage) -> GrayImage {
        match self.change(image.size()) {
            Change::None => image.clone(),
            Change::ShrunkTo(max_pixels) => shrink_to(image, Some(max_pixels)),
            Change::EnlargedTo(size) => resize(image, size),
        }
    }

    /// How an image of this `size` comes to that diagonal.
    fn change(&self, size: Size) -> Change {
        let (width, height) = (size.width as f64, size.height as f64);
        let share = self.params.diagonal_px / (width * width + height * height).sqrt();
        if size.area() == 0 || share > MAX_ENLARGEMENT {
            return Change::None;
        }
        if share <= 1.0 {
            return Change::ShrunkTo((share * share * width * height) as usize);
        }
        let length = |length: f64| (share * length) as usize;
        Change::EnlargedTo(Size::new(length(width), length(height)))
    }
}

/// What becomes of an image before it is looked at.
enum Change {
    None,
    ShrunkTo(usize),
    EnlargedTo(Size),
}

/// Smaller images are not enlarged at all: there is nothing to be seen in them.
const MAX_ENLARGEMENT: f64 = 10.0;

impl<E: Extractor> Extractor for Sheared<E> {
    fn kind(&self) -> DescriptorKind {
        self.extractor.kind()
    }

    fn extract(&self, image: &GrayImage) -> Features {
        extract_views(
            &self.extractor,
            &self.views(),
            self.params.limit,
            &self.resample(image),
            image.size(),
        )
    }

    fn memory(&self, size: Size) -> usize {
        let shown = match self.change(size) {
            Change::None => size,
            Change::ShrunkTo(max_pixels) => shrunk(size, Some(max_pixels)),
            Change::EnlargedTo(size) => size,
        };
        size.area() + views_memory(&self.extractor, &self.views(), shown)
    }
}

/// `[1 shear; 0 scale]` up to a similarity.
fn as_turn_and_tilt(shear: f64, scale: f64) -> SimulatedView {
    // `A^T A = [p q; q r]` has the squared singular values as eigenvalues; the longitude turns the
    // eigenvector of the smaller one upright.
    let gram = Matrix2::new(1.0, shear, shear, shear * shear + scale * scale);
    let (p, q, r) = (gram.m11, gram.m12, gram.m22);
    let spread = ((p - r) * (p - r) + 4.0 * q * q).sqrt();
    let tilt = ((p + r + spread) / (p + r - spread)).sqrt();
    let along = 0.5 * libm::atan2(2.0 * q, p - r);
    SimulatedView {
        tilt,
        longitude: -along,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, Vector2};

    use super::*;
    use crate::features::{Surf, SurfParams};

    fn sheared(params: ShearedParams) -> Sheared<Surf> {
        let surf = Surf::new(SurfParams::default()).unwrap();
        Sheared::new(surf, params).unwrap()
    }

    /// A blob with a smaller one at its side, which gives it an orientation.
    fn blob(size: Size, centre: Point2<f32>, sigma: f32) -> GrayImage {
        GrayImage::from_fn(size, |x, y| {
            let offset = (Vector2::new(x as f32, y as f32) - centre.coords) / sigma;
            let blob = |offset: Vector2<f32>| libm::expf(-0.5 * offset.norm_squared());
            let side = blob((offset - Vector2::new(2.0, 1.0)) * 2.0);
            (30.0 + 150.0 * blob(offset) + 70.0 * side) as u8
        })
    }

    #[test]
    fn views_are_the_linear_maps_up_to_similarity() {
        for (shear, scale) in [(0.0, 1.5), (2.0, 1.0), (-1.2, 0.6), (0.4, 2.25)] {
            let SimulatedView { tilt, longitude } = as_turn_and_tilt(shear, scale);
            let (sin, cos) = (libm::sin(longitude), libm::cos(longitude));
            let view = Matrix2::new(1.0, 0.0, 0.0, 1.0 / tilt) * Matrix2::new(cos, -sin, sin, cos);
            let map = Matrix2::new(1.0, shear, 0.0, scale);
            // What is left between the two is a similarity.
            let rest = map * view.try_inverse().unwrap();
            let gram = rest.transpose() * rest;
            assert!((gram.m11 - gram.m22).abs() < 1e-9 * gram.m11, "{rest}");
            assert!(gram.m12.abs() < 1e-9 * gram.m11, "{rest}");
            assert!(tilt > 1.0);
        }
    }

    #[test]
    fn views_are_those_of_the_grid_that_can_be_seen() {
        let views = sheared(ShearedParams::default()).views();
        assert_eq!(views[0], SimulatedView::IMAGE);
        assert!(
            views[1..]
                .iter()
                .all(|view| view.tilt > 1.2 && view.tilt <= 6.0)
        );
        // 5 shears and 3 scales, less two that are too oblique.
        assert_eq!(views.len(), 13);
        let none = sheared(ShearedParams {
            shears: 0,
            scale_steps: 0,
            ..ShearedParams::default()
        });
        assert_eq!(none.views(), [SimulatedView::IMAGE]);
        // An odd number of shears has 0 in its middle, which is there already.
        let odd = sheared(ShearedParams {
            shears: 5,
            ..ShearedParams::default()
        });
        let views = odd.views();
        assert!((1..views.len()).all(|i| !views[..i].contains(&views[i])));
    }

    #[test]
    fn places_are_those_of_the_image_at_any_size() {
        for (width, height) in [(300, 240), (1500, 1100)] {
            let unit = width as f32 / 300.0;
            let centre = Point2::new(140.0 * unit, 121.0 * unit);
            let image = blob(Size::new(width, height), centre, 3.0 * unit);
            let features = sheared(ShearedParams::default()).extract(&image);
            assert_eq!(features.size, image.size());
            assert!(features.len() >= 10, "{} found", features.len());
            let near = (features.keypoints.iter()).filter(|k| (k.at - centre).norm() < 2.0 * unit);
            assert!(near.count() >= 5, "{} are near", features.len());
        }
    }

    #[test]
    fn any_image_will_do() {
        for (width, height) in [(0, 0), (0, 5), (1, 1), (1, 400), (300, 2), (40, 40)] {
            let image = GrayImage::filled(Size::new(width, height), 90);
            let features = sheared(ShearedParams::default()).extract(&image);
            assert!(features.is_empty(), "{width} x {height}");
        }
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let default = ShearedParams::default();
        for (name, params) in [
            (
                "shears",
                ShearedParams {
                    shears: 21,
                    ..default
                },
            ),
            (
                "max_tilt",
                ShearedParams {
                    max_tilt: 0.5,
                    ..default
                },
            ),
            (
                "scale_step",
                ShearedParams {
                    scale_step: f64::NAN,
                    ..default
                },
            ),
        ] {
            let surf = Surf::new(SurfParams::default()).unwrap();
            let message = Sheared::new(surf, params).unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
        }
    }
}
