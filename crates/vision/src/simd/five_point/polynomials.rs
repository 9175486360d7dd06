//! From five matches to the polynomial whose roots are the third coordinate of the essential matrices.

use crate::simd::lanes::{Lanes, Mask};

/// A sample whose equations are this close to dependent, relative to their size, is degenerate.
const RANK_TOLERANCE: f64 = 1e-10;

/// What is known of eight samples before their roots are.
pub(super) struct Reduced<V> {
    /// The four matrices X, Y, Z and W, row after row.
    pub(super) basis: [[V; 9]; 4],
    /// The rows k, l and m of B(z).
    pub(super) rows: [Row<V>; 3],
    /// det B(z), lowest power first; NaN where there is none.
    pub(super) determinant: [V; 11],
}

/// A row of B(z): polynomials in z, lowest power first, that multiply x, y and 1.
pub(super) struct Row<V> {
    pub(super) x: [V; 4],
    pub(super) y: [V; 4],
    pub(super) one: [V; 5],
}

#[inline(always)]
pub(super) fn polynomials<V: Lanes>(points: &[V; 20]) -> Reduced<V> {
    let (basis, dependent) = null_space(points);
    let mut matrix = constraints(&basis);
    let (reduced, singular) = eliminate(&mut matrix);
    let rows = rows(&reduced);
    let mut determinant = determinant(&rows);
    determinant[10] = not_lower(&determinant);
    let none = dependent.or(singular);
    for coefficient in &mut determinant {
        *coefficient = V::all(f64::NAN).where_or(none, *coefficient);
    }
    Reduced {
        basis,
        rows,
        determinant,
    }
}

/// The leading coefficient, or what rounding could have left of it where it is 0. A solution without W, as that of two
/// rectified views, is a root at infinity; a very large one stands for it.
#[inline(always)]
fn not_lower<V: Lanes>(c: &[V; 11]) -> V {
    /// Below the rounding of the coefficients.
    const NEXT_TO_NOTHING: f64 = 1e-17;
    let mut scale = V::zero();
    for c in c {
        let size = c.abs();
        scale = size.where_or(size.above(scale), scale);
    }
    let is_zero = V::zero().at_least(c[10].abs());
    (V::all(NEXT_TO_NOTHING) * scale).where_or(is_zero, c[10])
}

/// An orthonormal basis of the matrices that satisfy the five equations, and where these depend on each other.
#[inline(always)]
fn null_space<V: Lanes>(points: &[V; 20]) -> ([[V; 9]; 4], V::Mask) {
    let mut columns = [[V::zero(); 9]; 5];
    for (k, column) in columns.iter_mut().enumerate() {
        let a = [points[2 * k], points[2 * k + 1], V::all(1.0)];
        let b = [points[10 + 2 * k], points[11 + 2 * k], V::all(1.0)];
        for i in 0..9 {
            column[i] = b[i / 3] * a[i % 3];
        }
        let norm = dot(column, column).sqrt();
        for x in column {
            *x = *x / norm;
        }
    }
    let mut independent = V::Mask::all();
    for k in 0..5 {
        let (head, tail) = columns.split_at_mut(k + 1);
        let v = &mut head[k];
        for x in &mut v[..k] {
            *x = V::zero();
        }
        let norm = dot(v, v).sqrt();
        independent = independent.and(norm.above(V::all(RANK_TOLERANCE)));
        v[k] = v[k] + norm.copysign(v[k]);
        let scale = (V::all(2.0) / dot(v, v)).sqrt();
        for x in &mut *v {
            *x = *x * scale;
        }
        for column in tail {
            reflect(column, v);
        }
    }
    let mut basis = [[V::zero(); 9]; 4];
    for (i, q) in basis.iter_mut().enumerate() {
        q[5 + i] = V::all(1.0);
        for v in columns.iter().rev() {
            reflect(q, v);
        }
    }
    (basis, V::Mask::all().and_not(independent))
}

#[inline(always)]
fn dot<V: Lanes>(a: &[V; 9], b: &[V; 9]) -> V {
    let mut sum = V::zero();
    for i in 0..9 {
        sum = sum + a[i] * b[i];
    }
    sum
}

