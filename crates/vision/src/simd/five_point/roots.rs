//! All real roots of eight polynomials of degree 10.
//!
//! The method is [`crate::geometry::solvers::real_roots`], step for step. Intervals that are to be halved are put
//! together eight at a time ([`isolation`](super::isolation)), and so are the intervals in which Newton's method is started
//! ([`newton`](super::newton)), whichever polynomial they belong to.

use super::N;
use super::found::{Found, Roots, numbered};
use super::isolation::{Brackets, isolate};
use super::newton::find_roots;
#[cfg(test)]
use crate::simd::lanes::lanes_of;
use crate::simd::lanes::{LANES, Lanes, Mask};

/// Above s of all roots and of their mirror images.
const BEHIND_ALL: f64 = 3.0;

/// The roots of polynomials, lowest power first: of each the positive ones in ascending order, then the negative ones in
/// descending order, then 0. A polynomial that is zero or not finite has none.
#[inline(always)]
pub(super) fn roots_of_eight<V: Lanes>(polynomials: &[V; N]) -> Roots {
    let c = scaled(polynomials);
    let mut found = Found::none();
    let mut brackets = Brackets::new();
    isolate(&c, &mut brackets, &mut found);
    let mut first = 0;
    while first < brackets.len() {
        first += if first + LANES < brackets.len() {
            find_roots::<V, 2>(&brackets, first, &c, &mut found)
        } else {
            find_roots::<V, 1>(&brackets, first, &c, &mut found)
        };
    }
    let mut is_zero = V::Mask::all();
    for c in &c[1..] {
        is_zero = is_zero.and(V::zero().at_least(c.abs()));
    }
    let has_root_0 = V::zero().at_least(c[0].abs()).and_not(is_zero);
    found.push_where(has_root_0, numbered(0), V::all(BEHIND_ALL), V::zero());
    found.sorted::<V>()
}

/// Polynomials with coefficients of at most 1; 0 where they are not finite.
#[inline(always)]
fn scaled<V: Lanes>(polynomials: &[V; N]) -> [V; N] {
    let mut scale = V::zero();
    let mut finite = V::Mask::all();
    for c in polynomials {
        let size = c.abs();
        scale = size.where_or(size.above(scale), scale);
        finite = finite.and(V::all(f64::INFINITY).above(size));
    }
    let usable = finite.and(scale.above(V::zero()));
    let mut c = *polynomials;
    for c in &mut c {
        *c = (*c / scale).where_or(usable, V::zero());
    }
    c
}

/// The roots of each of eight polynomials, lowest power first, by the portable kernel, for tests.
#[cfg(test)]
pub fn roots_of_each(polynomials: &[[f64; N]; LANES]) -> [Vec<f64>; LANES] {
    use crate::simd::lanes::Portable;

    let mut lanes = [[0.0; LANES]; N];
    for (i, lanes) in lanes.iter_mut().enumerate() {
        *lanes = std::array::from_fn(|lane| polynomials[lane][i]);
    }
    let lanes = lanes_of::<Portable, N>(&lanes);
    let roots = roots_of_eight(&lanes);
    let mut of_each = [const { Vec::new() }; LANES];
    for i in 0..roots.len() {
        let [z, sample] = roots.one(i);
        of_each[sample as usize].push(z);
    }
    of_each
}
