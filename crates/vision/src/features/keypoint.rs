//! A keypoint, and the features of one image.

use nalgebra::Point2;

use super::Descriptors;
use crate::image::Size;

/// A place in an image that a detector expects to find again in another image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Position in pixels of the original image; pixel centres are at integers, y points down.
    pub at: Point2<f32>,
    /// Diameter in pixels of the original image, as its detector measures it (SIFT: two standard deviations of the
    /// blur). Describers look at a multiple of it, each at its own.
    pub size: f32,
    /// Dominant orientation in radians, in `[0, 2 pi)`, from the x axis towards the y axis (so
    /// clockwise on the screen); `None` before one is assigned.
    pub angle: Option<f32>,
    /// Strength of the detector's response; only comparable within one detector.
    pub response: f32,
    /// Pyramid level where it was found; the detector says how levels are numbered.
    pub octave: i16,
}

impl Keypoint {
    /// The keypoint's circle, of diameter [`size`](Self::size), as a linear map (row after row): it takes the unit
    /// circle to this circle and the x axis to its orientation, or leaves it where there is none.
    pub fn frame(&self) -> [f32; 4] {
        let angle = self.angle.unwrap_or(0.0);
        let radius = 0.5 * self.size;
        let (x, y) = (radius * libm::cosf(angle), radius * libm::sinf(angle));
        [x, -y, y, x]
    }

    /// Whether it lies on a pixel of an image of this size and has a neighbourhood to describe: a size from 1e-12
    /// pixels on, and an angle that is a number unless it has none.
    pub(super) fn is_describable_in(&self, image: Size) -> bool {
        /// The square of a much smaller size underflows in `f32`, and weights that are computed from it are NaN.
        const SMALLEST: f32 = 1e-12;
        let within = |v: f32, length: usize| v >= -0.5 && v < length as f32 - 0.5;
        within(self.at.x, image.width)
            && within(self.at.y, image.height)
            && self.size >= SMALLEST
            && self.size.is_finite()
            && self.angle.is_none_or(f32::is_finite)
    }

    /// By how much `other`, the same point seen in another image, is turned against this keypoint, in radians
    /// from 0 to 2 pi; `None` where one of them has no orientation.
    pub fn turn_to(&self, other: &Self) -> Option<f32> {
        use std::f32::consts::TAU;
        let turn = other.angle? - self.angle?;
        Some(if !(-TAU..TAU).contains(&turn) {
            turn.rem_euclid(TAU) // of angles from outside, which may be negative
        } else if turn < 0.0 {
            turn + TAU
        } else {
            turn
        })
    }

    /// How many times as large `other`, the same point seen in another image, is as this keypoint: the natural
    /// logarithm.
    pub fn growth_to(&self, other: &Self) -> f32 {
        libm::logf(other.size / self.size)
    }
}

/// Angle of a direction as keypoints have it: in radians in `[0, 2 pi)`, from the x axis towards the y axis.
pub(super) fn angle_of(x: f32, y: f32) -> f32 {
    const FULL: f32 = std::f32::consts::TAU;
    let angle = libm::atan2f(y, x);
    if angle < 0.0 {
        (angle + FULL).min(FULL.next_down())
    } else {
        angle
    }
}

/// Whether one image is stretched against another by more than what rounding its sides to pixels does.
fn has_other_aspect(from: Size, size: Size) -> bool {
    /// Pixels that both sides may be off together: they are rounded, or cut, once or by halves.
    const ROUNDING: usize = 2;
    let (across, down) = (from.width * size.height, from.height * size.width);
    across.abs_diff(down) > ROUNDING * size.width.max(size.height)
}

/// The keypoints of one image and their descriptors: row `i` describes keypoint `i`.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Size of the image they come from.
    pub size: Size,
    /// Positions, sizes and orientations.
    pub keypoints: Vec<Keypoint>,
    /// Their descriptors, in the same order.
    pub descriptors: Descriptors,
    /// For each keypoint the linear map (row after row) that takes the unit circle to its ellipse;
    /// `None` where all are circles, see [`Features::frame`].
    pub frames: Option<Vec<[f32; 4]>>,
}

impl Features {
    /// Features of an image of `size`.
    ///
    /// # Panics
    /// If there are not as many descriptors as keypoints.
    pub fn new(size: Size, keypoints: Vec<Keypoint>, descriptors: Descriptors) -> Self {
        assert_eq!(
            keypoints.len(),
            descriptors.len(),
            "one descriptor for each keypoint"
        );
        Self {
            size,
            keypoints,
            descriptors,
            frames: None,
        }
    }

