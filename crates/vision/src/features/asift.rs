//! ASIFT: features found again under simulated changes of viewpoint.
//!
//! J.-M. Morel, G. Yu: "ASIFT: A New Framework for Fully Affine Invariant Image Comparison", SIAM
//! Journal on Imaging Sciences 2(2), 438-469, 2009.
//!
//! 1. A camera that looks at a surface from the side sees it through `A = T_t R_phi`, up to
//!    similarity (section 2, eq. 2.3): a turn by the longitude `phi`, then a compression of one
//!    axis by the tilt `t`.
//! 2. Views of the image are made for a sampling of both (section 4.2): tilts `sqrt(2)^k`, and for
//!    each the longitudes `0, b / t, 2 b / t, ...` below 180 degrees.
//! 3. Before an axis is compressed by `t` it is blurred by a Gaussian of `0.8 sqrt(t^2 - 1)` pixels
//!    (section 4.1), for a camera would have seen it so.
//! 4. Any extractor that copes with similarities (the paper's is SIFT) works on every view. Its
//!    keypoints are carried back into the image, each with its local affine frame.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | n + 1 | `tilts` | 6 | section 4.2: t = 1 ... 4 sqrt(2) |
//! | b | `longitude_step_deg` | 72 | section 4.2 |
//! | - | `max_pixels` | 1,920,000 | - (the authors' program: 480,000) |
//! | - | `limit` | 20,000 | - |
//!
//! *Choices the paper leaves open*: an image above `max_pixels` is shrunk by averaging first, and
//! places found in it are the coarser for it (at 480,000 a third of the matches that CODE selects
//! in images of 3072 x 2048 lie within a pixel of their epipolar lines, 87 % within ten), and a
//! strip of more than 16 x 1 to fewer pixels, since it fills large views when it is turned; `limit`
//! keeps the strongest responses over all views, since the search for neighbours grows with its
//! square. Others are those of the simulation (`simulation.rs`).
//!
//! Keypoints come view after view, in the order of their extractor. Views are worked on by the
//! threads of the surrounding rayon pool and the result does not depend on their number.

use std::f64::consts::{PI, SQRT_2};

use super::simulation::{
    SimulatedView, extract_views, most_pixels, shrink_to, shrunk, views_memory,
};
use super::{DescriptorKind, Extractor, Features};
use crate::image::{GrayImage, Size};
use crate::params::ParamError;

/// Parameters of [`Asift`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AsiftParams {
    /// Number of tilts, that of 1 (the image itself) included; 1 to 9.
    pub tilts: usize,
    /// Step between longitudes at tilt 1, in degrees; 10 to 180. At tilt `t` it is a `t`-th of it.
    pub longitude_step_deg: f64,
    /// Larger images are shrunk to about this many pixels, strips of more than 16 x 1 to fewer; `None`: only such strips are.
    pub max_pixels: Option<usize>,
    /// Keep the features of strongest response, at most this many.
    pub limit: Option<usize>,
}

impl Default for AsiftParams {
    fn default() -> Self {
        Self {
            tilts: 6,
            longitude_step_deg: 72.0,
            max_pixels: Some(1600 * 1200),
            limit: Some(20_000),
        }
    }
}

/// An extractor made to find its features again under strong changes of viewpoint.
#[derive(Clone, Debug)]
pub struct Asift<E> {
    extractor: E,
    params: AsiftParams,
}

