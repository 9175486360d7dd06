//! The top of a quadratic through the 27 values around a maximum.

use nalgebra::{Matrix3, Vector3};

use crate::simd::ThreeRows;

/// From column `x` of the middle row of the middle layer to the top of the quadratic through its
/// neighbours, along x, y and layer; none if that is more than one away.
///
/// M. Brown, D. G. Lowe: "Invariant features from interest point groups", BMVC 2002.
pub(super) fn offset(rows: &[ThreeRows<'_>; 3], x: usize) -> Option<[f32; 3]> {
    let at = |dx: usize, dy: usize, dl: usize| rows[dl][dy][x + dx - 1];
    let value = at(1, 1, 1);
    let second = |a: f32, b: f32| a + b - 2.0 * value;
    let mixed = |aa: f32, ab: f32, ba: f32, bb: f32| 0.25 * (bb + aa - ab - ba);
    let gradient = Vector3::new(
        0.5 * (at(2, 1, 1) - at(0, 1, 1)),
        0.5 * (at(1, 2, 1) - at(1, 0, 1)),
        0.5 * (at(1, 1, 2) - at(1, 1, 0)),
    );
    let xx = second(at(0, 1, 1), at(2, 1, 1));
    let yy = second(at(1, 0, 1), at(1, 2, 1));
    let ss = second(at(1, 1, 0), at(1, 1, 2));
    let xy = mixed(at(0, 0, 1), at(0, 2, 1), at(2, 0, 1), at(2, 2, 1));
    let xs = mixed(at(0, 1, 0), at(0, 1, 2), at(2, 1, 0), at(2, 1, 2));
    let ys = mixed(at(1, 0, 0), at(1, 0, 2), at(1, 2, 0), at(1, 2, 2));
    let hessian = Matrix3::new(xx, xy, xs, xy, yy, ys, xs, ys, ss);
    // Where the quadratic has no single top the maximum stays where it is.
    let offset = hessian
        .try_inverse()
        .map_or(Vector3::zeros(), |inverse| -(inverse * gradient));
    let is_near = offset.iter().all(|v| v.abs() <= 1.0);
    is_near.then_some([offset.x, offset.y, offset.z])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_of_a_quadratic_is_found() {
        let at = |x: f32, y: f32, s: f32| {
            let (x, y, s) = (x - 0.25, y + 0.5, s - 0.125);
            9.0 - x * x - 2.0 * y * y - s * s + 0.5 * x * y - 0.25 * x * s
        };
        let levels = [-1.0, 0.0, 1.0]
            .map(|s| [-1.0, 0.0, 1.0].map(|y| [-1.0, 0.0, 1.0].map(|x| at(x, y, s))));
        let rows = std::array::from_fn(|l| std::array::from_fn(|y| levels[l][y].as_slice()));
        let [x, y, s] = offset(&rows, 1).expect("it is near");
        assert!((x - 0.25).abs() < 1e-5 && (y + 0.5).abs() < 1e-5 && (s - 0.125).abs() < 1e-5);
        let flat: [ThreeRows<'_>; 3] = [[&[1.0; 3]; 3]; 3];
        assert_eq!(offset(&flat, 1), Some([0.0; 3]));
    }
}
