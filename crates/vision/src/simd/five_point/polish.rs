//! From roots to essential matrices, eight at a time.

use super::ROOM;
use super::polynomials::{Reduced, Row};
use crate::simd::lanes::{Lanes, Mask, Pool, places_of};

/// Residuals of unit-norm matrices below this are as good as rounding lets them be.
const POLISHED: f64 = 1e-14;
/// Candidates whose residual stays above this are no solutions.
const ACCEPTED: f64 = 1e-9;
/// A candidate this far off is no root at all.
const NO_ROOT: f64 = 0.1;
/// Polishing converges quadratically: what needs more steps is not going to converge.
const MAX_POLISHING_STEPS: usize = 5;

/// A 3 x 3 matrix, row after row.
type Matrix<V> = [V; 9];

/// What matrices of roots are, as coordinates in the basis of their sample; then the sample.
pub(super) type Candidates = Pool<5, ROOM>;

/// Adds the candidates of those roots that are there: with `oriented`, those that agree in orientation with all five matches,
/// which need not be told to the last digit.
#[inline(always)]
pub(super) fn add_candidates<V: Lanes>(
    reduced: &Reduced<V>,
    points: &[V; 20],
    [z, sample]: [V; 2],
    are_there: V::Mask,
    oriented: bool,
    candidates: &mut Candidates,
) {
    let places = places_of(sample);
    // The basis is orthonormal, so a unit vector of coordinates is a matrix of norm 1.
    let at = unit(back_substitute(&reduced.rows, z, places));
    let mut keep = are_there;
    if oriented {
        let e = combine(&basis_of(reduced, places), &at);
        keep = keep.and(agree_in_orientation(&e, points, places));
    }
    let [x, y, z, w] = at;
    candidates.push(keep, &[x, y, z, w, sample]);
}

/// The matrices of candidates, and which of those that are there are solutions.
#[inline(always)]
pub(super) fn polish<V: Lanes>(
    reduced: &Reduced<V>,
    [x, y, z, w, sample]: [V; 5],
    are_there: V::Mask,
) -> ([V; 9], V::Mask) {
    let mut at = [x, y, z, w];
    let basis = basis_of(reduced, places_of(sample));
    let mut going = are_there;
    let mut good = V::Mask::none();
    let mut found = [V::zero(); 9];
    for step in 0..=MAX_POLISHING_STEPS {
        let e = combine(&basis, &at);
        let gram = times(&e, &transpose(&e));
        let half_trace = V::all(0.5) * (gram[0] + gram[4] + gram[8]);
        let mut residual = times(&gram, &e);
        for i in 0..9 {
            residual[i] = residual[i] - e[i] * half_trace;
        }
        let size = norm_squared(&residual).sqrt();
        let done = if step == MAX_POLISHING_STEPS {
            V::Mask::all()
        } else {
            V::all(POLISHED).above(size)
        };
        let accepted = going.and(done).and(V::all(ACCEPTED).above(size));
        for i in 0..9 {
            found[i] = e[i].where_or(accepted, found[i]);
        }
        good = good.or(accepted);
        // Nor does it where the size is no number.
        going = going.and_not(done).and(V::all(NO_ROOT).at_least(size));
        if !going.any() {
            break;
        }
        let (change, definite) = step_from(&basis, &at, &e, &gram, half_trace, &residual);
        let mut moved = at;
        for i in 0..4 {
            moved[i] = at[i] - change[i];
        }
        at = unit(moved);
        going = going.and(definite);
    }
    (found, good)
}

/// A step of Gauss and Newton, and where its equations have a solution.
#[inline(always)]
fn step_from<V: Lanes>(
    basis: &[Matrix<V>; 4],
    at: &[V; 4],
    e: &Matrix<V>,
    gram: &Matrix<V>,
    half_trace: V,
    residual: &Matrix<V>,
) -> ([V; 4], V::Mask) {
    let ete = times(&transpose(e), e);
    let mut derivatives = [[V::zero(); 9]; 4];
    for k in 0..4 {
        let d = &basis[k];
        let first = times(d, &ete);
        let second = times(&times(e, &transpose(d)), e);
        let third = times(gram, d);
        let along = dot(e, d);
        for i in 0..9 {
            derivatives[k][i] = first[i] + second[i] + third[i] - e[i] * along - d[i] * half_trace;
        }
    }
    // Normal equations, plus one equation that forbids a change of length.
    let mut normal = [[V::zero(); 4]; 4];
    let mut gradient = [V::zero(); 4];
    for i in 0..4 {
        for j in 0..=i {
            normal[i][j] = dot(&derivatives[i], &derivatives[j]) + at[i] * at[j];
        }
        gradient[i] = dot(&derivatives[i], residual);
    }
    solve(&mut normal, gradient)
}

/// (x, y, z, 1) up to scale for a root z: the null vector of B(z).
#[inline(always)]
fn back_substitute<V: Lanes>(rows: &[Row<V>; 3], z: V, places: V::Places) -> [V; 4] {
    let mut vectors = [[V::zero(); 3]; 3];
    for (vector, row) in vectors.iter_mut().zip(rows) {
        for (value, polynomial) in vector.iter_mut().zip([&row.x[..], &row.y, &row.one]) {
            for c in polynomial.iter().rev() {
                *value = *value * z + c.taken(places);
            }
        }
    }
    // Any two rows will do.
    let null = null_vector(&vectors);
    [null[0], null[1], z * null[2], null[2]]
}

