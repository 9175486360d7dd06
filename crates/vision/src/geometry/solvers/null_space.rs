//! The matrices that satisfy the epipolar equations of a few matches.
//!
//! Each match gives one linear equation `b^T E a = 0` in the nine entries of E. The null space of S
//! such equations has 9 - S dimensions; a Householder QR gives an orthonormal basis of it.
//!
//! | symbol | constant | value | source |
//! | --- | --- | --- | --- |
//! | smallest pivot of a sample, relative | `RANK_TOLERANCE` | 1e-10 | ours |

use nalgebra::Point2;

/// If the equations of a sample are this close to dependent, relative to their size, the sample is degenerate.
const RANK_TOLERANCE: f64 = 1e-10;

/// A 3 x 3 matrix in row-major order.
pub(super) type Flat = [f64; 9];

/// An orthonormal basis of the matrices E with `b^T E a = 0` for all S matches; `N` is 9 - S. `None` if the
/// equations depend on each other or are not finite.
pub(super) fn null_space<const S: usize, const N: usize>(
    a: &[Point2<f64>; S],
    b: &[Point2<f64>; S],
) -> Option<[Flat; N]> {
    const { assert!(S + N == 9, "each equation takes one dimension") };
    // Column k of the 9 x S matrix whose QR is taken is the equation of match k. Below, each
    // column is overwritten by the vector of its Householder reflection, scaled to norm sqrt 2.
    let mut columns: [Flat; S] = std::array::from_fn(|k| {
        let (a, b) = ([a[k].x, a[k].y, 1.0], [b[k].x, b[k].y, 1.0]);
        let equation: Flat = std::array::from_fn(|i| b[i / 3] * a[i % 3]);
        let norm = dot(&equation, &equation).sqrt();
        equation.map(|x| x / norm)
    });
    for k in 0..S {
        let (head, tail) = columns.split_at_mut(k + 1);
        let v = &mut head[k];
        v[..k].fill(0.0);
        let norm = dot(v, v).sqrt();
        if norm <= RANK_TOLERANCE || norm.is_nan() {
            return None;
        }
        v[k] += norm.copysign(v[k]);
        let scale = (2.0 / dot(v, v)).sqrt();
        *v = v.map(|x| x * scale);
        for column in tail {
            reflect(column, v);
        }
    }
    Some(std::array::from_fn(|i| {
        let mut q = [0.0; 9];
        q[S + i] = 1.0;
        for v in columns.iter().rev() {
            reflect(&mut q, v);
        }
        q
    }))
}

pub(super) fn dot(a: &Flat, b: &Flat) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn reflect(x: &mut Flat, v: &Flat) {
    let along = dot(x, v);
    for (x, v) in x.iter_mut().zip(v) {
        *x -= along * v;
    }
}
