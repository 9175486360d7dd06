//! Depths of many matches side by side, in two ways: by linear triangulation, and where the lines of sight come
//! nearest to each other.

/// Matches that go through the arithmetic side by side.
const LANES: usize = 8;
/// Sweeps of the Jacobi iteration: it converges quadratically, and 4 x 4 matrices are diagonal to
/// rounding after five.
const SWEEPS: usize = 6;
/// An entry beside the diagonal is taken for zero if it is not larger than this. The trace is at least 2, so the entry is far
/// below rounding. After five sweeps, products of such entries would be subnormal numbers, with which some processors
/// (Intel) compute far more slowly.
const NEGLIGIBLE: f64 = 1e-40;

type Lane = [f64; LANES];

multiversioned! {
    /// Depth in both views of each match, for `x_b = R x_a + t` with R in row-major order; see
    /// [`crate::geometry::triangulate_depths`]. Infinite or NaN where the lines of sight are
    /// parallel or a coordinate is not finite.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn triangulate_depths(
        r: &[f64; 9],
        t: &[f64; 3],
        a_x: &[f64],
        a_y: &[f64],
        b_x: &[f64],
        b_y: &[f64],
        depth_a: &mut [f64],
        depth_b: &mut [f64],
    ) {
        let n = depth_a.len();
        assert!(
            a_x.len() == n && a_y.len() == n && b_x.len() == n && b_y.len() == n && depth_b.len() == n,
            "one entry for each match"
        );
        for first in (0..n).step_by(LANES) {
            let range = first..n.min(first + LANES);
            let load = |values: &[f64]| {
                let mut lane = [0.0; LANES];
                lane[..range.len()].copy_from_slice(&values[range.clone()]);
                lane
            };
            let mut m = normal_matrix(r, t, &load(a_x), &load(a_y), &load(b_x), &load(b_y));
            let x = smallest_eigenvector(&mut m);
            for i in range.clone() {
                let [x, y, z, w] = [0, 1, 2, 3].map(|k: usize| x[k][i - first]);
                depth_a[i] = z / w;
                depth_b[i] = r[6].mul_add(x, r[7].mul_add(y, r[8] * z)) / w + t[2];
            }
        }
    }
}

multiversioned! {
    /// Depth in both views at which the lines of sight of each match come nearest to meeting, for
    /// `x_b = R x_a + t` with R in row-major order; see [`crate::geometry::ray_depths`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn ray_depths(
        r: &[f64; 9],
        t: &[f64; 3],
        a_x: &[f64],
        a_y: &[f64],
        b_x: &[f64],
        b_y: &[f64],
        depth_a: &mut [f64],
        depth_b: &mut [f64],
    ) {
        let n = depth_a.len();
        assert!(
            a_x.len() == n && a_y.len() == n && b_x.len() == n && b_y.len() == n && depth_b.len() == n,
            "one entry for each match"
        );
        let (a_x, a_y, b_x, b_y) = (&a_x[..n], &a_y[..n], &b_x[..n], &b_y[..n]);
        let depth_b = &mut depth_b[..n];
        for i in 0..n {
            // p = R a; u = p x b, v = t x b, w = t x p.
            let p = [0, 3, 6].map(|k: usize| r[k].mul_add(a_x[i], r[k + 1].mul_add(a_y[i], r[k + 2])));
            let (x, y) = (b_x[i], b_y[i]);
            let u = [p[1] - p[2] * y, p[2].mul_add(x, -p[0]), p[0].mul_add(y, -p[1] * x)];
            let v = [t[1] - t[2] * y, t[2].mul_add(x, -t[0]), t[0].mul_add(y, -t[1] * x)];
            let w = [
                t[1].mul_add(p[2], -t[2] * p[1]),
                t[2].mul_add(p[0], -t[0] * p[2]),
                t[0].mul_add(p[1], -t[1] * p[0]),
            ];
            let square = u[0].mul_add(u[0], u[1].mul_add(u[1], u[2] * u[2]));
            depth_a[i] = -(v[0].mul_add(u[0], v[1].mul_add(u[1], v[2] * u[2]))) / square;
            depth_b[i] = -(w[0].mul_add(u[0], w[1].mul_add(u[1], w[2] * u[2]))) / square;
        }
    }
}

