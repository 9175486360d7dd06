//! Features found again under simulated changes of viewpoint, for any list of views.
//!
//! Every linear map of the plane is, up to a similarity, a turn by a longitude followed by the compression of
//! one axis by a tilt (its singular value decomposition). Extractors cope with similarities. So one simulation
//! serves both ASIFT, which samples tilts and longitudes, and GAIM, which samples shears and anisotropic
//! scales.
//!
//! J.-M. Morel, G. Yu: "ASIFT: A New Framework for Fully Affine Invariant Image Comparison", SIAM
//! Journal on Imaging Sciences 2(2), 438-469, 2009, sections 2 and 4.1: before an axis is
//! compressed by `t` it is blurred by a Gaussian of `0.8 sqrt(t^2 - 1)` pixels, for a camera would
//! have seen it so.
//!
//! *Choices*: the image continues with its outermost pixels; a keypoint of a simulated view is
//! dropped if the image's border is nearer than 3 sqrt(2) times its size (6 sqrt(2) times its
//! scale, as in the authors' program).

mod seen;

use nalgebra::{Matrix2, Point2, Vector2};
use rayon::prelude::*;

use super::keypoint::angle_of;
use super::strongest;
use super::{Descriptors, Extractor, Features, Keypoint, memory_of};
use crate::image::{GrayImage, Size, shrink_u8};
use crate::simd::Turn;

/// A simulated view: the image turned, then compressed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SimulatedView {
    /// Compression of the vertical axis after the turn, at least 1; the image itself at 1.
    pub(super) tilt: f64,
    /// The turn in radians.
    pub(super) longitude: f64,
}

impl SimulatedView {
    /// The image itself.
    pub(super) const IMAGE: Self = Self {
        tilt: 1.0,
        longitude: 0.0,
    };

    /// The sizes of an image of this `size` turned, corners included, and of its view. Turned by an eighth of the
    /// circle, a square has two times its pixels, and a thin strip many times as many.
    fn sizes(self, size: Size) -> [Size; 2] {
        let (sin, cos) = (libm::sin(self.longitude), libm::cos(self.longitude));
        let (width, height) = (size.width as f64, size.height as f64);
        let across = width * cos.abs() + height * sin.abs();
        let down = width * sin.abs() + height * cos.abs();
        let turned = Size::new(across.ceil() as usize, down.ceil() as usize);
        [
            turned,
            Size::new(turned.width, (down / self.tilt).ceil() as usize),
        ]
    }
}

/// The features of all `views` of `image` in pixels of an image of `size` that `image` is a
/// resampled version of: view after view in the order of `extractor`, or the `limit` of strongest
/// response. Every feature has its local affine frame.
///
/// Views are worked on by the threads of the surrounding rayon pool and the result does not depend
/// on their number.
pub(super) fn extract_views<E: Extractor>(
    extractor: &E,
    views: &[SimulatedView],
    limit: Option<usize>,
    image: &GrayImage,
    size: Size,
) -> Features {
    let views: Vec<Features> = (views.par_iter())
        .map(|&view| extract_view(extractor, image, view))
        .collect();
    let features = keep_strongest(&views, limit, extractor);
    features.in_pixels_of(image.size(), size)
}

/// The memory of [`extract_views`] on an image of this `size`: as many views at a time as there are
/// threads of the surrounding rayon pool, and the features of all.
pub(super) fn views_memory<E: Extractor>(
    extractor: &E,
    views: &[SimulatedView],
    size: Size,
) -> usize {
    let of_view = |view: &SimulatedView| {
        if view.tilt == 1.0 {
            return extractor.memory(size);
        }
        // What a view is made in is gone before features are found.
        let [turned, seen] = view.sizes(size);
        seen.area() + extractor.memory(seen).max(seen::memory(turned, view.tilt))
    };
    let largest = views.iter().map(of_view).max().unwrap_or(0);
    let at_once = rayon::current_num_threads().min(views.len());
    // A view compresses what it sees of the image, and its features are fewer by as much.
    let seen: f64 = views.iter().map(|view| 1.0 / view.tilt).sum();
    let features = FILLED * seen * memory_of(size, 0, extractor.kind()) as f64;
    at_once * largest + features as usize
}

/// The features of all views take this share of what is allowed for vectors that grow to twice their length; measured.
const FILLED: f64 = 0.55;

