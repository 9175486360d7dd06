//! From five matches to the polynomial whose roots are the third coordinate of the essential matrices.

use crate::simd::lanes::{Lanes, Mask};

/// A sample whose equations are this close to dependent, relative to their size, is degenerate.
const RANK_TOLERANCE: f64 = 1e-10;

/// Repeats a block for each of these numbers, which the compiler knows in it: how many entries are left of a column, say,
/// which it keeps in registers then.
macro_rules! for_each_const {
    ($name:ident in $($number:literal)* => $body:block) => {$({
        const $name: usize = $number;
        $body
    })*};
}

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
    let mut matrix = [[V::zero(); 20]; 10];
    constraints(&basis, &mut matrix);
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
        let norm = dot::<V, 0>(column, column).sqrt();
        for x in column {
            *x = *x / norm;
        }
    }
    let mut independent = V::Mask::all();
    let mut basis = [[V::zero(); 9]; 4];
    for (i, q) in basis.iter_mut().enumerate() {
        q[5 + i] = V::all(1.0);
    }
    for_each_const!(K in 0 1 2 3 4 => {
        let (head, tail) = columns.split_at_mut(K + 1);
        let norm = make_reflection::<V, K>(&mut head[K]);
        independent = independent.and(norm.above(V::all(RANK_TOLERANCE)));
        for column in tail {
            reflect::<V, K>(column, &head[K]);
        }
    });
    for_each_const!(K in 4 3 2 1 0 => {
        for q in &mut basis {
            reflect::<V, K>(q, &columns[K]);
        }
    });
    (basis, V::Mask::all().and_not(independent))
}

/// Makes of a column the vector of the reflection that leaves nothing below its entry `K`, and returns the length from there
/// on. Entries above `K` do not count: they are 0 in the vector.
#[inline(always)]
fn make_reflection<V: Lanes, const K: usize>(v: &mut [V; 9]) -> V {
    let norm = dot::<V, K>(v, v).sqrt();
    v[K] = v[K] + norm.copysign(v[K]);
    let scale = (V::all(2.0) / dot::<V, K>(v, v)).sqrt();
    for x in &mut v[K..] {
        *x = *x * scale;
    }
    norm
}

/// The sum of products from entry `K` on.
#[inline(always)]
fn dot<V: Lanes, const K: usize>(a: &[V; 9], b: &[V; 9]) -> V {
    let mut sum = V::zero();
    for i in K..9 {
        sum = sum + a[i] * b[i];
    }
    sum
}

#[inline(always)]
fn reflect<V: Lanes, const K: usize>(x: &mut [V; 9], v: &[V; 9]) {
    let along = dot::<V, K>(x, v);
    for i in K..9 {
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

/// Writes the ten cubic equations that make `x X + y Y + z Z + W` essential to `rows`, which are 0.
#[inline(always)]
fn constraints<V: Lanes>(basis: &[[V; 9]; 4], rows: &mut [Cubic<V>; 10]) {
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
    for i in 0..3 {
        for j in 0..3 {
            let mut row = [V::zero(); 20];
            for k in 0..3 {
                add(&mut row, &multiply_quadratic(&lambda[i][k], &e[3 * k + j]));
            }
            rows[3 * i + j] = row;
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
    for_each_const!(K in 0 1 2 3 4 5 6 7 8 9 => {
        eliminate_below::<V, K>(m);
        regular = regular.and(m[K][K].abs().above(V::zero()));
    });
    let mut reduced = [[V::zero(); 10]; 6];
    for_each_const!(I in 5 4 3 2 1 0 => {
        eliminate_above::<V, I>(m, &mut reduced);
    });
    (reduced, V::Mask::all().and_not(regular))
}

/// Takes the rows below from row `I` of the last six.
#[inline(always)]
fn eliminate_above<V: Lanes, const I: usize>(m: &[Cubic<V>; 10], reduced: &mut [[V; 10]; 6]) {
    let mut row = [V::zero(); 10];
    row.copy_from_slice(&m[4 + I][10..]);
    for below in I + 1..6 {
        let factor = m[4 + I][4 + below];
        for j in 0..10 {
            row[j] = row[j] - factor * reduced[below][j];
        }
    }
    for j in 0..10 {
        reduced[I][j] = row[j] / m[4 + I][4 + I];
    }
}

/// Brings the largest of the entries in column `K` from row `K` on to that row, and makes those below it 0, which is not
/// written.
#[inline(always)]
fn eliminate_below<V: Lanes, const K: usize>(m: &mut [Cubic<V>; 10]) {
    // Each lane has a pivot of its own, in the first of the rows where it is largest.
    let mut largest = m[K][K].abs();
    let mut from = [V::Mask::none(); 10];
    for row in K + 1..10 {
        let size = m[row][K].abs();
        let larger = size.above(largest);
        largest = size.where_or(larger, largest);
        for earlier in &mut from[K + 1..row] {
            *earlier = earlier.and_not(larger);
        }
        from[row] = larger;
    }
    let mut factors = [V::zero(); 10];
    for column in K..20 {
        let top = m[K][column];
        let mut pivot = top;
        for row in K + 1..10 {
            pivot = m[row][column].where_or(from[row], pivot);
        }
        m[K][column] = pivot;
        for row in K + 1..10 {
            let own = top.where_or(from[row], m[row][column]);
            if column == K {
                factors[row] = own / pivot;
            } else {
                m[row][column] = own - factors[row] * pivot;
            }
        }
    }
}

/// The rows k, l, m of B(z): `e - z f`, `g - z h` and `i - z j`, where the monomials on the left
/// cancel (eqs. 11-13).
#[inline(always)]
fn rows<V: Lanes>(reduced: &[[V; 10]; 6]) -> [Row<V>; 3] {
    [row(reduced, 0), row(reduced, 2), row(reduced, 4)]
}

/// `e - z f`, where `e` is a row after the elimination and `f` the next one.
#[inline(always)]
fn row<V: Lanes>(reduced: &[[V; 10]; 6], first: usize) -> Row<V> {
    let (e, f) = (&reduced[first], &reduced[first + 1]);
    Row {
        x: [e[2], e[1] - f[2], e[0] - f[1], -f[0]],
        y: [e[5], e[4] - f[5], e[3] - f[4], -f[3]],
        one: [e[9], e[8] - f[9], e[7] - f[8], e[6] - f[7], -f[6]],
    }
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
