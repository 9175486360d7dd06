//! Intervals with one root each of eight polynomials, by Descartes' rule of signs.
//!
//! [`crate::geometry::solvers::real_roots`] says how. Intervals that are to be halved wait until up to eight of them are taken
//! together, the last ones first.

use super::found::{Found, numbered};
use super::{N, ROOM};
use crate::simd::lanes::{LANES, Lanes, Mask, Pool};

/// Intervals are halved at most 32 times, to this width: two roots closer than this (in s) count as one.
const LEAST_WIDTH: f64 = 1.0 / (1_u64 << 32) as f64;
/// Intervals that wait, at most, and eight more. A polynomial and its mirror image have at most ten changes of sign together,
/// none is gained by halving, and what has only one waits in the beginning alone: so there are no more than five of each.
const WAITING: usize = 6 * LANES;

/// Bernstein coefficients of polynomials in `low < s < low + width`; then `low`, `width` and the polynomial: of the eight,
/// then of the eight p(-z).
type Intervals = Pool<{ N + 3 }, WAITING>;

/// Intervals with one root: `low` and `high`, the sign that the polynomial has before `high`, and the polynomial.
pub(super) type Brackets = Pool<4, ROOM>;

/// Adds intervals with one root each; a root that is met on the way is found.
#[inline(always)]
pub(super) fn isolate<V: Lanes>(c: &[V; N], brackets: &mut Brackets, found: &mut Found) {
    let mut waiting = Intervals::new();
    let mut bernstein = *c;
    let mut binomial = 1.0;
    for (i, b) in bernstein.iter_mut().enumerate() {
        *b = *b / V::all(binomial);
        binomial *= (N - 1 - i) as f64 / (i + 1) as f64;
    }
    for side in 0..2 {
        let changes = sign_changes(&bernstein);
        let polynomial = numbered(LANES * side);
        let whole = interval(&bernstein, V::zero(), V::all(1.0), polynomial);
        waiting.push(changes.any, &whole);
        for b in bernstein.iter_mut().skip(1).step_by(2) {
            *b = -*b;
        }
    }
    while waiting.len() > 0 {
        let (some, taken) = waiting.pop::<V>();
        halve_intervals(&some, taken, &mut waiting, brackets, found);
    }
}

/// Halves intervals and sorts the halves: those with a root, those where there may be more, and the others, which are dropped.
#[inline(always)]
fn halve_intervals<V: Lanes>(
    intervals: &[V; N + 3],
    taken: V::Mask,
    waiting: &mut Intervals,
    brackets: &mut Brackets,
    found: &mut Found,
) {
    let mut right = *intervals
        .first_chunk()
        .expect("the coefficients come first");
    let [.., low, width, polynomial] = *intervals;
    let left = halve(&mut right);
    let half = V::all(0.5) * width;
    let middle = low + half;
    let met = taken.and(V::zero().at_least(right[0].abs()));
    found.push_where(met, polynomial, middle, half_line(middle));
    let is_last = V::all(LEAST_WIDTH).at_least(half);
    for (part, low) in [(&left, low), (&right, middle)] {
        let changes = sign_changes(part);
        let some = taken.and(changes.any);
        let ended = some.and(is_last);
        let s = low + V::all(0.5) * half;
        found.push_where(ended, polynomial, s, half_line(s));
        let some = some.and_not(is_last);
        let more = some.and(changes.several);
        let high = low + half;
        let sign = V::all(1.0).where_or(changes.ends_above, V::all(-1.0));
        brackets.push(some.and_not(more), &[low, high, sign, polynomial]);
        waiting.push(more, &interval(part, low, half, polynomial));
    }
}

#[inline(always)]
fn interval<V: Lanes>(bernstein: &[V; N], low: V, width: V, polynomial: V) -> [V; N + 3] {
    let mut interval = [low; N + 3];
    interval[..N].copy_from_slice(bernstein);
    interval[N + 1] = width;
    interval[N + 2] = polynomial;
    interval
}

/// z of s.
#[inline(always)]
fn half_line<V: Lanes>(s: V) -> V {
    s / (V::all(1.0) - s)
}

/// Changes of sign in a list of numbers, of which those that are 0 do not count.
struct SignChanges<M> {
    /// Where there is one or more.
    any: M,
    /// Where there are two or more.
    several: M,
    /// Where the last number is positive.
    ends_above: M,
}

#[inline(always)]
fn sign_changes<V: Lanes>(values: &[V; N]) -> SignChanges<V::Mask> {
    let (mut any, mut several) = (V::Mask::none(), V::Mask::none());
    let (mut was_above, mut was_below) = (V::Mask::none(), V::Mask::none());
    for &value in values {
        let above = value.above(V::zero());
        let below = V::zero().above(value);
        let change = above.and(was_below).or(below.and(was_above));
        several = several.or(any.and(change));
        any = any.or(change);
        was_above = above.or(was_above.and_not(below));
        was_below = below.or(was_below.and_not(above));
    }
    SignChanges {
        any,
        several,
        ends_above: was_above,
    }
}

/// Bernstein coefficients of the left halves; the right ones take the place of the whole (de Casteljau).
#[inline(always)]
fn halve<V: Lanes>(right: &mut [V; N]) -> [V; N] {
    let mut left = [V::zero(); N];
    for level in 0..N {
        left[level] = right[0];
        for i in 0..N - 1 - level {
            right[i] = V::all(0.5) * (right[i] + right[i + 1]);
        }
    }
    left
}