/// The features of one view, in pixels of `image`.
pub(super) fn extract_view<E: Extractor>(
    extractor: &E,
    image: &GrayImage,
    view: SimulatedView,
) -> Features {
    if view.tilt == 1.0 {
        let features = extractor.extract(image);
        let frames = (0..features.len()).map(|index| features.frame(index));
        let frames = frames.collect();
        return features.with_frames(frames);
    }
    let (view, placement) = simulate(image, view);
    let features = extractor.extract(&view);
    let mut kept = Vec::new();
    let (mut keypoints, mut frames) = (Vec::new(), Vec::new());
    for (index, keypoint) in features.keypoints.iter().enumerate() {
        if placement.distance_to_border(keypoint.at) < MARGIN * keypoint.size {
            continue;
        }
        let (keypoint, frame) = placement.to_image(keypoint, features.frame(index));
        keypoints.push(keypoint);
        frames.push(frame);
        kept.push(index);
    }
    let descriptors = features.descriptors.select(kept);
    Features::new(image.size(), keypoints, descriptors).with_frames(frames)
}

/// Least distance of a simulated keypoint from the border of the image, in its sizes.
const MARGIN: f32 = 3.0 * std::f32::consts::SQRT_2;

/// Where the pixels of a view are in the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    image: Size,
    /// The image's centre, and the view's.
    centres: [Vector2<f32>; 2],
    /// Directions of the view in the image.
    image_from_view: Matrix2<f32>,
}