impl<E: Extractor> Asift<E> {
    /// `extractor` on simulated views.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(extractor: E, params: AsiftParams) -> Result<Self, ParamError> {
        let AsiftParams {
            tilts,
            longitude_step_deg,
            max_pixels,
            ..
        } = params;
        ParamError::unless((1..=9).contains(&tilts), "tilts", tilts, "1 to 9")?;
        ParamError::unless(
            (10.0..=180.0).contains(&longitude_step_deg),
            "longitude_step_deg",
            longitude_step_deg,
            "10 to 180",
        )?;
        ParamError::unless(
            max_pixels != Some(0),
            "max_pixels",
            max_pixels.unwrap_or_default(),
            "at least 1",
        )?;
        Ok(Self { extractor, params })
    }

    /// What this was made with.
    pub fn params(&self) -> &AsiftParams {
        &self.params
    }

    /// What works on every view.
    pub(super) fn extractor(&self) -> &E {
        &self.extractor
    }

    /// As [`Extractor::extract`], without the image itself.
    pub(super) fn extract_tilted(&self, image: &GrayImage) -> Features {
        self.extract_of(&self.views()[1..], image)
    }

    fn extract_of(&self, views: &[SimulatedView], image: &GrayImage) -> Features {
        let small = shrink_to(image, most_pixels(image.size(), self.params.max_pixels));
        extract_views(
            &self.extractor,
            views,
            self.params.limit,
            &small,
            image.size(),
        )
    }

    /// Every pair of a tilt and a longitude, the image itself first.
    fn views(&self) -> Vec<SimulatedView> {
        let step = self.params.longitude_step_deg.to_radians();
        let mut views = vec![SimulatedView::IMAGE];
        let mut tilt = 1.0;
        for _ in 1..self.params.tilts {
            tilt *= SQRT_2;
            // The last longitude is below 180 degrees, also where rounding would reach it.
            let count = (PI * tilt / step - 1e-9).ceil() as usize;
            views.extend((0..count).map(|k| SimulatedView {
                tilt,
                longitude: k as f64 * step / tilt,
            }));
        }
        views
    }
}

impl<E: Extractor> Extractor for Asift<E> {
    fn kind(&self) -> DescriptorKind {
        self.extractor.kind()
    }

    fn extract(&self, image: &GrayImage) -> Features {
        self.extract_of(&self.views(), image)
    }