#[inline(always)]
fn reflect<V: Lanes>(x: &mut [V; 9], v: &[V; 9]) {
    let along = dot(x, v);
    for i in 0..9 {
        x[i] = x[i] - along * v[i];
    }
}

/// A polynomial of degree 1 in x, y, z: coefficients of x, y, z, 1.
type Linear<V> = [V; 4];
/// A polynomial of degree 2: x^2, xy, xz, x, y^2, yz, y, z^2, z, 1.
type Quadratic<V> = [V; 10];
/// A polynomial of degree 3: x^3, y^3, x^2 y, x y^2, x^2 z, x^2, y^2 z, y^2, xyz, xy | x z^2, xz,
/// x, y z^2, yz, y, z^3, z^2, z, 1. The first ten are eliminated.
type Cubic<V> = [V; 20];

/// The ten cubic equations that make `x X + y Y + z Z + W` essential.
#[inline(always)]
fn constraints<V: Lanes>(basis: &[[V; 9]; 4]) -> [Cubic<V>; 10] {
    let mut e = [[V::zero(); 4]; 9];
    for (i, entry) in e.iter_mut().enumerate() {
        for k in 0..4 {
            entry[k] = basis[k][i];
        }
    }
    // E E^T - trace(E E^T) I / 2, then times E.
    let mut lambda = [[[V::zero(); 10]; 3]; 3];
    for i in 0..3 {
        for j in i..3 {
            let mut gram = [V::zero(); 10];
            for k in 0..3 {
                add(&mut gram, &multiply_linear(&e[3 * i + k], &e[3 * j + k]));
            }
            lambda[i][j] = gram;
            lambda[j][i] = gram;
        }
    }
    for m in 0..10 {
        let half_trace = V::all(0.5) * (lambda[0][0][m] + lambda[1][1][m] + lambda[2][2][m]);
        for i in 0..3 {
            lambda[i][i][m] = lambda[i][i][m] - half_trace;
        }
    }
    let mut rows = [[V::zero(); 20]; 10];
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                let product = multiply_quadratic(&lambda[i][k], &e[3 * k + j]);
                add(&mut rows[3 * i + j], &product);
            }
        }
    }
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let mut minor = multiply_linear(&e[3 + i], &e[6 + j]);
        let other = multiply_linear(&e[3 + j], &e[6 + i]);
        for m in 0..10 {
            minor[m] = minor[m] - other[m];
        }
        add(&mut rows[9], &multiply_quadratic(&minor, &e[k]));
    }
    rows
}

#[inline(always)]
fn add<V: Lanes, const N: usize>(sum: &mut [V; N], p: &[V; N]) {
    for i in 0..N {
        sum[i] = sum[i] + p[i];
    }
}

#[rustfmt::skip]
#[inline(always)]
fn multiply_linear<V: Lanes>(p: &Linear<V>, q: &Linear<V>) -> Quadratic<V> {
    [
        p[0] * q[0], p[0] * q[1] + p[1] * q[0], p[0] * q[2] + p[2] * q[0], p[0] * q[3] + p[3] * q[0],
        p[1] * q[1], p[1] * q[2] + p[2] * q[1], p[1] * q[3] + p[3] * q[1],
        p[2] * q[2], p[2] * q[3] + p[3] * q[2],
        p[3] * q[3],
    ]
}

#[rustfmt::skip]
#[inline(always)]
fn multiply_quadratic<V: Lanes>(p: &Quadratic<V>, q: &Linear<V>) -> Cubic<V> {
    [
        p[0] * q[0],                             // x^3
        p[4] * q[1],                             // y^3
        p[0] * q[1] + p[1] * q[0],               // x^2 y
        p[1] * q[1] + p[4] * q[0],               // x y^2
        p[0] * q[2] + p[2] * q[0],               // x^2 z
        p[0] * q[3] + p[3] * q[0],               // x^2
        p[4] * q[2] + p[5] * q[1],               // y^2 z
        p[4] * q[3] + p[6] * q[1],               // y^2
        p[1] * q[2] + p[2] * q[1] + p[5] * q[0], // xyz
        p[1] * q[3] + p[3] * q[1] + p[6] * q[0], // xy
        p[2] * q[2] + p[7] * q[0],               // x z^2
        p[2] * q[3] + p[3] * q[2] + p[8] * q[0], // xz
        p[3] * q[3] + p[9] * q[0],               // x
        p[5] * q[2] + p[7] * q[1],               // y z^2
        p[5] * q[3] + p[6] * q[2] + p[8] * q[1], // yz
        p[6] * q[3] + p[9] * q[1],               // y
        p[7] * q[2],                             // z^3
        p[7] * q[3] + p[8] * q[2],               // z^2
        p[8] * q[3] + p[9] * q[2],               // z
        p[9] * q[3],                             // 1
    ]
}