    /// About how much memory they take, in bytes, together with what searches among them keep, at most.
    pub fn memory(&self) -> usize {
        let descriptors = match &self.descriptors {
            Descriptors::Float(rows) => rows.memory(),
            Descriptors::Binary(rows) => size_of_val(rows.data()),
        };
        let frames = self
            .frames
            .as_ref()
            .map_or(0, |frames| size_of_val(&frames[..]));
        size_of_val(&self.keypoints[..]) + descriptors + frames
    }

    /// The same features, of which ellipses were described and not circles.
    ///
    /// # Panics
    /// If there are not as many frames as keypoints.
    #[must_use]
    pub fn with_frames(self, frames: Vec<[f32; 4]>) -> Self {
        assert_eq!(self.len(), frames.len(), "one frame for each keypoint");
        Self {
            frames: Some(frames),
            ..self
        }
    }

    /// These features, then `others` of the same image, each with its frame.
    ///
    /// # Panics
    /// If the two were described by descriptors of different kinds.
    #[must_use]
    pub fn followed_by(mut self, others: &Self) -> Self {
        let frame = |of: &Self, count: usize| (0..count).map(|i| of.frame(i)).collect::<Vec<_>>();
        let mut frames = frame(&self, self.len());
        frames.extend(frame(others, others.len()));
        self.keypoints.extend_from_slice(&others.keypoints);
        for index in 0..others.len() {
            self.descriptors.push_from(&others.descriptors, index);
        }
        self.with_frames(frames)
    }

    /// The first `count` of these features, or all where there are fewer.
    #[must_use]
    pub fn first(&self, count: usize) -> Self {
        let count = count.min(self.len());
        Self {
            size: self.size,
            keypoints: self.keypoints[..count].to_vec(),
            descriptors: self.descriptors.select(0..count),
            frames: (self.frames.as_ref()).map(|frames| frames[..count].to_vec()),
        }
    }

    /// The same features, found in an image `from` that an image of `size` was resampled to, in pixels
    /// of the latter. Where that changed the aspect by more than the rounding of sides, circles become ellipses, which are
    /// their frames, and orientations turn: those of a direction that is neither across nor down.
    #[must_use]
    pub fn in_pixels_of(mut self, from: Size, size: Size) -> Self {
        self.size = size;
        if size == from {
            return self;
        }
        let x = size.width as f32 / from.width as f32;
        let y = size.height as f32 / from.height as f32;
        let is_stretched = has_other_aspect(from, size);
        if is_stretched && self.frames.is_none() {
            self.frames = Some(self.keypoints.iter().map(Keypoint::frame).collect());
        }
        for keypoint in &mut self.keypoints {
            let at = keypoint.at;
            keypoint.at = Point2::new((at.x + 0.5) * x - 0.5, (at.y + 0.5) * y - 0.5);
            keypoint.size *= (x * y).sqrt();
            if is_stretched {
                let turned = |angle| angle_of(x * libm::cosf(angle), y * libm::sinf(angle));
                keypoint.angle = keypoint.angle.map(turned);
            }
        }
        for [xx, xy, yx, yy] in self.frames.iter_mut().flatten() {
            (*xx, *xy, *yx, *yy) = (*xx * x, *xy * x, *yx * y, *yy * y);
        }
        self
    }

    /// The factors, across and down, by which resampling stretched circles of the image, up to a common one. They are read
    /// from the frame of the first feature, which is one of the image itself and not of a simulated view. `[1, 1]` if there
    /// are no features, or if the axes of that frame are not those of the image, since resampling cannot turn them.
    pub(crate) fn stretch(&self) -> [f32; 2] {
        /// Cosine of the angle between the rows of a frame that counts as one along the axes.
        const ALONG_AXES: f32 = 1e-3;
        if self.is_empty() {
            return [1.0; 2];
        }
        let [xx, xy, yx, yy] = self.frame(0);
        let (across, down) = (libm::hypotf(xx, xy), libm::hypotf(yx, yy));
        let is_along_axes = (xx * yx + xy * yy).abs() <= ALONG_AXES * across * down;
        if is_along_axes && across > 0.0 && down > 0.0 {
            [across, down]
        } else {
            [1.0; 2]
        }
    }

    /// The local affine frame of keypoint `index`: the linear map, row after row, from the unit
    /// circle to what was described, in pixels of the image.
    ///
    /// # Panics
    /// If there is no such keypoint.
    pub fn frame(&self, index: usize) -> [f32; 4] {
        match &self.frames {
            Some(frames) => frames[index],
            None => self.keypoints[index].frame(),
        }
    }

    /// Number of features.
    pub fn len(&self) -> usize {
        self.keypoints.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.keypoints.is_empty()
    }
}

