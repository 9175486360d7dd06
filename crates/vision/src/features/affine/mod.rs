//! Local affine shape: patches of ellipses, and the ellipse that makes the surroundings of a keypoint look alike in
//! every direction.

mod ellipse;
mod patch;
mod shape;

pub(super) use ellipse::Ellipse;
pub(super) use patch::{AffinePatch, BlurredOctaves, MIDDLE, SCALE};
pub(super) use shape::AffineShape;
