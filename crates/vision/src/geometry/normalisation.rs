//! Normalised coordinates, in which linear equations of image points are well conditioned.
//!
//! Hartley, "In Defense of the Eight-Point Algorithm", PAMI 19(6), 1997; Hartley, Zisserman,
//! "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 4.4.

use nalgebra::Matrix3;

/// The transformation that moves the centroid of the points to the origin and makes their mean distance from it
/// sqrt 2. Not finite if there are no points, and huge or not finite if all points are the
/// same.
pub(crate) fn normalisation(points: impl Iterator<Item = (f64, f64)> + Clone) -> Matrix3<f64> {
    let count = points.clone().count() as f64;
    let mean_x = points.clone().map(|(x, _)| x).sum::<f64>() / count;
    let mean_y = points.clone().map(|(_, y)| y).sum::<f64>() / count;
    let distances = points.map(|(x, y)| {
        let (dx, dy) = (x - mean_x, y - mean_y);
        (dx * dx + dy * dy).sqrt()
    });
    let scale = std::f64::consts::SQRT_2 * count / distances.sum::<f64>();
    Matrix3::new(
        scale,
        0.0,
        -scale * mean_x,
        0.0,
        scale,
        -scale * mean_y,
        0.0,
        0.0,
        1.0,
    )
}