impl Placement {
    pub(super) fn point(&self, at: Point2<f32>) -> Point2<f32> {
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
    fn to_image(self, keypoint: &Keypoint, frame: [f32; 4]) -> (Keypoint, [f32; 4]) {
        let m = self.image_from_view;
        let [xx, xy, yx, yy] = frame;
        let frame = m * Matrix2::new(xx, xy, yx, yy);
        let keypoint = Keypoint {
            at: self.point(keypoint.at),
            size: keypoint.size * m.determinant().abs().sqrt(),
            angle: keypoint.angle.map(|_| angle_of(frame.m11, frame.m21)),
            ..*keypoint
        };
        (keypoint, [frame.m11, frame.m12, frame.m21, frame.m22])
    }
}

/// The image as seen under a tilt above 1 from a longitude, and where its pixels come from.
pub(super) fn simulate(image: &GrayImage, view: SimulatedView) -> (GrayImage, Placement) {
    let SimulatedView { tilt, longitude } = view;
    let (sin, cos) = (libm::sin(longitude), libm::cos(longitude));
    let [turned, size] = view.sizes(image.size());
    let turn = Turn {
        sin: sin as f32,
        cos: cos as f32,
        from: centre(image.size()).into(),
        to: centre(turned).into(),
    };
    let view = seen::see(image, &turn, [turned, size], tilt);
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

/// A strip is shrunk until the square over its diagonal has at most so many times `max_pixels`. An image of 4 x 3 has two
/// times its pixels in that square, one of 16 x 1 sixteen times.
const STRIP: f64 = 16.0;
/// Instead of `max_pixels`, where no image is to be shrunk for its pixels, if the strip has fewer.
const OF_STRIPS: usize = 1600 * 1200;

/// How many pixels an image of this `size` is shrunk to, if it has more, where most images are shrunk to `max_pixels`, or not
/// at all. Fewer of a thin strip: turned, it fills a far larger view.
pub(super) fn most_pixels(size: Size, max_pixels: Option<usize>) -> Option<usize> {
    let (width, height) = (size.width as f64, size.height as f64);
    let times = (width * width + height * height) / (width * height);
    if times > STRIP {
        let most = max_pixels.unwrap_or(size.area().max(OF_STRIPS));
        Some((most as f64 * STRIP / times) as usize)
    } else {
        max_pixels
    }
}

/// The image itself, or a smaller one of about `max_pixels`.
pub(super) fn shrink_to(image: &GrayImage, max_pixels: Option<usize>) -> GrayImage {
    let mut small = image.clone();
    while let Some(size) = smaller(small.size(), max_pixels) {
        small = shrink_u8(&small, size);
    }
    small
}

/// The size of what [`shrink_to`] makes of an image of this `size`.
pub(super) fn shrunk(mut size: Size, max_pixels: Option<usize>) -> Size {
    while let Some(smaller) = smaller(size, max_pixels) {
        size = smaller;
    }
    size
}

/// The next size on the way to `max_pixels`; `None` at the end.
fn smaller(size: Size, max_pixels: Option<usize>) -> Option<Size> {
    let max_pixels = max_pixels.filter(|&max_pixels| size.area() > max_pixels)?;
    let share = (max_pixels as f64 / size.area() as f64).sqrt();
    // No more than to the half at a time; very thin images keep one pixel.
    let length =
        |length: usize| ((length as f64 * share.max(0.5)) as usize).max(length.div_ceil(3));
    let next = Size::new(length(size.width), length(size.height));
    (next != size).then_some(next)
}

/// All features, or the `limit` strongest, view after view; earlier ones first among equals.
fn keep_strongest<E: Extractor>(
    views: &[Features],
    limit: Option<usize>,
    extractor: &E,
) -> Features {
    let mut order: Vec<(usize, usize)> = (views.iter().enumerate())
        .flat_map(|(view, features)| (0..features.len()).map(move |index| (view, index)))
        .collect();
    if let Some(limit) = limit {
        let response = |(view, index): (usize, usize)| views[view].keypoints[index].response;
        let kept = strongest(order.len(), limit, |place| response(order[place]));
        order = kept.into_iter().map(|place| order[place]).collect();
    }
    let mut descriptors = Descriptors::empty(extractor.kind());
    for &(view, index) in &order {
        descriptors.push_from(&views[view].descriptors, index);
    }
    let keypoints = (order.iter()).map(|&(view, index)| views[view].keypoints[index]);
    let frames = (order.iter()).map(|&(view, index)| views[view].frame(index));
    let frames = frames.collect();
    Features::new(Size::new(0, 0), keypoints.collect(), descriptors).with_frames(frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{DescriptorKind, FloatRows};

    fn views() -> impl Iterator<Item = SimulatedView> {
        let tilts = [1.2, 2.0, 4.0];
        let longitudes = [0.0, 0.4, 1.2, 1.9, 2.8];
        tilts
            .into_iter()
            .flat_map(move |tilt| longitudes.map(|longitude| SimulatedView { tilt, longitude }))
    }

    /// The corners of the image in the view, in turn.
    fn corners(placement: &Placement) -> [Vector2<f32>; 4] {
        let [image, view] = placement.centres;
        let view_from_image = placement
            .image_from_view
            .try_inverse()
            .expect("it is regular");
        let half = Vector2::new(placement.image.width as f32, placement.image.height as f32) / 2.0;
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| {
            let corner = image + half.component_mul(&Vector2::new(x, y));
            view_from_image * (corner - image) + view
        })
    }

    #[test]
    fn a_view_is_as_large_as_what_it_shows_of_the_whole_image() {
        for view in views() {
            let image = GrayImage::filled(Size::new(90, 60), 0);
            let (seen, placement) = simulate(&image, view);
            let corners = corners(&placement);
            for (axis, length) in [seen.width(), seen.height()].into_iter().enumerate() {
                let of = |corner: &Vector2<f32>| corner[axis] + 0.5;
                let least = corners.iter().map(of).fold(f32::INFINITY, f32::min);
                let most = corners.iter().map(of).fold(f32::NEG_INFINITY, f32::max);
                assert!(least > -1e-3 && most < length as f32 + 1e-3, "{view:?}");
                assert!(most - least > length as f32 - 1.001, "{view:?}");
            }
        }
    }

    #[test]
    fn the_border_is_as_far_as_the_nearest_side_in_the_view() {
        for view in views() {
            let image = GrayImage::filled(Size::new(90, 60), 0);
            let (seen, placement) = simulate(&image, view);
            let corners = corners(&placement);
            for y in (0..seen.height()).step_by(3) {
                for x in (0..seen.width()).step_by(3) {
                    let at = Point2::new(x as f32, y as f32);
                    let distances = [0, 1, 2, 3].map(|i| {
                        let side = (corners[(i + 1) % 4] - corners[i]).normalize();
                        side.perp(&(at.coords - corners[i]))
                    });
                    let nearest = distances.into_iter().fold(f32::INFINITY, f32::min);
                    let found = placement.distance_to_border(at);
                    assert!(
                        (found - nearest).abs() < 1e-3,
                        "{view:?} {at}: {found} {nearest}"
                    );
                }
            }
        }
    }

    /// Finds small and large keypoints in every image, on a lattice.
    struct Lattice;

    impl Extractor for Lattice {
        fn kind(&self) -> DescriptorKind {
            DescriptorKind::Float { dim: 1 }
        }

        fn extract(&self, image: &GrayImage) -> Features {
            let Size { width, height } = image.size();
            let places = (0..height)
                .step_by(3)
                .flat_map(|y| (0..width).step_by(3).map(move |x| (x, y)));
            let keypoints: Vec<Keypoint> = places
                .map(|(x, y)| Keypoint {
                    at: Point2::new(x as f32, y as f32),
                    size: if (x + y) % 2 == 0 { 1.3 } else { 4.0 },
                    angle: Some(0.0),
                    response: 1.0,
                    octave: 0,
                })
                .collect();
            let descriptors = FloatRows::from_vec(1, vec![0.0; keypoints.len()]);
            Features::new(image.size(), keypoints, Descriptors::Float(descriptors))
        }
    }

    #[test]
    fn keypoints_that_reach_beyond_the_image_are_dropped() {
        for view in views() {
            let image = GrayImage::filled(Size::new(90, 60), 0);
            let (seen, placement) = simulate(&image, view);
            // 6 sqrt(2) times the scale, of which the size is twice.
            let is_inside = |keypoint: &&Keypoint| {
                let reach = 6.0 * std::f32::consts::SQRT_2 * keypoint.size / 2.0;
                placement.distance_to_border(keypoint.at) >= reach
            };
            let all = Lattice.extract(&seen);
            let expected = all.keypoints.iter().filter(is_inside);
            let expected: Vec<_> = expected
                .map(|keypoint| placement.point(keypoint.at))
                .collect();
            let found = extract_view(&Lattice, &image, view);
            let found: Vec<_> = found.keypoints.iter().map(|keypoint| keypoint.at).collect();
            assert!(!found.is_empty() && found == expected, "{view:?}");
        }
    }

    /// A camera that sees an axis `t` times as short blurs it by 0.8 sqrt(t^2 - 1) pixels before.
    #[test]
    fn an_edge_across_the_tilt_is_blurred_as_a_camera_would() {
        let edge = |y: usize| if y < 60 { 0 } else { 200 };
        let image = GrayImage::from_fn(Size::new(8, 120), |_, y| edge(y));
        for tilt in [2.0_f64, 3.0, 4.0] {
            let view = SimulatedView {
                tilt,
                longitude: 0.0,
            };
            let (seen, placement) = simulate(&image, view);
            let blur = 0.8 * (tilt * tilt - 1.0).sqrt();
            for y in 0..seen.height() {
                let at = placement.point(Point2::new(3.0, y as f32));
                let beyond = (f64::from(at.y) - 59.5) / blur;
                let expected = 100.0 * libm::erfc(-beyond / std::f64::consts::SQRT_2);
                let found = f64::from(seen.at(3, y));
                assert!(
                    (found - expected).abs() < 3.0,
                    "{tilt} {y}: {found} {expected}"
                );
            }
        }
    }

    /// A mean of a ramp is the ramp in its middle, however the view is blurred.
    #[test]
    fn a_pixel_of_a_view_shows_the_place_where_it_is_in_the_image() {
        let ramp = |x: f32, y: f32| 10.0 + x + 1.5 * y;
        let image = GrayImage::from_fn(Size::new(90, 80), |x, y| ramp(x as f32, y as f32) as u8);
        for view in views() {
            let (seen, placement) = simulate(&image, view);
            let mut inside = 0;
            for y in 0..seen.height() {
                for x in 0..seen.width() {
                    let at = placement.point(Point2::new(x as f32, y as f32));
                    let margin = 1.0 + 3.2 * view.tilt as f32;
                    let is_inside = |v: f32, length: f32| v > margin && v < length - 1.0 - margin;
                    if is_inside(at.x, 90.0) && is_inside(at.y, 80.0) {
                        let (found, expected) = (f32::from(seen.at(x, y)), ramp(at.x, at.y));
                        assert!(
                            (found - expected).abs() < 1.1,
                            "{view:?} {at}: {found} {expected}"
                        );
                        inside += 1;
                    }
                }
            }
            assert!(inside > 500, "{view:?}: {inside}");
        }
    }
}