    fn memory(&self, size: Size) -> usize {
        let small = shrunk(size, most_pixels(size, self.params.max_pixels));
        size.area() + views_memory(&self.extractor, &self.views(), small)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::features::simulation::{extract_view, simulate};
    use crate::features::{Descriptors, DspSift, DspSiftParams, Orb, OrbParams, Sift, SiftParams};
    use crate::image::Size;
    use crate::seed::Seed;
    use crate::simd::{Prepared, two_nearest_floats};

    fn asift(params: AsiftParams) -> Asift<Sift> {
        let sift = Sift::new(SiftParams {
            double_image: false,
            ..SiftParams::default()
        });
        Asift::new(sift.unwrap(), params).unwrap()
    }

    /// Grey squares of 9 pixels, blurred a little by their own edges.
    fn textured(size: Size) -> GrayImage {
        GrayImage::from_fn(size, |x, y| {
            let mut rng = Seed(4).number((x / 9) as u64).number((y / 9) as u64).rng();
            30 + rng.below(200) as u8
        })
    }

    #[test]
    fn a_thin_strip_takes_the_memory_of_its_turned_views() {
        let full = asift(AsiftParams::default());
        let [strip, square] = [(65_535, 100), (1386, 1386)].map(|(w, h)| {
            let small = shrunk(Size::new(w, h), full.params.max_pixels);
            views_memory(&full.extractor, &full.views(), small)
        });
        // Both are seen as 1.9 million pixels; turned, the strip fills a square of 600 million.
        assert!(
            strip > 4 * 600_000_000 && square < strip / 20,
            "{strip}, {square}"
        );
    }

    #[test]
    fn the_views_of_a_thin_strip_are_not_much_larger_than_those_of_a_square() {
        let memory = |max_pixels, width, height| {
            let asift = asift(AsiftParams {
                max_pixels,
                ..AsiftParams::default()
            });
            asift.memory(Size::new(width, height))
        };
        // Turned by an eighth of the circle, the strip would fill a square of 46,000 x 46,000 pixels. Shrunk, it fills one of
        // 4000 x 4000, beside the 2000 x 2000 of a square image.
        for most in [AsiftParams::default().max_pixels, None] {
            let [strip, square] = [(65_535, 29), (1386, 1386)].map(|(w, h)| memory(most, w, h));
            assert!(strip > square && strip < 4 * square, "{strip}, {square}");
        }
    }

    #[test]
    fn only_strips_are_shrunk_for_their_views() {
        let most = |width, height| most_pixels(Size::new(width, height), Some(1000));
        for (width, height) in [(0, 0), (40, 30), (15, 1), (10, 150)] {
            assert_eq!(most(width, height), Some(1000), "{width} x {height}");
        }
        // Of 320 x 10 the square over the diagonal is 32 times as large.
        assert_eq!(most(320, 10), Some(499));
        assert_eq!(most(10, 320), Some(499));
        let as_it_is = |width, height| most_pixels(Size::new(width, height), None);
        assert_eq!((as_it_is(400, 300), as_it_is(15_000, 1_000)), (None, None));
        assert_eq!(as_it_is(32_000, 1_000), Some(15_984_390));
        assert_eq!(as_it_is(320, 10), Some(959_063));
        let strip = GrayImage::filled(Size::new(3200, 4), 9);
        let asift = asift(AsiftParams {
            max_pixels: Some(1000),
            ..AsiftParams::default()
        });
        let seen = shrunk(strip.size(), most_pixels(strip.size(), Some(1000)));
        assert!(
            seen.width * seen.width < 32 * 1000 && seen.height > 0,
            "{seen}"
        );
        assert!(asift.extract(&strip).is_empty());
    }

    #[test]
    fn frames_of_the_extractor_are_kept() {
        let params = DspSiftParams {
            affine_shape: true,
            ..DspSiftParams::default()
        };
        let dsp_sift = DspSift::new(params).expect("in range");
        let image = textured(Size::new(120, 100));
        let alone = dsp_sift.extract(&image);
        let is_circle = |features: &Features, index: usize| {
            let [xx, xy, yx, yy] = features.frame(index);
            (xx - yy).abs() < 1e-3 * xx.abs() && (xy + yx).abs() < 1e-3 * xx.abs()
        };
        assert!((0..alone.len()).any(|index| !is_circle(&alone, index)));
        let seen = extract_view(&dsp_sift, &image, SimulatedView::IMAGE);
        for index in 0..alone.len() {
            assert_eq!(seen.frame(index), alone.frame(index));
        }
    }

    #[test]
    fn views_are_those_of_the_paper() {
        let views = asift(AsiftParams::default()).views();
        let count = |k: i32| {
            let tilt = libm::sqrt(libm::exp2(f64::from(k)));
            views
                .iter()
                .filter(|view| (view.tilt - tilt).abs() < 1e-9)
                .count()
        };
        // 180 t / 72 longitudes, rounded up.
        assert_eq!([0, 1, 2, 3, 4, 5].map(count), [1, 4, 5, 8, 10, 15]);
        assert_eq!(views.len(), 43);
        assert!(views.iter().all(|view| (0.0..PI).contains(&view.longitude)));
    }

    #[test]
    fn keypoints_of_every_view_come_back_to_the_blob() {
        let centre = Point2::new(83.0, 70.0);
        let image = GrayImage::from_fn(Size::new(170, 140), |x, y| {
            let squared = (x as f32 - centre.x).powi(2) + (y as f32 - centre.y).powi(2);
            (40.0 + 200.0 * libm::expf(-squared / 32.0)) as u8
        });
        let asift = asift(AsiftParams {
            tilts: 4,
            ..AsiftParams::default()
        });
        let mut seen = 0;
        for view in asift.views() {
            let features = extract_view(&asift.extractor, &image, view);
            let strongest = (0..features.len()).max_by(|&i, &j| {
                let response = |k: usize| features.keypoints[k].response;
                response(i).total_cmp(&response(j))
            });
            let Some(strongest) = strongest else { continue };
            let keypoint = features.keypoints[strongest];
            let error = (keypoint.at - centre).norm();
            assert!(error < 0.6, "{view:?}: {error} pixels off");
            // The frame holds the size, and the first of its axes points along the angle.
            let [xx, xy, yx, yy] = features.frame(strongest);
            let area = (xx * yy - xy * yx) / (keypoint.size * keypoint.size / 4.0);
            assert!((area - 1.0).abs() < 1e-3, "{area}");
            let angle = keypoint.angle.unwrap();
            let across = libm::cosf(angle) * yx - libm::sinf(angle) * xx;
            assert!(across.abs() < 1e-3 * keypoint.size, "{across}");
            seen += 1;
        }
        assert!(seen >= 10, "seen in {seen} views only");
    }

    #[test]
    fn the_slightest_tilt_leaves_no_row_dark() {
        let image = GrayImage::filled(Size::new(12, 500), 200);
        for tilt in [1.0 + 1e-12, 1.001, 1.003, 1.01, 1.05, 2.0] {
            let longitude = 0.01;
            let (view, _) = simulate(&image, SimulatedView { tilt, longitude });
            let is_grey = view.data().iter().all(|&pixel| pixel == 200);
            assert!(is_grey, "{tilt}");
        }
    }

    #[test]
    fn a_compressed_image_is_recognised_where_the_extractor_alone_fails() {
        let image = textured(Size::new(200, 160));
        let (view, placement) = simulate(
            &image,
            SimulatedView {
                tilt: 4.0,
                longitude: 0.3,
            },
        );
        let right = |extractor: &dyn Extractor| {
            let (a, b) = (extractor.extract(&view), extractor.extract(&image));
            let (Descriptors::Float(rows_a), Descriptors::Float(rows_b)) =
                (&a.descriptors, &b.descriptors)
            else {
                unreachable!("SIFT has real values")
            };
            let nearest = two_nearest_floats(
                rows_a.data(),
                rows_b.data(),
                rows_a.dim(),
                &Prepared::default(),
                None,
            );
            let error = |a: Point2<f32>, b: Point2<f32>| (placement.point(a) - b).norm();
            (a.keypoints.iter().zip(nearest))
                .filter(|(a, found)| error(a.at, b.keypoints[found.index as usize].at) < 4.0)
                .count()
        };
        let asift = asift(AsiftParams::default());
        let (alone, simulated) = (right(&asift.extractor), right(&asift));
        assert!(
            simulated > 4 * alone.max(2),
            "{alone} alone, {simulated} simulated"
        );
    }

    #[test]
    fn large_images_are_shrunk_and_places_are_those_of_the_large_one() {
        let small = textured(Size::new(150, 120));
        let large = GrayImage::from_fn(Size::new(600, 480), |x, y| small.at(x / 4, y / 4));
        let asift = asift(AsiftParams {
            max_pixels: Some(150 * 120),
            tilts: 2,
            ..AsiftParams::default()
        });
        let (from_small, from_large) = (asift.extract(&small), asift.extract(&large));
        assert_eq!(from_large.size, large.size());
        assert!(!from_small.is_empty() && from_large.len() == from_small.len());
        assert_eq!(from_small.descriptors, from_large.descriptors);
        for (small, large) in from_small.keypoints.iter().zip(&from_large.keypoints) {
            let expected = small.at.map(|v| 4.0 * v + 1.5);
            assert!((large.at - expected).norm() < 1e-3);
            assert!((large.size - 4.0 * small.size).abs() < 1e-3);
        }
    }

    #[test]
    fn the_limit_keeps_the_strongest_in_their_order() {
        let image = textured(Size::new(120, 100));
        let params = AsiftParams {
            tilts: 2,
            ..AsiftParams::default()
        };
        let all = asift(params).extract(&image);
        let few = asift(AsiftParams {
            limit: Some(50),
            ..params
        })
        .extract(&image);
        assert_eq!(few.len(), 50);
        let mut responses: Vec<f32> = all.keypoints.iter().map(|k| k.response).collect();
        responses.sort_by(|a, b| b.total_cmp(a));
        assert!(few.keypoints.iter().all(|k| k.response >= responses[49]));
        let mut rest = all.keypoints.iter();
        assert!(few.keypoints.iter().all(|k| rest.any(|other| other == k)));
        let none = asift(AsiftParams {
            limit: Some(0),
            ..params
        })
        .extract(&image);
        assert!(none.is_empty());
    }

    #[test]
    fn any_image_and_any_extractor_will_do() {
        let orb = Orb::new(OrbParams::default()).unwrap();
        let orb = Asift::new(orb, AsiftParams::default()).unwrap();
        let sift = asift(AsiftParams {
            max_pixels: Some(100),
            ..AsiftParams::default()
        });
        for (width, height) in [(0, 0), (0, 5), (1, 1), (1, 400), (300, 2), (40, 40)] {
            let image = GrayImage::filled(Size::new(width, height), 90);
            assert!(orb.extract(&image).is_empty(), "{width} x {height}");
            assert!(sift.extract(&image).is_empty(), "{width} x {height}");
        }
        assert!(!orb.extract(&textured(Size::new(200, 160))).is_empty());
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let default = AsiftParams::default();
        for (name, params) in [
            (
                "tilts",
                AsiftParams {
                    tilts: 0,
                    ..default
                },
            ),
            (
                "longitude_step_deg",
                AsiftParams {
                    longitude_step_deg: f64::NAN,
                    ..default
                },
            ),
            (
                "max_pixels",
                AsiftParams {
                    max_pixels: Some(0),
                    ..default
                },
            ),
        ] {
            let sift = Sift::new(SiftParams::default()).unwrap();
            let message = Asift::new(sift, params).unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
        }
    }
}
