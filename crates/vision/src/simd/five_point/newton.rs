//! Newton's method in intervals with one root each, eight or sixteen at a time.

use super::N;
use super::found::Found;
use super::isolation::Brackets;
use crate::simd::lanes::{LANES, Lanes, Mask, places_of};

/// Newton's method alone is given so many steps; then every other one halves the bracket.
const NEWTON_STEPS: usize = 50;
/// Enough halves for a root of any size that a number can have.
const MAX_STEPS: usize = 2200;

/// Finds the roots in the brackets from `first` on and returns how many it takes: each step waits for the one before, so
/// it takes `G` times eight at once.
#[inline(always)]
pub(super) fn find_roots<V: Lanes, const G: usize>(
    brackets: &Brackets,
    first: usize,
    c: &[V; N],
    found: &mut Found,
) -> usize {
    let mut newton = [Newton::new(brackets.eight(first), c); G];
    for (i, newton) in newton.iter_mut().enumerate().skip(1) {
        *newton = Newton::new(brackets.eight(first + LANES * i), c);
    }
    for step in 0..MAX_STEPS {
        let mut going = V::Mask::none();
        for newton in &mut newton {
            newton.step(step >= NEWTON_STEPS && step % 2 == 0);
            going = going.or(newton.going);
        }
        if !going.any() {
            break;
        }
    }
    for (i, newton) in newton.iter().enumerate() {
        let ([low, high, _, polynomial], are_there) = brackets.eight::<V>(first + LANES * i);
        // Not from one of its ends, which can be a root too.
        let s = V::all(0.5) * (low + high);
        found.push_where(are_there, polynomial, s, newton.z());
    }
    LANES * G
}

/// Newton's method in eight brackets that shrink.
#[derive(Clone, Copy)]
struct Newton<V: Lanes> {
    /// Coefficients, highest power first. Beyond s = 1/2, 1 / z is the root of the polynomial with the coefficients in reverse
    /// order.
    c: [V; N],
    /// Where z is the root, not 1 / z.
    small: V::Mask,
    falling: V::Mask,
    low: V,
    high: V,
    x: V,
    going: V::Mask,
}

impl<V: Lanes> Newton<V> {
    #[inline(always)]
    fn new(([from, to, sign, polynomial], going): ([V; 4], V::Mask), of_each: &[V; N]) -> Self {
        let small = V::all(0.5).at_least(to);
        let places = places_of(polynomial);
        let mirrored = polynomial.at_least(V::all(LANES as f64));
        let mut rising_powers = *of_each;
        for (i, c) in rising_powers.iter_mut().enumerate() {
            *c = c.taken(places);
            if i % 2 == 1 {
                *c = (-*c).where_or(mirrored, *c);
            }
        }
        let mut c = rising_powers;
        for (i, c) in c.iter_mut().enumerate() {
            *c = rising_powers[N - 1 - i].where_or(small, *c);
        }
        let one = V::all(1.0);
        let low = from.where_or(small, one - to) / (one - from).where_or(small, to);
        let high = to.where_or(small, one - from) / (one - to).where_or(small, from);
        Self {
            c,
            small,
            falling: sign.above(V::zero()).differs(small),
            low,
            high,
            x: V::all(0.5) * (low + high),
            going,
        }
    }

    #[inline(always)]
    fn step(&mut self, halves: bool) {
        let x = self.x;
        let (mut value, mut slope) = (V::zero(), V::zero());
        for &c in &self.c {
            slope = slope * x + value;
            value = value * x + c;
        }
        let from_low = V::zero().above(value).differs(self.falling);
        self.low = x.where_or(self.going.and(from_low), self.low);
        self.high = x.where_or(self.going.and_not(from_low), self.high);
        let next = x - value / slope;
        // No number is not inside either.
        let inside = next.at_least(self.low).and(self.high.at_least(next));
        let middle = V::all(0.5) * (self.low + self.high);
        let next = if halves {
            middle
        } else {
            next.where_or(inside, middle)
        };
        let moved = (next - x).abs();
        self.x = next.where_or(self.going, x);
        // Convergence is quadratic: the error left is about the square of the step.
        let arrived = (V::all(1e-10) * self.x.abs()).at_least(moved);
        self.going = self.going.and_not(arrived);
    }

    #[inline(always)]
    fn z(&self) -> V {
        self.x.where_or(self.small, V::all(1.0) / self.x)
    }
}
