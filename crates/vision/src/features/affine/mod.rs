//! Local affine shape: patches of ellipses, and the ellipse that makes the surroundings of a keypoint look alike in
//! every direction.

mod ellipse;
mod patch;
mod shape;

pub(super) use ellipse::Ellipse;
pub(super) use patch::{AffinePatch, BlurredOctaves, MIDDLE, SCALE};
pub(super) use shape::AffineShape;

/// The scale space of SIFT, for tests.
#[cfg(test)]
const SHAPE: crate::image::ScaleSpaceShape = crate::image::ScaleSpaceShape {
    double: true,
    intervals: 3,
    sigma: 1.6,
    input_sigma: 0.5,
    smallest: 11,
};
