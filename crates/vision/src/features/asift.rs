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
//! | - | `max_pixels` | 480,000 | the authors' program works at 800 x 600 |
//! | - | `limit` | 20,000 | - |
//!
//! *Choices the paper leaves open*: an image above `max_pixels` is shrunk by averaging first;
//! the image continues with its outermost pixels; a keypoint of a simulated view is dropped if the
//! image's border is nearer than 3 sqrt(2) times its size (6 sqrt(2) times its scale, as in the
//! authors' program). `limit` keeps the strongest responses over all views, since the search
//! for neighbours grows with its square.
//!
//! Keypoints come view after view, in the order of their extractor. Views are worked on by the
//! threads of the surrounding rayon pool and the result does not depend on their number.

use std::f64::consts::{PI, SQRT_2};

use nalgebra::{Matrix2, Point2, Vector2};
use rayon::prelude::*;

use super::{BinaryRows, DescriptorKind, Descriptors, Extractor, Features, FloatRows, Keypoint};
use crate::image::{FloatImage, GrayImage, Size, shrink_u8};
use crate::params::ParamError;

/// Parameters of [`Asift`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AsiftParams {
    /// Number of tilts, that of 1 (the image itself) included; 1 to 9.
    pub tilts: usize,
    /// Step between longitudes at tilt 1, in degrees; 10 to 180. At tilt `t` it is a `t`-th of it.
    pub longitude_step_deg: f64,
    /// Larger images are shrunk to about this many pixels; `None` never.
    pub max_pixels: Option<usize>,
    /// Keep the features of strongest response, at most this many.
    pub limit: Option<usize>,
}

