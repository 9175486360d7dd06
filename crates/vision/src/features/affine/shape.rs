//! Affine shape adaptation: the ellipse in which the surroundings of a keypoint look alike in all directions.
//!
//! T. Lindeberg, J. Garding: "Shape-adapted smoothing in estimation of 3-D shape cues from affine deformations of local
//! 2-D brightness structure", Image and Vision Computing 15(6), 415-434, 1997; K. Mikolajczyk, C. Schmid: "Scale &
//! Affine Invariant Interest Point Detectors", International Journal of Computer Vision 60(1), 63-86, 2004, section 4.
//!
//! The second-moment matrix `mu` of a neighbourhood is the weighted mean of the products of its gradients (eq.
//! 1). Warp a neighbourhood by the root of its `mu`, and its gradients are equally strong in all directions: it
//! is *round*. If one image is an affine map of another, two corresponding neighbourhoods that were made round
//! agree up to a turn (eq. 6).
//!
//! 1. Start with the circle of the keypoint.
//! 2. Take the patch in which the ellipse becomes a circle, with a blur of the same shape, and measure `mu`
//!    there under a Gaussian window.
//! 3. If the eigenvalues of `mu` agree to 5 %, that is the ellipse.
//! 4. If not, deform the ellipse by the inverse of the root of `mu`, keep its area, and go on from 2.
//!
//! | symbol | constant | value | source |
//! | --- | --- | --- | --- |
//! | - | `WINDOW` | 3 scales | VLFeat's |
//! | epsilon | `ROUND` | 0.95 | Mikolajczyk and Schmid: 0.05 |
//! | - | `MAX_STEPS` | 16 | VLFeat's 15, and the test of the last |
//! | - | `MAX_ASPECT` | 6 | Mikolajczyk and Schmid |
//!
//! *Differs from the papers*: neither the place nor the scale of a keypoint is searched again; VLFeat and
//! COLMAP do not do so either. They keep the shorter axis of the ellipse. Here the area is kept, since the area
//! is what the size of a keypoint says elsewhere.

use nalgebra::{Matrix2, Point2};

use super::{AffinePatch, BlurredOctaves, Ellipse, MIDDLE, SCALE};
use crate::image::RowBuffer;
use crate::simd::{GradientProducts, add_gradient_products};

/// Standard deviation of the window, in scales of the keypoint.
const WINDOW: f32 = 3.0;
/// Pixels of the patch to each side that are looked at: three standard deviations.
const RADIUS: usize = (3.0 * WINDOW * SCALE) as usize;
/// Least ratio of the eigenvalues of what counts as round.
const ROUND: f64 = 0.95;
/// How often an ellipse is measured.
const MAX_STEPS: usize = 16;
/// Longest axis in shorter ones.
const MAX_ASPECT: f32 = 6.0;

/// Finds the ellipses of keypoints.
pub(in crate::features) struct AffineShape {
    /// Weights of the offsets from `-RADIUS` on.
    weights: [f32; 2 * RADIUS + 1],
}

impl Default for AffineShape {
    fn default() -> Self {
        let deviation = WINDOW * SCALE;
        Self {
            weights: std::array::from_fn(|i| {
                let offset = (i as f32 - RADIUS as f32) / deviation;
                libm::expf(-0.5 * offset * offset)
            }),
        }
    }
}

impl AffineShape {
    /// The ellipse about `at` whose area is that of the circle with radius `scale`, both in pixels of the image; `None`
    /// where none is found, as on an edge or where there is nothing.
    pub(in crate::features) fn find(
        &self,
        octaves: &BlurredOctaves,
        at: Point2<f32>,
        scale: f32,
        patch: &mut AffinePatch,
    ) -> Option<Ellipse> {
        let mut ellipse = Ellipse::circle(scale);
        for _ in 0..MAX_STEPS {
            let moments = self.moments(patch.take(octaves, at, &ellipse)?);
            if is_round(&moments) {
                return Some(ellipse);
            }
            ellipse = (ellipse.adapted(moments)).filter(|it| it.aspect() <= MAX_ASPECT)?;
        }
        None
    }

