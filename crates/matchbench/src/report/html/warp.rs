//! Image a, transformed by an estimated homography so that it lies over image b. The browser draws it, by a
//! projective transformation of the picture (CSS Transforms, `matrix3d`).
//!
//! In CSS a pixel is a square, and the corner of the first square, not its centre, is at the origin. So the
//! transformation is the homography between squares: scaled down, and moved by half a pixel.

use minijinja::{Value, context};
use nalgebra::{Matrix3, Vector3};

use super::super::PairView;

/// The longest side of the pictures, in CSS pixels; a narrow screen still shows all of it.
const LONGEST: f64 = 360.0;

/// Both pictures, and the transformation of the first; `None` if no homography was estimated.
pub(super) fn warp(view: &PairView) -> Option<Value> {
    let homography = view.homography?;
    let sizes = (view.images.each_ref()).map(|image| [image.original.0, image.original.1]);
    let scales = sizes.map(|[width, height]| LONGEST / width.max(height).max(1) as f64);
    let shown = [0, 1].map(|side| sizes[side].map(|length| length as f64 * scales[side]));
    let length = |pixels: f64| format!("{pixels:.1}");
    let style = |[width, height]: [f64; 2]| {
        let (width, height) = (length(width), length(height));
        format!("width:{width}px;height:{height}px")
    };
    let moved = between_pictures(&homography, scales, shown[0]);
    Some(context! {
        frames => [view.frames.0, view.frames.1],
        sizes => shown.map(style),
        transform => matrix3d(&moved),
    })
}

/// The homography from the picture of a, of size `shown`, to that of b. Its sign is such that the middle of a
/// lies in front of the viewer.
fn between_pictures(b_from_a: &Matrix3<f64>, scales: [f64; 2], shown: [f64; 2]) -> Matrix3<f64> {
    let [squares_a, squares_b] = scales.map(|scale| {
        let half = 0.5 * scale;
        Matrix3::new(scale, 0.0, half, 0.0, scale, half, 0.0, 0.0, 1.0)
    });
    let a_to_pixels = squares_a
        .try_inverse()
        .expect("a similarity has an inverse");
    let moved = squares_b * b_from_a * a_to_pixels;
    let middle = moved * Vector3::new(0.5 * shown[0], 0.5 * shown[1], 1.0);
    moved * middle.z.signum() / moved.amax()
}

/// A homography as CSS takes it: column by column, with a third dimension that stays unchanged.
fn matrix3d(h: &Matrix3<f64>) -> String {
    let columns = [
        [h[(0, 0)], h[(1, 0)], 0.0, h[(2, 0)]],
        [h[(0, 1)], h[(1, 1)], 0.0, h[(2, 1)]],
        [0.0, 0.0, 1.0, 0.0],
        [h[(0, 2)], h[(1, 2)], 0.0, h[(2, 2)]],
    ];
    let numbers: Vec<String> = (columns.iter().flatten())
        .map(|number| format!("{number:e}"))
        .collect();
    format!("matrix3d({})", numbers.join(","))
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::transfer;
    use nalgebra::Point2;

    use super::*;

    #[test]
    fn a_pixel_is_drawn_where_the_homography_takes_it() {
        let h = Matrix3::new(0.9, 0.1, 40.0, -0.2, 1.1, 30.0, 1e-4, -2e-4, 1.0);
        let (scales, shown) = ([0.5, 0.25], [320.0, 240.0]);
        for sign in [1.0, -1.0] {
            let moved = between_pictures(&(h * sign), scales, shown);
            let pixel = Point2::new(100.0, 200.0);
            let centre = |at: Point2<f64>, scale: f64| at.map(|x| (x + 0.5) * scale);
            let expected = centre(transfer(&h, pixel), scales[1]);
            let drawn = moved * centre(pixel, scales[0]).to_homogeneous();
            assert!(drawn.z > 0.0, "before the viewer");
            assert!((Point2::new(drawn.x, drawn.y) / drawn.z - expected).norm() < 1e-9);
        }
    }

    #[test]
    fn css_reads_columns() {
        let h = Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0);
        let expected = "matrix3d(1e0,4e0,0e0,7e0,2e0,5e0,0e0,8e0,0e0,0e0,1e0,0e0,3e0,6e0,0e0,9e0)";
        assert_eq!(matrix3d(&h), expected);
    }
}