/// `A^T A` for the four equations A X = 0 of each match.
#[inline(always)]
fn normal_matrix(
    r: &[f64; 9],
    t: &[f64; 3],
    a_x: &Lane,
    a_y: &Lane,
    b_x: &Lane,
    b_y: &Lane,
) -> [[Lane; 4]; 4] {
    let p = [
        [r[0], r[1], r[2], t[0]],
        [r[3], r[4], r[5], t[1]],
        [r[6], r[7], r[8], t[2]],
    ];
    let mut m = [[[0.0; LANES]; 4]; 4];
    for lane in 0..LANES {
        let rows = [
            [-1.0, 0.0, a_x[lane], 0.0],
            [0.0, -1.0, a_y[lane], 0.0],
            [0, 1, 2, 3].map(|k: usize| b_x[lane].mul_add(p[2][k], -p[0][k])),
            [0, 1, 2, 3].map(|k: usize| b_y[lane].mul_add(p[2][k], -p[1][k])),
        ];
        for i in 0..4 {
            for j in 0..4 {
                let sum = |k: usize, sum: f64| rows[k][i].mul_add(rows[k][j], sum);
                m[i][j][lane] = sum(0, sum(1, sum(2, sum(3, 0.0))));
            }
        }
    }
    m
}

/// The eigenvector of the smallest eigenvalue of symmetric matrices, by cyclic Jacobi rotations
/// (Golub, Van Loan, "Matrix Computations", sec. 8.5), without branches.
#[inline(always)]
fn smallest_eigenvector(m: &mut [[Lane; 4]; 4]) -> [Lane; 4] {
    let mut v = [[[0.0; LANES]; 4]; 4];
    for (i, column) in v.iter_mut().enumerate() {
        column[i] = [1.0; LANES];
    }
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            rotate(m, &mut v, p, q);
        }
    }
    let mut smallest = v[0];
    let mut value = m[0][0];
    for k in 1..4 {
        for lane in 0..LANES {
            let smaller = m[k][k][lane] < value[lane];
            value[lane] = if smaller { m[k][k][lane] } else { value[lane] };
            for i in 0..4 {
                smallest[i][lane] = if smaller {
                    v[k][i][lane]
                } else {
                    smallest[i][lane]
                };
            }
        }
    }
    smallest
}

/// The rotation of rows and columns p and q that makes `m[p][q]` zero; `v[k]` is eigenvector k.
#[inline(always)]
fn rotate(m: &mut [[Lane; 4]; 4], v: &mut [[Lane; 4]; 4], p: usize, q: usize) {
    let (mut cosine, mut sine) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        let entry = m[p][q][lane];
        // What is not a number stays so.
        let is_negligible = entry.abs() <= NEGLIGIBLE;
        let twice = if is_negligible { 0.0 } else { 2.0 * entry };
        let difference = m[q][q][lane] - m[p][p][lane];
        let root = difference.mul_add(difference, twice * twice).sqrt();
        // The smallest positive number keeps 0 / 0 away where nothing is left to rotate.
        let tangent = twice / (difference + (root + f64::MIN_POSITIVE).copysign(difference));
        cosine[lane] = 1.0 / tangent.mul_add(tangent, 1.0).sqrt();
        sine[lane] = tangent * cosine[lane];
        let shift = 0.5 * tangent * twice;
        m[p][p][lane] -= shift;
        m[q][q][lane] += shift;
        m[p][q][lane] = 0.0;
        m[q][p][lane] = 0.0;
    }
    for k in 0..4 {
        if k != p && k != q {
            for lane in 0..LANES {
                let (at_p, at_q) = (m[k][p][lane], m[k][q][lane]);
                let new_p = cosine[lane].mul_add(at_p, -sine[lane] * at_q);
                let new_q = sine[lane].mul_add(at_p, cosine[lane] * at_q);
                (m[k][p][lane], m[p][k][lane]) = (new_p, new_p);
                (m[k][q][lane], m[q][k][lane]) = (new_q, new_q);
            }
        }
        for lane in 0..LANES {
            let (at_p, at_q) = (v[p][k][lane], v[q][k][lane]);
            v[p][k][lane] = cosine[lane].mul_add(at_p, -sine[lane] * at_q);
            v[q][k][lane] = sine[lane].mul_add(at_p, cosine[lane] * at_q);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::*;
    use crate::seed::Seed;

    #[test]
    fn eigenvectors_are_those_of_a_general_solver() {
        let mut rng = Seed(1).rng();
        for _ in 0..500 {
            let a = Matrix4::from_fn(|_, _| rng.normal());
            let normal = a.transpose() * a;
            let mut m = [[[0.0; LANES]; 4]; 4];
            for i in 0..4 {
                for j in 0..4 {
                    m[i][j] = [normal[(i, j)]; LANES];
                }
            }
            let v = smallest_eigenvector(&mut m);
            let rest = m.as_flattened().as_flattened();
            assert!(rest.iter().all(|x| !x.is_subnormal()));
            let svd = a.svd(false, true);
            let expected = svd.v_t.unwrap().row(3).into_owned();
            let found = nalgebra::RowVector4::from_fn(|_, i| v[i][5]);
            let gap = (svd.singular_values[2] - svd.singular_values[3]) / svd.singular_values[0];
            assert!((found.norm() - 1.0).abs() < 1e-14);
            assert!(
                found.dot(&expected).abs() > 1.0 - 1e-12 / gap,
                "{found} {expected}"
            );
        }
    }
}