impl Default for AsiftParams {
    fn default() -> Self {
        Self {
            tilts: 6,
            longitude_step_deg: 72.0,
            max_pixels: Some(800 * 600),
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

    /// Every pair of a tilt and a longitude in radians, the image itself first.
    fn views(&self) -> Vec<(f64, f64)> {
        let step = self.params.longitude_step_deg.to_radians();
        let mut views = vec![(1.0, 0.0)];
        let mut tilt = 1.0;
        for _ in 1..self.params.tilts {
            tilt *= SQRT_2;
            // The last longitude is below 180 degrees, also where rounding would reach it.
            let count = (PI * tilt / step - 1e-9).ceil() as usize;
            views.extend((0..count).map(|k| (tilt, k as f64 * step / tilt)));
        }
        views
    }

    /// The features of one view, in pixels of `image`.
    fn extract_view(&self, image: &GrayImage, tilt: f64, longitude: f64) -> Features {
        if tilt == 1.0 {
            let features = self.extractor.extract(image);
            let frames = features.keypoints.iter().map(Keypoint::frame).collect();
            return features.with_frames(frames);
        }
        let (view, placement) = simulate(image, tilt, longitude);
        let features = self.extractor.extract(&view);
        let mut kept = Vec::new();
        let (mut keypoints, mut frames) = (Vec::new(), Vec::new());
        for (index, keypoint) in features.keypoints.iter().enumerate() {
            if placement.distance_to_border(keypoint.at) < MARGIN * keypoint.size {
                continue;
            }
            let (keypoint, frame) = placement.to_image(keypoint);
            keypoints.push(keypoint);
            frames.push(frame);
            kept.push(index);
        }
        let descriptors = select_rows(&features.descriptors, &kept);
        Features::new(image.size(), keypoints, descriptors).with_frames(frames)
    }
}

impl<E: Extractor> Extractor for Asift<E> {
    fn kind(&self) -> DescriptorKind {
        self.extractor.kind()
    }

    fn extract(&self, image: &GrayImage) -> Features {
        let small = shrink_to(image, self.params.max_pixels);
        let views: Vec<Features> = (self.views().into_par_iter())
            .map(|(tilt, longitude)| self.extract_view(&small, tilt, longitude))
            .collect();
        let features = keep_strongest(&views, self.params.limit, self.kind(), image.size());
        enlarge(features, small.size())
    }
}

/// Least distance of a simulated keypoint from the border of the image, in its sizes.
const MARGIN: f32 = 3.0 * std::f32::consts::SQRT_2;

/// Where the pixels of a view are in the image.
#[derive(Clone, Copy, Debug)]
struct Placement {
    image: Size,
    /// The image's centre, and the view's.
    centres: [Vector2<f32>; 2],
    /// Directions of the view in the image.
    image_from_view: Matrix2<f32>,
}

impl Placement {
    fn point(&self, at: Point2<f32>) -> Point2<f32> {
        let [image, view] = self.centres;
        (self.image_from_view * (at.coords - view) + image).into()
    }

    /// Distance from the nearest side of the image, measured in the view; negative outside.
    fn distance_to_border(&self, at: Point2<f32>) -> f32 {
        let at = self.point(at);
        let [across, down] = [0, 1].map(|axis| self.image_from_view.row(axis).norm());
        let (width, height) = (self.image.width as f32, self.image.height as f32);
        let x = (at.x + 0.5).min(width - 0.5 - at.x) / across;
        let y = (at.y + 0.5).min(height - 0.5 - at.y) / down;
        x.min(y)
    }

    /// A keypoint of the view in the image, and its frame there. Its size becomes that of the
    /// circle of equal area, its angle that of the direction it maps to.
    fn to_image(self, keypoint: &Keypoint) -> (Keypoint, [f32; 4]) {
        let m = self.image_from_view;
        let [xx, xy, yx, yy] = keypoint.frame();
        let frame = m * Matrix2::new(xx, xy, yx, yy);
        let turn = |direction: Vector2<f32>| {
            let angle = libm::atan2f(direction.y, direction.x);
            let full = 2.0 * std::f32::consts::PI;
            if angle < 0.0 {
                (angle + full).min(full.next_down())
            } else {
                angle
            }
        };
        let keypoint = Keypoint {
            at: self.point(keypoint.at),
            size: keypoint.size * m.determinant().abs().sqrt(),
            angle: keypoint.angle.map(|_| turn(frame.column(0).into_owned())),
            ..*keypoint
        };
        (keypoint, [frame.m11, frame.m12, frame.m21, frame.m22])
    }
}

/// The image as seen under a tilt above 1 from a longitude, and where its pixels come from.
fn simulate(image: &GrayImage, tilt: f64, longitude: f64) -> (GrayImage, Placement) {
    let (sin, cos) = (libm::sin(longitude), libm::cos(longitude));
    let (width, height) = (image.width() as f64, image.height() as f64);
    let across = width * cos.abs() + height * sin.abs();
    let down = width * sin.abs() + height * cos.abs();
    let turned = Size::new(across.ceil() as usize, down.ceil() as usize);
    let size = Size::new(turned.width, (down / tilt).ceil() as usize);
    let turned = turn(image, turned, sin as f32, cos as f32);
    let view = compress(&turned, size, tilt);
    let placement = Placement {
        image: image.size(),
        centres: [centre(image.size()), centre(size)],
        image_from_view: Matrix2::new(cos, tilt * sin, -sin, tilt * cos).cast(),
    };
    (view, placement)
}

fn centre(size: Size) -> Vector2<f32> {
    Vector2::new(size.width as f32 - 1.0, size.height as f32 - 1.0) / 2.0
}

/// The image turned about its centre, bilinear between its pixels.
fn turn(image: &GrayImage, size: Size, sin: f32, cos: f32) -> FloatImage {
    let mut turned = FloatImage::filled(size, 0.0);
    if image.size().area() == 0 {
        return turned;
    }
    let (from, to) = (centre(image.size()), centre(size));
    let (last_x, last_y) = (image.width() - 1, image.height() - 1);
    for y in 0..size.height {
        let dy = y as f32 - to.y;
        for (x, pixel) in turned.row_mut(y).iter_mut().enumerate() {
            let dx = x as f32 - to.x;
            let at_x = (cos * dx + sin * dy + from.x).clamp(0.0, last_x as f32);
            let at_y = (cos * dy - sin * dx + from.y).clamp(0.0, last_y as f32);
            let (x0, y0) = (at_x as usize, at_y as usize);
            let (wx, wy) = (at_x - x0 as f32, at_y - y0 as f32);
            let x1 = (x0 + 1).min(last_x);
            let along = |row: &[u8]| {
                let (first, second) = (f32::from(row[x0]), f32::from(row[x1]));
                first + wx * (second - first)
            };
            let (above, below) = (along(image.row(y0)), along(image.row((y0 + 1).min(last_y))));
            *pixel = above + wy * (below - above);
        }
    }
    turned
}

/// The image with its height compressed by `tilt`: each row is a Gaussian mean about its place.
fn compress(image: &FloatImage, size: Size, tilt: f64) -> GrayImage {
    let mut compressed = GrayImage::filled(size, 0);
    if image.size().area() == 0 {
        return compressed;
    }
    let sigma = 0.8 * (tilt * tilt - 1.0).sqrt();
    let offset = (image.height() as f64 - 1.0) / 2.0 - tilt * (size.height as f64 - 1.0) / 2.0;
    let mut sums = vec![0.0_f32; size.width];
    for y in 0..size.height {
        let at = tilt * y as f64 + offset;
        let first = (at - 4.0 * sigma).ceil() as isize;
        let last = (at + 4.0 * sigma).floor() as isize;
        let weight = |row: isize| {
            let distance = (row as f64 - at) / sigma;
            libm::exp(-0.5 * distance * distance)
        };
        let total: f64 = (first..=last).map(weight).sum();
        sums.fill(0.5);
        for row in first..=last {
            let share = (weight(row) / total) as f32;
            let row = row.clamp(0, image.height() as isize - 1) as usize;
            for (sum, &value) in sums.iter_mut().zip(image.row(row)) {
                *sum += share * value;
            }
        }
        for (pixel, &sum) in compressed.row_mut(y).iter_mut().zip(&sums) {
            *pixel = sum as u8;
        }
    }
    compressed
}

/// The image itself, or a smaller one of about `max_pixels`.
fn shrink_to(image: &GrayImage, max_pixels: Option<usize>) -> GrayImage {
    let mut small = image.clone();
    let Some(max_pixels) = max_pixels else {
        return small;
    };
    while small.size().area() > max_pixels {
        let share = (max_pixels as f64 / small.size().area() as f64).sqrt();
        // No more than to the half at a time; very thin images keep one pixel.
        let length =
            |length: usize| ((length as f64 * share.max(0.5)) as usize).max(length.div_ceil(3));
        let size = Size::new(length(small.width()), length(small.height()));
        if size == small.size() {
            break;
        }
        small = shrink_u8(&small, size);
    }
    small
}

/// Features of a shrunken image in pixels of the original one.
fn enlarge(mut features: Features, small: Size) -> Features {
    if features.size == small {
        return features;
    }
    let x = features.size.width as f32 / small.width as f32;
    let y = features.size.height as f32 / small.height as f32;
    for keypoint in &mut features.keypoints {
        let at = keypoint.at;
        keypoint.at = Point2::new((at.x + 0.5) * x - 0.5, (at.y + 0.5) * y - 0.5);
        keypoint.size *= (x * y).sqrt();
    }
    for [xx, xy, yx, yy] in features.frames.iter_mut().flatten() {
        (*xx, *xy, *yx, *yy) = (*xx * x, *xy * x, *yx * y, *yy * y);
    }
    features
}

/// All features, or the `limit` strongest, view after view; earlier ones first among equals.
fn keep_strongest(
    views: &[Features],
    limit: Option<usize>,
    kind: DescriptorKind,
    size: Size,
) -> Features {
    let mut order: Vec<(usize, usize)> = (views.iter().enumerate())
        .flat_map(|(view, features)| (0..features.len()).map(move |index| (view, index)))
        .collect();
    if let Some(limit) = limit.filter(|&limit| limit < order.len()) {
        let response = |&(view, index): &(usize, usize)| views[view].keypoints[index].response;
        order.sort_by(|i, j| response(j).total_cmp(&response(i)));
        order.truncate(limit);
        order.sort_unstable();
    }
    let mut descriptors = Descriptors::empty(kind);
    for &(view, index) in &order {
        push_row(&mut descriptors, &views[view].descriptors, index);
    }
    let keypoints = (order.iter()).map(|&(view, index)| views[view].keypoints[index]);
    let frames = (order.iter()).map(|&(view, index)| views[view].frame(index));
    let frames = frames.collect();
    Features::new(size, keypoints.collect(), descriptors).with_frames(frames)
}

fn select_rows(descriptors: &Descriptors, rows: &[usize]) -> Descriptors {
    let mut selected = Descriptors::empty(descriptors.kind());
    for &row in rows {
        push_row(&mut selected, descriptors, row);
    }
    selected
}

fn push_row(to: &mut Descriptors, from: &Descriptors, row: usize) {
    match (to, from) {
        (Descriptors::Float(to), Descriptors::Float(from)) => to.push(FloatRows::row(from, row)),
        (Descriptors::Binary(to), Descriptors::Binary(from)) => {
            to.push(BinaryRows::row(from, row));
        }
        _ => unreachable!("one extractor makes descriptors of one kind"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{Orb, OrbParams, Sift, SiftParams};
    use crate::seed::Seed;
    use crate::simd::two_nearest_floats;

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
    fn views_are_those_of_the_paper() {
        let views = asift(AsiftParams::default()).views();
        let count = |k: i32| {
            let tilt = libm::sqrt(libm::exp2(f64::from(k)));
            views
                .iter()
                .filter(|view| (view.0 - tilt).abs() < 1e-9)
                .count()
        };
        // 180 t / 72 longitudes, rounded up.
        assert_eq!([0, 1, 2, 3, 4, 5].map(count), [1, 4, 5, 8, 10, 15]);
        assert_eq!(views.len(), 43);
        assert!(views.iter().all(|view| (0.0..PI).contains(&view.1)));
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
        for (tilt, longitude) in asift.views() {
            let features = asift.extract_view(&image, tilt, longitude);
            let strongest = (0..features.len()).max_by(|&i, &j| {
                let response = |k: usize| features.keypoints[k].response;
                response(i).total_cmp(&response(j))
            });
            let Some(strongest) = strongest else { continue };
            let keypoint = features.keypoints[strongest];
            let error = (keypoint.at - centre).norm();
            assert!(
                error < 0.6,
                "tilt {tilt}, longitude {longitude}: {error} pixels off"
            );
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
    fn a_compressed_image_is_recognised_where_the_extractor_alone_fails() {
        let image = textured(Size::new(200, 160));
        let (view, placement) = simulate(&image, 4.0, 0.3);
        let right = |extractor: &dyn Extractor| {
            let (a, b) = (extractor.extract(&view), extractor.extract(&image));
            let (Descriptors::Float(rows_a), Descriptors::Float(rows_b)) =
                (&a.descriptors, &b.descriptors)
            else {
                unreachable!("SIFT has real values")
            };
            let nearest = two_nearest_floats(rows_a.data(), rows_b.data(), rows_a.dim());
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
