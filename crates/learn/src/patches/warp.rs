//! Warps a photograph as if it were a plane that another camera sees from another place.

use matchbench_vision::image::{FloatImage, GrayImage, Size, gaussian_blur};
use matchbench_vision::seed::Seed;
use nalgebra::{Matrix3, Point2, Vector3};

/// Longest path of a shaken camera during the exposure, in pixels.
const SHAKE: f64 = 8.0;
/// Number of moments that are averaged in a shaken exposure.
const MOMENTS: usize = 8;

/// A homography and the image that it gives.
pub(super) struct Warp {
    pub(super) image: GrayImage,
    b_from_a: Matrix3<f64>,
}

impl Warp {
    /// A view of `image`: turned by up to 30 degrees, 0.6 to 1.6 times as large, slanted, with other brightness
    /// and contrast and some noise. If `blurred`, nearly half of the views are out of focus and nearly half are
    /// shaken, by random amounts.
    pub(super) fn new(image: &GrayImage, blurred: bool, seed: Seed) -> Self {
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
        let blurred = blurred.then(|| Blur::new(seed.child("blur")));
        let shade = |x: f64, y: f64| {
            let at = apply(&a_from_b, Point2::new(x, y));
            at.map_or(0.0, |at| interpolate(image, at))
        };
        let blurred = blurred.map(|blur| blur.apply(image.size(), shade));
        let view = GrayImage::from_fn(image.size(), |x, y| {
            let shade = match &blurred {
                Some(image) => f64::from(image.at(x, y)).max(0.0),
                None => shade(x as f64, y as f64),
            };
            let seen = 255.0 * gain * libm::pow(shade / 255.0, gamma) + noise * rng.normal();
            seen.round().clamp(0.0, 255.0) as u8
        });
        Self {
            image: view,
            b_from_a,
        }
    }

    /// The place of a point of the photograph in the view; `None` if it is outside.
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

/// How a view is blurred.
struct Blur {
    /// Standard deviation of the defocus, in pixels; small or negative for a sharp view.
    focus: f64,
    /// Path of the camera during the exposure, in pixels; short for a steady camera.
    shake: [f64; 2],
}

impl Blur {
    fn new(seed: Seed) -> Self {
        let mut rng = seed.rng();
        let mut within = |low: f64, high: f64| low + (high - low) * rng.uniform();
        let focus = within(-1.5, 1.5);
        let length = within(-SHAKE, SHAKE).max(0.0);
        let direction = within(0.0, core::f64::consts::PI);
        Self {
            focus,
            shake: [libm::cos(direction), libm::sin(direction)].map(|d| d * length),
        }
    }

    /// The blurred image of `shade`.
    fn apply(&self, size: Size, shade: impl Fn(f64, f64) -> f64) -> FloatImage {
        let [dx, dy] = self.shake;
        let moments = if dx * dx + dy * dy > 0.25 { MOMENTS } else { 1 };
        let image = FloatImage::from_fn(size, |x, y| {
            let shades = (0..moments).map(|moment| {
                let part = (moment as f64 + 0.5) / moments as f64 - 0.5;
                shade(x as f64 + part * dx, y as f64 + part * dy)
            });
            (shades.sum::<f64>() / moments as f64) as f32
        });
        if self.focus > 0.3 {
            gaussian_blur(&image, self.focus)
        } else {
            image
        }
    }
}

fn apply(h: &Matrix3<f64>, p: Point2<f64>) -> Option<Point2<f64>> {
    let q = h * p.to_homogeneous();
    (q.z > 0.1).then(|| Point2::new(q.x / q.z, q.y / q.z))
}

/// Bilinear interpolation; beyond the border the outermost pixels are repeated.
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
    use super::*;

    /// The mean position of the brightness that surrounds `near`.
    fn centroid(image: &GrayImage, near: Point2<f64>) -> Point2<f64> {
        let mut sums = [0.0; 3];
        for y in 0..image.height() {
            for x in 0..image.width() {
                let at = Point2::new(x as f64, y as f64);
                // Noise is below.
                let shade = (f64::from(image.at(x, y)) - 25.0).max(0.0);
                if (at - near).norm() < 25.0 {
                    sums = [
                        sums[0] + shade * at.x,
                        sums[1] + shade * at.y,
                        sums[2] + shade,
                    ];
                }
            }
        }
        Point2::new(sums[0] / sums[2], sums[1] / sums[2])
    }

    #[test]
    fn the_view_shows_each_point_where_it_is_carried() {
        let dot = Point2::new(68.3, 41.8);
        let image = GrayImage::from_fn(Size::new(120, 90), |x, y| {
            let squared = (Point2::new(x as f64, y as f64) - dot).norm_squared();
            (255.0 * libm::exp(-squared / (2.0 * 2.0 * 2.0))).round() as u8
        });
        for n in 0..8 {
            let warp = Warp::new(&image, n % 2 == 1, Seed(n));
            let carried = warp.transfer(dot).expect("near the centre");
            let seen = centroid(&warp.image, carried);
            assert!((seen - carried).norm() < 0.3, "{n}: {carried} {seen}");
            assert!(warp.transfer(Point2::new(-1.0, 5.0)).is_none());
        }
    }
}