#[cfg(test)]
impl Features {
    /// Features at one place, for tests that look at descriptors alone.
    pub(crate) fn of_descriptors(descriptors: Descriptors) -> Self {
        let keypoint = Keypoint {
            at: Point2::origin(),
            size: 1.0,
            angle: None,
            response: 1.0,
            octave: 0,
        };
        let keypoints = vec![keypoint; descriptors.len()];
        Self::new(Size::new(1, 1), keypoints, descriptors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::FloatRows;

    /// Features of an image of this size, with these angles.
    fn features(size: Size, angles: &[Option<f32>]) -> Features {
        let keypoint = |&angle: &Option<f32>| Keypoint {
            at: Point2::new(10.0, 20.0),
            size: 8.0,
            angle,
            response: 1.0,
            octave: 0,
        };
        Features {
            size,
            keypoints: angles.iter().map(keypoint).collect(),
            descriptors: Descriptors::Float(FloatRows::from_vec(1, vec![0.0; angles.len()])),
            frames: None,
        }
    }

    /// What points along (1, 1) in an image of 100 x 100 points along (2, 1) in one of 200 x 100, and circles are as wide as
    /// they were high, twice.
    #[test]
    fn stretching_an_image_turns_what_is_in_it() {
        use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
        let (square, wide) = (Size::new(100, 100), Size::new(200, 100));
        let angles = [
            Some(FRAC_PI_4),
            Some(5.0 * FRAC_PI_4),
            Some(FRAC_PI_2),
            None,
        ];
        let seen = features(square, &angles).in_pixels_of(square, wide);
        let half = libm::atan2f(1.0, 2.0);
        let expected = [Some(half), Some(PI + half), Some(FRAC_PI_2), None];
        for (index, (keypoint, expected)) in seen.keypoints.iter().zip(expected).enumerate() {
            assert_eq!(keypoint.angle.is_some(), expected.is_some());
            let (found, expected) = (keypoint.angle.unwrap_or(0.0), expected.unwrap_or(0.0));
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
            let [xx, xy, yx, yy] = seen.frame(index);
            // The frame takes the x axis to the orientation, and the circle of radius 4 to an ellipse of 8 and 4.
            let along = libm::atan2f(yx, xx).rem_euclid(2.0 * PI);
            assert!((along - found).abs() < 1e-6, "{along} {found}");
            assert!((libm::hypotf(xx, xy) - 8.0).abs() < 1e-5);
            assert!((libm::hypotf(yx, yy) - 4.0).abs() < 1e-5);
        }
    }

    #[test]
    fn places_and_sizes_follow_the_factors_across_and_down() {
        let square = Size::new(100, 100);
        for (size, at, diameter) in [
            // 2 and 0.5 times: 10.5 * 2 - 0.5, 20.5 * 0.5 - 0.5, and a circle of the same area.
            (Size::new(200, 50), (20.5, 9.75), 8.0),
            // 4 and 1 times: 10.5 * 4 - 0.5, the same, and twice the square root of the area.
            (Size::new(400, 100), (41.5, 20.0), 16.0),
            // 1 and 4 times: 20.5 * 4 - 0.5.
            (Size::new(100, 400), (10.0, 81.5), 16.0),
        ] {
            let seen = features(square, &[None]).in_pixels_of(square, size);
            assert_eq!(seen.size, size);
            let keypoint = seen.keypoints[0];
            assert_eq!((keypoint.at.x, keypoint.at.y), at);
            assert_eq!(keypoint.size, diameter);
        }
    }

    fn keypoint(angle: Option<f32>, size: f32) -> Keypoint {
        Keypoint {
            size,
            ..features(Size::new(40, 40), &[angle]).keypoints[0]
        }
    }

    #[test]
    fn a_turn_leads_from_one_to_the_other_the_positive_way_round() {
        use std::f32::consts::TAU;
        for (from, to, expected) in [
            (0.5, 2.0, 1.5),
            (2.0, 0.5, TAU - 1.5),
            (6.0, 0.25, TAU - 5.75),
            // Angles from outside may be any.
            (0.0, 20.0, 20.0 - 3.0 * TAU),
            (0.5, -10.0, 2.0 * TAU - 10.5),
        ] {
            let turn = keypoint(Some(from), 4.0).turn_to(&keypoint(Some(to), 4.0));
            let found = turn.expect("both have one");
            assert!((found - expected).abs() < 1e-5, "{from} to {to}: {found}");
        }
        let (with, without) = (keypoint(Some(0.5), 4.0), keypoint(None, 4.0));
        assert_eq!([with.turn_to(&without), without.turn_to(&with)], [None; 2]);
    }

    #[test]
    fn a_growth_is_the_logarithm_of_the_size_there_over_that_here() {
        let growth = |from, to| keypoint(None, from).growth_to(&keypoint(None, to));
        assert!((growth(3.0, 12.0) - 4.0_f32.ln()).abs() < 1e-6);
        assert!((growth(12.0, 3.0) + 4.0_f32.ln()).abs() < 1e-6);
    }

    #[test]
    fn angles_lead_from_x_to_y_and_are_below_a_full_circle() {
        use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};
        for (x, y, expected) in [
            (1.0, 0.0, 0.0),
            (2.0, 2.0, FRAC_PI_4),
            (0.0, 3.0, FRAC_PI_2),
            (-1.0, 1.0, 3.0 * FRAC_PI_4),
            (-1.0, -1.0, PI + FRAC_PI_4),
            (0.0, -1.0, PI + FRAC_PI_2),
        ] {
            assert!((angle_of(x, y) - expected).abs() < 1e-6, "({x}, {y})");
        }
        assert!((6.2..TAU).contains(&angle_of(1.0, -1e-30)));
    }

    #[test]
    fn only_what_lies_on_a_pixel_and_has_a_size_can_be_described() {
        let image = Size::new(40, 30);
        let fine = |x: f32, y: f32, size: f32, angle: Option<f32>| {
            let at = Point2::new(x, y);
            Keypoint {
                at,
                ..keypoint(angle, size)
            }
            .is_describable_in(image)
        };
        for (x, y) in [(-0.5, -0.5), (39.4, 29.4), (35.0, 0.0)] {
            assert!(fine(x, y, 4.0, None) && fine(x, y, 1e-12, Some(-9.0)));
        }
        for (x, y) in [
            (-0.6, 5.0),
            (5.0, -0.6),
            (39.5, 5.0),
            (5.0, 29.5),
            (5.0, 35.0),
        ] {
            assert!(!fine(x, y, 4.0, None), "({x}, {y})");
        }
        assert!(!fine(f32::NAN, 5.0, 4.0, None) && !fine(5.0, f32::NAN, 4.0, None));
        for size in [0.0, -4.0, 1e-13, f32::NAN, f32::INFINITY] {
            assert!(!fine(5.0, 5.0, size, None), "{size}");
        }
        assert!(!fine(5.0, 5.0, 4.0, Some(f32::NAN)) && !fine(5.0, 5.0, 4.0, Some(f32::INFINITY)));
    }

    #[test]
    fn the_stretch_of_an_image_is_read_from_a_frame_along_its_axes() {
        let with = |frame: [f32; 4]| {
            let mut seen = features(Size::new(40, 40), &[None, None]);
            seen.frames = Some(vec![frame, [9.0, 0.0, 0.0, 1.0]]);
            seen.stretch()
        };
        // A circle turned by the angle of 3, 4, 5 and then stretched twice across, or three times down.
        assert_eq!(with([6.0, -8.0, 4.0, 3.0]), [10.0, 5.0]);
        assert_eq!(with([3.0, -4.0, 12.0, 9.0]), [5.0, 15.0]);
        // Stretched along a diagonal, and without an extent: no resampling does that.
        for frame in [
            [2.0, 1.0, 1.0, 2.0],
            [2.0, -1.0, -1.0, 2.0],
            [0.0, 0.0, 0.0, 2.0],
            [2.0, 0.0, 0.0, 0.0],
        ] {
            assert_eq!(with(frame), [1.0; 2], "{frame:?}");
        }
        assert_eq!(features(Size::new(40, 40), &[]).stretch(), [1.0; 2]);
        assert_eq!(features(Size::new(40, 40), &[None]).stretch(), [4.0; 2]);
    }

    #[test]
    fn rounding_the_sides_stretches_nothing() {
        let angles = [Some(0.7), None];
        for (small, size) in [
            ((320, 213), (1001, 667)),
            ((51, 39), (205, 154)),
            ((213, 320), (667, 1001)),
        ] {
            let [small, size] = [small, size].map(|(width, height)| Size::new(width, height));
            let seen = features(small, &angles).in_pixels_of(small, size);
            assert_eq!((seen.keypoints[0].angle, &seen.frames), (Some(0.7), &None));
        }
        // 640x480 of an image of KITTI, of EuRoC, and of ScanNet, which is as good as of that aspect.
        let to = Size::new(640, 480);
        let stretched = [(1226, 370), (752, 480), (1296, 968), (640, 480)]
            .map(|(width, height)| has_other_aspect(to, Size::new(width, height)));
        assert_eq!(stretched, [true, true, false, false]);
    }
}
