//! A photograph as it would look if it were a plane seen from elsewhere, by another camera.

use matchbench_vision::image::{FloatImage, GrayImage, gaussian_blur};
use matchbench_vision::seed::Seed;
use nalgebra::{Matrix3, Point2, Vector3};

/// Longest way of a shaken camera during the exposure, in pixels.
const SHAKE: f64 = 8.0;
/// Moments of a shaken exposure.
const TIMES: usize = 8;

/// A homography and the image that it makes.
pub(super) struct Warp {
    pub(super) image: GrayImage,
    b_from_a: Matrix3<f64>,
}

impl Warp {
    /// A view of `image`, turned by up to 30 degrees, 0.6 to 1.6 times as large, slanted, with other
    /// brightness and contrast and some noise; half of the views are out of focus, half shaken, each
    /// by random amounts.
    pub(super) fn new(image: &GrayImage, seed: Seed) -> Self {
        let mut rng = seed.rng();
        let mut within = |low: f64, high: f64| low + (high - low) * rng.uniform();
        let (width, height) = (image.width() as f64, image.height() as f64);
        let angle = within(-0.52, 0.52);
        let scale = libm::exp2(within(-0.7, 0.7));
        let stretch = libm::exp2(within(-0.35, 0.35));
        let skew = within(-0.2, 0.2);
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let shape = Matrix3::new(
            scale * stretch,
            skew,
            0.0,
            0.0,
            scale / stretch,
            0.0,
            within(-0.5, 0.5) / width,
            within(-0.5, 0.5) / height,
            1.0,
        );
        let centre = Vector3::new(0.5 * width, 0.5 * height, 0.0);
        let shift = |by: Vector3<f64>| Matrix3::new_translation(&by.xy());
        let b_from_a = shift(centre) * turn * shape * shift(-centre);
        let a_from_b = b_from_a.try_inverse().expect("no factor is singular");
        let gain = within(0.6, 1.3);
        let gamma = libm::exp2(within(-0.5, 0.5));
        let noise = within(0.0, 4.0);
        // Below 0 stands for none.
        let focus = within(-1.5, 1.5);
        let (shake, direction) = (within(-SHAKE, SHAKE), within(0.0, core::f64::consts::PI));
        let path = if shake > 0.5 { TIMES } else { 1 };
        let step = [libm::cos(direction), libm::sin(direction)].map(|d| d * shake / TIMES as f64);
        let seen = FloatImage::from_fn(image.size(), |x, y| {
            let shades = (0..path).map(|time| {
                let time = time as f64;
                let at = Point2::new(x as f64 + time * step[0], y as f64 + time * step[1]);
                apply(&a_from_b, at).map_or(0.0, |at| interpolate(image, at))
            });
            (shades.sum::<f64>() / path as f64) as f32
        });
        let seen = if focus > 0.3 {
            gaussian_blur(&seen, focus)
        } else {
            seen
        };
        let view = GrayImage::from_fn(image.size(), |x, y| {
            let shade = f64::from(seen.at(x, y)).max(0.0) / 255.0;
            let shade = 255.0 * gain * libm::pow(shade, gamma) + noise * rng.normal();
            shade.round().clamp(0.0, 255.0) as u8
        });
        // Shaken about the middle of the path.
        let middle = 0.5 * (path - 1) as f64;
        let b_from_a = shift(Vector3::new(-middle * step[0], -middle * step[1], 0.0)) * b_from_a;
        Self {
            image: view,
            b_from_a,
        }
    }

    /// Where a point of the photograph lies in the view; `None` outside.
    pub(super) fn transfer(&self, at: Point2<f64>) -> Option<Point2<f64>> {
        let inside = |p: &Point2<f64>| {
            let size = self.image.size();
            let within = |v: f64, length: usize| v >= 0.0 && v <= length as f64 - 1.0;
            within(p.x, size.width) && within(p.y, size.height)
        };
        (Some(at)
            .filter(inside)
            .and_then(|at| apply(&self.b_from_a, at)))
        .filter(inside)
    }
}

fn apply(h: &Matrix3<f64>, p: Point2<f64>) -> Option<Point2<f64>> {
    let q = h * p.to_homogeneous();
    (q.z > 0.1).then(|| Point2::new(q.x / q.z, q.y / q.z))
}

/// Bilinear, with the outermost pixels continued.
fn interpolate(image: &GrayImage, at: Point2<f64>) -> f64 {
    let axis = |v: f64, length: usize| {
        let v = v.clamp(0.0, length as f64 - 1.0);
        let first = (v as usize).min(length.saturating_sub(2));
        (first, (first + 1).min(length - 1), v - first as f64)
    };
    let (left, right, u) = axis(at.x, image.width());
    let (top, bottom, v) = axis(at.y, image.height());
    let pixel = |x: usize, y: usize| f64::from(image.at(x, y));
    let row = |y: usize| pixel(left, y) + u * (pixel(right, y) - pixel(left, y));
    row(top) + v * (row(bottom) - row(top))
}

#[cfg(test)]
mod tests {
    use matchbench_vision::image::Size;

    use super::*;

    #[test]
    fn the_view_shows_each_point_where_it_is_carried() {
        let image = GrayImage::from_fn(Size::new(80, 60), |x, y| (40 + 2 * x + y) as u8);
        for n in 0..5 {
            let warp = Warp::new(&image, Seed(n));
            // Brightness changes, but what is brighter stays brighter.
            let darker = warp.transfer(Point2::new(25.0, 25.0));
            let brighter = warp.transfer(Point2::new(55.0, 35.0));
            let shade =
                |at: Option<Point2<f64>>| interpolate(&warp.image, at.expect("near the centre"));
            assert!(shade(brighter) > shade(darker) + 10.0);
            assert!(warp.transfer(Point2::new(-1.0, 5.0)).is_none());
        }
    }
}