    /// Second moments of the gradients of a patch.
    fn moments(&self, patch: &RowBuffer) -> Matrix2<f64> {
        const FIRST: usize = MIDDLE - RADIUS;
        const LENGTH: usize = 2 * RADIUS + 1;
        let mut sums = GradientProducts::default();
        for (y, &weight) in (FIRST..).zip(&self.weights) {
            let beside = |y: usize| &patch.row(y)[FIRST..][..LENGTH];
            let here = &patch.row(y)[FIRST - 1..][..LENGTH + 2];
            let (above, below) = (beside(y - 1), beside(y + 1));
            add_gradient_products(above, here, below, weight, &self.weights, &mut sums);
        }
        let [xx, xy, yy] = sums.map(|lanes| f64::from(lanes.iter().sum::<f32>()));
        Matrix2::new(xx, xy, xy, yy)
    }
}

/// Whether the eigenvalues are equal, or nearly so; not where both are 0.
fn is_round(moments: &Matrix2<f64>) -> bool {
    let (p, q, r) = (moments.m11, moments.m12, moments.m22);
    let spread = ((p - r) * (p - r) + 4.0 * q * q).sqrt();
    p + r > 0.0 && p + r - spread >= ROUND * (p + r + spread)
}

#[cfg(test)]
mod tests {
    use super::super::SHAPE;
    use super::*;
    use crate::image::{GrayImage, Size};

    const CENTRE: Point2<f32> = Point2::new(90.0, 80.0);

    /// The ellipse found in the middle of an image of grey values by offset.
    fn found(scale: f32, grey: impl Fn(f32, f32) -> f32) -> Option<Ellipse> {
        let image = GrayImage::from_fn(Size::new(181, 161), |x, y| {
            grey(x as f32 - CENTRE.x, y as f32 - CENTRE.y) as u8
        });
        let octaves = BlurredOctaves::new(&image, SHAPE);
        AffineShape::default().find(&octaves, CENTRE, scale, &mut AffinePatch::default())
    }

    #[test]
    fn the_ellipse_of_a_sheared_blob_is_found() {
        for (shear, stretch) in [(0.0, 1.0), (0.6, 1.0), (-1.2, 1.3), (0.5, 2.2)] {
            // Where the round blob comes from: `[1 shear; 0 stretch]` times 4 pixels.
            let ellipse = found(4.0 * f32::sqrt(stretch), |x, y| {
                let v = y / stretch;
                let u = x - shear * v;
                50.0 + 180.0 * libm::expf(-0.5 * (u * u + v * v) / 16.0)
            });
            let ellipse = ellipse.unwrap_or_else(|| panic!("none for {shear}, {stretch}"));
            let covariance = ellipse.map() * ellipse.map().transpose();
            let expected = 16.0
                * Matrix2::new(
                    1.0 + shear * shear,
                    shear * stretch,
                    shear * stretch,
                    stretch * stretch,
                );
            let difference = (covariance - expected).norm() / expected.norm();
            assert!(
                difference < 0.08,
                "{shear}, {stretch}: {covariance}{expected}"
            );
        }
    }

    #[test]
    fn a_turned_blob_has_a_turned_ellipse() {
        let [first, second] = [0.3, 1.1].map(|angle| {
            let (sin, cos) = libm::sincosf(angle);
            found(5.0, move |x, y| {
                let (u, v) = ((cos * x + sin * y) / 3.5, (cos * y - sin * x) / 7.0);
                50.0 + 180.0 * libm::expf(-0.5 * (u * u + v * v))
            })
            .expect("a blob")
        });
        assert!((first.aspect() - 2.0).abs() < 0.1 && (second.aspect() - 2.0).abs() < 0.1);
        for (ellipse, angle) in [(first, 0.3), (second, 1.1)] {
            let (sin, cos) = libm::sincosf(angle);
            let [x, y] = ellipse.direction;
            assert!((x * cos + y * sin).abs() > 0.999, "{ellipse:?}");
        }
    }

    #[test]
    fn flat_and_edge_like_places_have_no_ellipse() {
        assert_eq!(found(4.0, |_, _| 90.0), None);
        assert_eq!(found(4.0, |x, _| if x < 0.0 { 20.0 } else { 220.0 }), None);
        assert_eq!(
            found(4.0, |x, y| (128.0 + 2.0 * (x + y)).clamp(0.0, 255.0)),
            None
        );
    }
}
