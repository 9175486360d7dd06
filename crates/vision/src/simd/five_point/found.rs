//! Roots of eight polynomials, and their order.

use super::{MODELS, ROOM};
use crate::simd::lanes::{LANES, Lanes, Mask, Pool, lanes_of};

/// Real roots, then the sample that each belongs to: the first of each sample, then the second.
pub(super) type Roots = Pool<2, ROOM>;

/// The number of each lane, from `first` on.
#[inline(always)]
pub(super) fn numbered<V: Lanes>(first: usize) -> V {
    let mut numbers = [0.0; LANES];
    for lane in 0..LANES {
        numbers[lane] = (first + lane) as f64;
    }
    V::new(numbers)
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
    pub(super) fn none() -> Self {
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
    pub(super) fn sorted<V: Lanes>(&self) -> Roots {
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
