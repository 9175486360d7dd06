//! How the estimator of a protocol sees a pair of images: in which pixels, and where its points are.
//!
//! A threshold of `t` pixels becomes `t / f` at depth 1. Our estimators always divide by the mean focal length
//! of both cameras. So if a protocol has another `f`, points and cameras are given in pixels of another size,
//! scaled by the factor `f / mean focal length`. The points at depth 1 do not change.

use matchbench_vision::geometry::{Camera, MatchedPoints};
use nalgebra::{Point2, Vector2};

use super::{Centres, Focal, Pixels};

/// Moves and scales the points and cameras of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelView {
    /// Size of a pixel: pixels of the protocol per pixel of an image.
    scale: f64,
    /// Shifts of the points of `a` and of `b`, in pixels of the images.
    shifts: [Vector2<f64>; 2],
}

impl PixelView {
    /// The view of images that are enlarged by these `factors`, across and down; `None` if nothing changes.
    pub(super) fn new(
        cameras: [&Camera; 2],
        factors: [[f64; 2]; 2],
        pixels: Pixels,
        focal: Focal,
        centres: Centres,
    ) -> Option<Self> {
        let lengths = |side: usize| {
            let [across, down] = match pixels {
                Pixels::Original => [1.0; 2],
                Pixels::Resized => factors[side],
            };
            [cameras[side].fx * across, cameras[side].fy * down]
        };
        let [[fx_a, fy_a], [fx_b, fy_b]] = [lengths(0), lengths(1)];
        let [mean_a, mean_b] = [f64::midpoint(fx_a, fy_a), f64::midpoint(fx_b, fy_b)];
        let wanted = match focal {
            Focal::Mean => f64::midpoint(mean_a, mean_b),
            Focal::FirstXSecondY => f64::midpoint(fx_a, fy_b),
            Focal::Harmonic => 2.0 / (1.0 / mean_a + 1.0 / mean_b),
        };
        let ours = f64::midpoint(cameras[0].mean_focal(), cameras[1].mean_focal());
        let shift = |factor: f64| match centres {
            Centres::Kept => 0.0,
            Centres::Scaled => (1.0 - 1.0 / factor) / 2.0,
        };
        let view = Self {
            scale: wanted / ours,
            shifts: factors.map(|[across, down]| Vector2::new(shift(across), shift(down))),
        };
        let nothing = Self {
            scale: 1.0,
            shifts: [Vector2::zeros(); 2],
        };
        (view != nothing).then_some(view)
    }

    /// The points, in pixels of the protocol.
    pub fn points(&self, points: &MatchedPoints) -> MatchedPoints {
        let seen = |points: &[Point2<f64>], shift: Vector2<f64>| {
            points
                .iter()
                .map(|point| (point + shift) * self.scale)
                .collect()
        };
        MatchedPoints {
            a: seen(&points.a, self.shifts[0]),
            b: seen(&points.b, self.shifts[1]),
            ambiguity: points.ambiguity.clone(),
            turns: points.turns.clone(),
            growths: points.growths.clone(),
        }
    }

    /// A camera, in pixels of the protocol.
    pub fn camera(&self, camera: &Camera) -> Camera {
        let Camera {
            fx,
            fy,
            cx,
            cy,
            distortion,
        } = *camera;
        let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(|length| length * self.scale);
        Camera {
            fx,
            fy,
            cx,
            cy,
            distortion,
        }
    }
}

#[cfg(test)]
mod tests {
    use matchbench_vision::image::Size;

    use super::super::{GLUE_FACTORY, LOFTR, MATCHBENCH, ROMA, SUPERGLUE};
    use super::*;

    const A: Camera = Camera::pinhole(1000.0, 1100.0, 640.0, 480.0);
    const B: Camera = Camera::pinhole(1200.0, 1400.0, 640.0, 480.0);

    #[test]
    fn thresholds_are_in_the_pixels_and_over_the_focal_length_of_the_protocol() {
        let sizes = Some([Size::new(1280, 960), Size::new(1280, 480)]);
        let ours = (1000.0 + 1100.0 + 1200.0 + 1400.0) / 4.0;
        // 640x480: half of a in both directions, half of b across alone.
        for (protocol, wanted) in [
            (&SUPERGLUE, f64::midpoint(500.0, 1400.0)),
            (&LOFTR, f64::midpoint(1000.0, 1400.0)),
            (&ROMA, ours * 1200.0 / 1280.0),
            (
                &GLUE_FACTORY,
                2.0 / (1.0 / 1050.0 + 1.0 / 1300.0) * 1600.0 / 1280.0,
            ),
        ] {
            let view = protocol
                .view([&A, &B], sizes)
                .expect("it changes something");
            assert!(
                (view.scale - wanted / ours).abs() < 1e-12,
                "{}",
                protocol.id
            );
            let camera = view.camera(&A);
            let point = MatchedPoints::new(
                vec![Point2::new(10.0, 20.0)],
                vec![Point2::new(3.0, 4.0)],
                vec![0.5],
            );
            let seen = view.points(&point);
            let moved = point.a[0] + view.shifts[0];
            assert!((camera.normalize(seen.a[0]) - A.normalize(moved)).norm() < 1e-12);
        }
        assert_eq!(MATCHBENCH.view([&A, &B], None), None);
    }

    #[test]
    fn points_of_each_image_move_by_what_its_own_size_loses() {
        let camera = Camera::pinhole(1000.0, 1000.0, 640.0, 480.0);
        let points = MatchedPoints::new(
            vec![Point2::new(10.0, 20.0)],
            vec![Point2::new(3.0, 4.0)],
            vec![0.5],
        );
        for (protocol, sizes, a, b) in [
            // Halves of a, of b across alone: half a pixel off there. Pixels are 750 to the unit, the mean of 500 and 1000.
            (
                &SUPERGLUE,
                [(1280, 960), (1280, 480)],
                (9.5 * 0.75, 19.5 * 0.75),
                (2.5 * 0.75, 4.0 * 0.75),
            ),
            // A half of a, a quarter of b: (1 - 4) / 2. Pixels stay those of the images.
            (&LOFTR, [(1680, 960), (3360, 480)], (9.5, 19.5), (1.5, 2.5)),
        ] {
            let sizes = sizes.map(|(width, height)| Size::new(width, height));
            let (seen, _) = protocol.seen([&camera; 2], sizes, &points);
            let [found_a, found_b] = [&seen.a, &seen.b].map(|seen| (seen[0].x, seen[0].y));
            assert_eq!((found_a, found_b), (a, b), "{}", protocol.id);
        }
    }

    #[test]
    fn points_lose_half_a_pixel_where_only_sizes_are_multiplied() {
        let sizes = Some([Size::new(1280, 960), Size::new(640, 480)]);
        let view = SUPERGLUE.view([&A, &A], sizes).expect("a is resized");
        // The centre of the first pixel of the smaller image is at 0.5 of the larger one, and is taken to be at 0.
        assert_eq!(view.shifts, [Vector2::new(-0.5, -0.5), Vector2::zeros()]);
        let square = Camera::pinhole(500.0, 500.0, 320.0, 240.0);
        let same = Some([Size::new(640, 480); 2]);
        assert_eq!(SUPERGLUE.view([&square, &square], same), None);
    }
}