/// Right half of the last six rows after Gauss-Jordan elimination: those that start with x^2 z,
/// x^2, y^2 z, y^2, xyz, xy (e to j in the paper), and where there is a pivot of 0. The rows above them are never
/// needed, so the elimination upwards stops there.
#[inline(always)]
fn eliminate<V: Lanes>(m: &mut [Cubic<V>; 10]) -> ([[V; 10]; 6], V::Mask) {
    let mut regular = V::Mask::all();
    for k in 0..10 {
        // Each lane has a pivot of its own, in the first of the rows where it is largest.
        let mut largest = m[k][k].abs();
        let mut from = [V::Mask::none(); 10];
        for row in k + 1..10 {
            let size = m[row][k].abs();
            let larger = size.above(largest);
            largest = size.where_or(larger, largest);
            for earlier in &mut from[k + 1..row] {
                *earlier = earlier.and_not(larger);
            }
            from[row] = larger;
        }
        for row in k + 1..10 {
            if from[row].any() {
                for column in k..20 {
                    let (top, other) = (m[k][column], m[row][column]);
                    m[k][column] = other.where_or(from[row], top);
                    m[row][column] = top.where_or(from[row], other);
                }
            }
        }
        regular = regular.and(m[k][k].abs().above(V::zero()));
        let (head, tail) = m.split_at_mut(k + 1);
        let pivot_row = &head[k];
        for row in tail {
            let factor = row[k] / pivot_row[k];
            for column in k + 1..20 {
                row[column] = row[column] - factor * pivot_row[column];
            }
        }
    }
    let mut reduced = [[V::zero(); 10]; 6];
    for i in (0..6).rev() {
        let (head, done) = reduced.split_at_mut(i + 1);
        let row = &mut head[i];
        row.copy_from_slice(&m[4 + i][10..]);
        for (offset, below) in done.iter().enumerate() {
            let factor = m[4 + i][4 + i + 1 + offset];
            for j in 0..10 {
                row[j] = row[j] - factor * below[j];
            }
        }
        for x in row {
            *x = *x / m[4 + i][4 + i];
        }
    }
    (reduced, V::Mask::all().and_not(regular))
}

/// The rows k, l, m of B(z): `e - z f`, `g - z h` and `i - z j`, where the monomials on the left
/// cancel (eqs. 11-13).
#[inline(always)]
fn rows<V: Lanes>(reduced: &[[V; 10]; 6]) -> [Row<V>; 3] {
    let row = |i: usize| {
        let (e, f) = (&reduced[2 * i], &reduced[2 * i + 1]);
        Row {
            x: [e[2], e[1] - f[2], e[0] - f[1], -f[0]],
            y: [e[5], e[4] - f[5], e[3] - f[4], -f[3]],
            one: [e[9], e[8] - f[9], e[7] - f[8], e[6] - f[7], -f[6]],
        }
    };
    [row(0), row(1), row(2)]
}

/// det B(z), lowest power first.
#[inline(always)]
fn determinant<V: Lanes>([k, l, m]: &[Row<V>; 3]) -> [V; 11] {
    let mut det = [V::zero(); 11];
    for (one, p, q) in [(&k.one, l, m), (&l.one, m, k), (&m.one, k, l)] {
        let mut minor = [V::zero(); 7];
        for i in 0..4 {
            for j in 0..4 {
                minor[i + j] = minor[i + j] + (p.x[i] * q.y[j] - p.y[i] * q.x[j]);
            }
        }
        for i in 0..5 {
            for j in 0..7 {
                det[i + j] = det[i + j] + one[i] * minor[j];
            }
        }
    }
    det
}
