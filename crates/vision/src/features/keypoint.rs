//! A keypoint, and the features of one image.

use nalgebra::Point2;

use super::Descriptors;
use crate::image::Size;

/// A place in an image that a detector expects to find again in another image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Position in pixels of the original image; pixel centres are at integers, y points down.
    pub at: Point2<f32>,
    /// Diameter of the described neighbourhood, in pixels of the original image.
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
    /// The circle that was described, as a linear map (row after row): it takes the unit circle to
    /// the keypoint's circle and the x axis to its orientation, or leaves it where there is none.
    pub fn frame(&self) -> [f32; 4] {
        let angle = self.angle.unwrap_or(0.0);
        let radius = 0.5 * self.size;
        let (x, y) = (radius * libm::cosf(angle), radius * libm::sinf(angle));
        [x, -y, y, x]
    }

    /// By how much `other`, the same point seen in another image, is turned against this keypoint, in radians
    /// from 0 to 2 pi; `None` where one of them has no orientation.
    pub fn turn_to(&self, other: &Self) -> Option<f32> {
        let turn = other.angle? - self.angle?;
        Some(if turn < 0.0 {
            turn + std::f32::consts::TAU
        } else {
            turn
        })
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

/// The keypoints of one image and their descriptors: row `i` describes keypoint `i`.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Size of the image they come from.
    pub size: Size,
    /// Positions, sizes and orientations.
    pub keypoints: Vec<Keypoint>,
    /// Their descriptors, in the same order.
    pub descriptors: Descriptors,
    /// For each keypoint the linear map (row after row) that takes the unit circle to the ellipse
    /// that was described; `None` where all are circles, see [`Features::frame`].
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
    /// of the latter.
    #[must_use]
    pub fn in_pixels_of(mut self, from: Size, size: Size) -> Self {
        self.size = size;
        if size == from {
            return self;
        }
        let x = size.width as f32 / from.width as f32;
        let y = size.height as f32 / from.height as f32;
        for keypoint in &mut self.keypoints {
            let at = keypoint.at;
            keypoint.at = Point2::new((at.x + 0.5) * x - 0.5, (at.y + 0.5) * y - 0.5);
            keypoint.size *= (x * y).sqrt();
        }
        for [xx, xy, yx, yy] in self.frames.iter_mut().flatten() {
            (*xx, *xy, *yx, *yy) = (*xx * x, *xy * x, *yx * y, *yy * y);
        }
        self
    }

    /// By how much circles of the image were stretched across and down when it was resampled, but for their size: as the first
    /// feature was, which is of the image itself where others are of simulated views. Not at all where there is none, or where
    /// its ellipse is turned, as resampling turns none.
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
