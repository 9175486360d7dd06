//! All real roots of eight polynomials of degree 10.
//!
//! The method is [`crate::geometry::solvers::real_roots`], step for step. Intervals that are to be halved are put
//! together eight at a time ([`isolation`](super::isolation)), and so are the intervals in which Newton's method is started
//! ([`newton`](super::newton)), whichever polynomial they belong to.

use super::isolation::isolate;
use super::newton::find_roots;
use super::{MODELS, ROOM};
use crate::simd::lanes::{LANES, Lanes, Mask, Pool, lanes_of};

/// Coefficients of a polynomial, which has as many roots as there are models.
pub(super) const N: usize = MODELS + 1;
/// Above s of all roots and of their mirror images.
const BEHIND_ALL: f64 = 3.0;

/// Real roots, then the sample that each belongs to: the first of each sample, then the second.
pub(super) type Roots = Pool<2, ROOM>;

/// Intervals with one root: `low` and `high`, the sign that the polynomial has before `high`, and the polynomial.
pub(super) type Brackets = Pool<4, ROOM>;

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

/// The number of each lane, from `first` on.
#[inline(always)]
pub(super) fn numbered<V: Lanes>(first: usize) -> V {
    let mut numbers = [0.0; LANES];
    for lane in 0..LANES {
        numbers[lane] = (first + lane) as f64;
    }
    V::new(numbers)
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

/// Roots of each of the eight polynomials.
pub(super) struct Found {
    /// s of the first of each, then of the second; 1 more if z is negative.
    orders: [[f64; LANES]; MODELS],
    z: [[f64; LANES]; MODELS],
    counts: [usize; LANES],
}

impl Found {
    #[inline(always)]
    fn none() -> Self {
        Self {
            orders: [[f64::INFINITY; LANES]; MODELS],
            z: [[0.0; LANES]; MODELS],
            counts: [0; LANES],
        }
    }

    /// Adds the roots where the mask says yes.
    #[inline(always)]
    pub(super) fn push_where<V: Lanes>(&mut self, mask: V::Mask, polynomial: V, s: V, z: V) {
        if !mask.any() {
            return;
        }
        let (polynomial, s, z) = (polynomial.values(), s.values(), z.values());
        for lane in 0..LANES {
            if mask.at(lane) {
                self.push(polynomial[lane] as usize, s[lane], z[lane]);
            }
        }
    }

    #[inline(always)]
    fn push(&mut self, polynomial: usize, s: f64, z: f64) {
        let lane = polynomial % LANES;
        let at = self.counts[lane];
        // Rounding could invent roots beyond the degree, in pathological polynomials only.
        if at < MODELS {
            let negative = polynomial >= LANES;
            self.orders[at][lane] = if negative { 1.0 + s } else { s };
            self.z[at][lane] = if negative { -z } else { z };
            self.counts[lane] += 1;
        }
    }

    /// All roots, those of each polynomial in order.
    #[inline(always)]
    fn sorted<V: Lanes>(&self) -> Roots {
        let mut orders: [V; MODELS] = lanes_of(&self.orders);
        let mut z: [V; MODELS] = lanes_of(&self.z);
        for [i, j] in SORTING_NETWORK {
            let swapped = orders[i].above(orders[j]);
            for numbers in [&mut orders, &mut z] {
                let (a, b) = (numbers[i], numbers[j]);
                numbers[i] = b.where_or(swapped, a);
                numbers[j] = a.where_or(swapped, b);
            }
        }
        let mut roots = Roots::new();
        for (order, z) in orders.into_iter().zip(z) {
            roots.push(V::all(f64::INFINITY).above(order), &[z, numbered(0)]);
        }
        roots
    }
}

/// Pairs of places that sort ten numbers if they are put in order one pair after another. Knuth, "The Art of Computer
/// Programming" 3, sec. 5.3.4.
#[rustfmt::skip]
const SORTING_NETWORK: [[usize; 2]; 29] = [
    [4, 9], [3, 8], [2, 7], [1, 6], [0, 5], [1, 4], [6, 9], [0, 3], [5, 8], [0, 2],
    [3, 6], [7, 9], [0, 1], [2, 4], [5, 7], [8, 9], [1, 2], [4, 6], [7, 8], [3, 5],
    [2, 5], [6, 8], [1, 3], [4, 7], [2, 3], [6, 7], [3, 4], [5, 6], [4, 5],
];

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

#[cfg(test)]
mod tests {
    use super::*;

    /// What sorts all lists of zeros and ones sorts all numbers.
    #[test]
    fn the_network_sorts() {
        for bits in 0..1_u32 << MODELS {
            let mut numbers: [u32; MODELS] = std::array::from_fn(|i| bits >> i & 1);
            for [i, j] in SORTING_NETWORK {
                if numbers[i] > numbers[j] {
                    numbers.swap(i, j);
                }
            }
            assert!(numbers.is_sorted(), "{bits:b}");
        }
    }
}