/// The vector that is perpendicular to three vectors of one plane: the longest of their three cross products.
#[inline(always)]
fn null_vector<V: Lanes>([k, l, m]: &[[V; 3]; 3]) -> [V; 3] {
    let mut null = cross(k, l);
    for other in [cross(l, m), cross(m, k)] {
        let longer = squared(&other).above(squared(&null));
        for i in 0..3 {
            null[i] = other[i].where_or(longer, null[i]);
        }
    }
    null
}

/// Whether all five matches of the samples are on the same side of their epipoles.
#[inline(always)]
fn agree_in_orientation<V: Lanes>(e: &Matrix<V>, points: &[V; 20], places: V::Places) -> V::Mask {
    let epipole = null_vector(&[[e[0], e[3], e[6]], [e[1], e[4], e[7]], [e[2], e[5], e[8]]]);
    let mut agree = V::Mask::all();
    let mut first = V::Mask::none();
    for k in 0..5 {
        let (a, b) = (2 * k, 10 + 2 * k);
        let a = [points[a].taken(places), points[a + 1].taken(places)];
        let b = [
            points[b].taken(places),
            points[b + 1].taken(places),
            V::all(1.0),
        ];
        let side = cross(&epipole, &b);
        let mut line = [V::zero(); 3];
        for i in 0..3 {
            line[i] = e[3 * i] * a[0] + e[3 * i + 1] * a[1] + e[3 * i + 2];
        }
        let factor = side[0] * line[0] + side[1] * line[1] + side[2] * line[2];
        let sign = factor.above(V::zero());
        if k == 0 {
            first = sign;
        }
        agree = agree.and_not(sign.differs(first));
    }
    agree
}

/// The solution of positive definite equations, of which the lower triangle is given, and where they are that.
#[inline(always)]
fn solve<V: Lanes>(m: &mut [[V; 4]; 4], mut b: [V; 4]) -> ([V; 4], V::Mask) {
    let mut definite = V::Mask::all();
    for j in 0..4 {
        for k in 0..j {
            let factor = m[j][k];
            for i in j..4 {
                m[i][j] = m[i][j] - factor * m[i][k];
            }
        }
        definite = definite.and(m[j][j].above(V::zero()));
        m[j][j] = m[j][j].sqrt();
        for i in j + 1..4 {
            m[i][j] = m[i][j] / m[j][j];
        }
    }
    for i in 0..4 {
        b[i] = b[i] / m[i][i];
        for j in i + 1..4 {
            b[j] = b[j] - b[i] * m[j][i];
        }
    }
    for i in (0..4).rev() {
        let mut sum = V::zero();
        for j in i + 1..4 {
            sum = sum + m[j][i] * b[j];
        }
        b[i] = (b[i] - sum) / m[i][i];
    }
    (b, definite)
}

/// The bases of the samples in these lanes.
#[inline(always)]
fn basis_of<V: Lanes>(reduced: &Reduced<V>, places: V::Places) -> [Matrix<V>; 4] {
    let mut basis = reduced.basis;
    for x in basis.as_flattened_mut() {
        *x = x.taken(places);
    }
    basis
}

/// `x X + y Y + z Z + w W`.
#[inline(always)]
fn combine<V: Lanes>(basis: &[Matrix<V>; 4], at: &[V; 4]) -> Matrix<V> {
    let mut e = [V::zero(); 9];
    for k in 0..4 {
        for i in 0..9 {
            e[i] = e[i] + basis[k][i] * at[k];
        }
    }
    e
}

#[inline(always)]
fn unit<V: Lanes>(v: [V; 4]) -> [V; 4] {
    let norm = ((v[0] * v[0] + v[2] * v[2]) + (v[1] * v[1] + v[3] * v[3])).sqrt();
    [v[0] / norm, v[1] / norm, v[2] / norm, v[3] / norm]
}

#[inline(always)]
fn cross<V: Lanes>(a: &[V; 3], b: &[V; 3]) -> [V; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
fn squared<V: Lanes>(v: &[V; 3]) -> V {
    v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
}

#[inline(always)]
fn transpose<V: Lanes>(m: &Matrix<V>) -> Matrix<V> {
    [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]]
}

#[inline(always)]
fn times<V: Lanes>(a: &Matrix<V>, b: &Matrix<V>) -> Matrix<V> {
    let mut product = [V::zero(); 9];
    for i in 0..3 {
        for j in 0..3 {
            product[3 * i + j] =
                a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
        }
    }
    product
}

/// The sum of products of entries, column after column.
#[inline(always)]
fn dot<V: Lanes>(a: &Matrix<V>, b: &Matrix<V>) -> V {
    let mut sum = V::zero();
    for j in 0..3 {
        for i in 0..3 {
            sum = sum + a[3 * i + j] * b[3 * i + j];
        }
    }
    sum
}

/// The sum over columns of their squared lengths.
#[inline(always)]
fn norm_squared<V: Lanes>(m: &Matrix<V>) -> V {
    let mut sum = V::zero();
    for j in 0..3 {
        sum = sum + (m[j] * m[j] + m[3 + j] * m[3 + j] + m[6 + j] * m[6 + j]);
    }
    sum
}
