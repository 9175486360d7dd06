//! All real roots of eight polynomials of degree 10.
//!
//! The method is [`crate::geometry::solvers::real_roots`], step for step. Intervals that are to be halved are put
//! together eight at a time, and so are the intervals in which Newton's method is started.

use super::MODELS;
use crate::simd::lanes::{LANES, Lanes, Mask, lanes_of, values_of};

/// Coefficients of a polynomial.
const N: usize = 11;
/// Intervals are halved at most this often: two roots closer than `2^-32` (in s) count as one.
const MAX_DEPTH: u32 = 32;
/// Newton's method alone is given so many steps; then every other one halves the bracket.
const NEWTON_STEPS: usize = 50;
/// Enough halves for a root of any size that a number can have.
const MAX_STEPS: usize = 2200;
/// Intervals that wait: of each polynomial and its mirror image at most six, since both have at most ten changes of sign
/// together, none is gained by halving, and what has only one does not wait but in the beginning.
const WAITING: usize = 8 * LANES;

/// A root of one of the polynomials.
#[derive(Clone, Copy)]
pub(super) struct Root {
    pub(super) sample: u32,
    /// Positive roots come first, in the order of s; then negative ones, then 0.
    order: f64,
    pub(super) z: f64,
}

impl Root {
    pub(super) const NONE: Self = Self {
        sample: 0,
        order: 0.0,
        z: 0.0,
    };
}

/// Bernstein coefficients of a polynomial in `low < s < low + width`.
#[derive(Clone, Copy)]
struct Interval {
    bernstein: [f64; N],
    low: f64,
    width: f64,
    depth: u32,
    /// Of the eight polynomials, then of the eight p(-z).
    polynomial: u32,
}

impl Interval {
    const NONE: Self = Self {
        bernstein: [0.0; N],
        low: 0.0,
        width: 0.0,
        depth: 0,
        polynomial: 0,
    };
}

/// An interval with one root.
#[derive(Clone, Copy)]
struct Bracket {
    low: f64,
    high: f64,
    rising: bool,
    polynomial: u32,
}

impl Bracket {
    const NONE: Self = Self {
        low: 0.0,
        high: 0.0,
        rising: false,
        polynomial: 0,
    };
}

/// Writes the roots of polynomials, lowest power first, those of one after those of the one before, and
/// returns how many there are. One that is zero or not finite has none.
#[inline(always)]
pub(super) fn roots_of_eight<V: Lanes>(polynomials: &[V; N], roots: &mut [Root; MODELS]) -> usize {
    let c = scaled(polynomials);
    // Polynomials in turn, as Newton's method takes them.
    let mut each = [[0.0; N]; 2 * LANES];
    for (i, c) in c.iter().enumerate() {
        for (lane, c) in c.values().into_iter().enumerate() {
            each[lane][i] = c;
            each[LANES + lane][i] = if i % 2 == 1 { -c } else { c };
        }
    }
    let mut brackets = [Bracket::NONE; MODELS];
    let mut found = Found { roots, count: 0 };
    let bracketed = isolate(&c, &mut brackets, &mut found);
    for some in brackets[..bracketed].chunks(LANES) {
        let z = newton::<V>(some, &each);
        for (bracket, z) in some.iter().zip(z) {
            found.push(bracket.polynomial, bracket.low, z);
        }
    }
    for (lane, c) in each[..LANES].iter().enumerate() {
        if c[0] == 0.0 && c[1..].iter().any(|&c| c != 0.0) {
            found.push(lane as u32, f64::INFINITY, 0.0);
        }
    }
    found.sorted()
}

/// Writes intervals with one root each and returns how many; a root that is met on the way is found.
#[inline(always)]
fn isolate<V: Lanes>(c: &[V; N], brackets: &mut [Bracket; MODELS], found: &mut Found<'_>) -> usize {
    let mut waiting = [Interval::NONE; WAITING];
    let mut count = 0;
    let mut bracketed = 0;
    for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
        let mut bernstein = *c;
        let mut binomial = 1.0;
        for (i, b) in bernstein.iter_mut().enumerate() {
            let sign = if i % 2 == 1 { sign } else { 1.0 };
            *b = *b * V::all(sign) / V::all(binomial);
            binomial *= (N - 1 - i) as f64 / (i + 1) as f64;
        }
        let changes = sign_changes(&bernstein);
        let bernstein = values_of(&bernstein);
        for lane in 0..LANES {
            if changes[lane] > 0.0 {
                let interval = &mut waiting[count];
                interval.bernstein = of_lane(&bernstein, lane);
                interval.width = 1.0;
                interval.polynomial = (LANES * side + lane) as u32;
                count += 1;
            }
        }
    }
    while count > 0 {
        let taken = count.min(LANES);
        count -= taken;
        let mut some = [Interval::NONE; LANES];
        some[..taken].copy_from_slice(&waiting[count..count + taken]);
        let mut right = [V::zero(); N];
        for (i, right) in right.iter_mut().enumerate() {
            let mut values = [0.0; LANES];
            for lane in 0..LANES {
                values[lane] = some[lane].bernstein[i];
            }
            *right = V::new(values);
        }
        let left = halve(&mut right);
        let changes = [sign_changes(&left), sign_changes(&right)];
        let halves = [values_of(&left), values_of(&right)];
        for (lane, interval) in some[..taken].iter().enumerate() {
            let (half, depth) = (interval.width / 2.0, interval.depth + 1);
            let polynomial = interval.polynomial;
            let middle = interval.low + half;
            if halves[1][0][lane] == 0.0 {
                found.push(polynomial, middle, middle / (1.0 - middle));
            }
            for (part, low) in [(0, interval.low), (1, middle)] {
                let changes = changes[part][lane];
                if changes == 0.0 {
                    continue;
                }
                if depth == MAX_DEPTH {
                    let s = low + half / 2.0;
                    found.push(polynomial, s, s / (1.0 - s));
                } else if changes == 1.0 {
                    if bracketed < MODELS {
                        let bernstein = of_lane(&halves[part], lane);
                        let first = bernstein.iter().find(|&&b| b != 0.0);
                        brackets[bracketed] = Bracket {
                            low,
                            high: low + half,
                            rising: first.is_some_and(|&b| b < 0.0),
                            polynomial,
                        };
                        bracketed += 1;
                    }
                } else if count < WAITING {
                    waiting[count] = Interval {
                        bernstein: of_lane(&halves[part], lane),
                        low,
                        width: half,
                        depth,
                        polynomial,
                    };
                    count += 1;
                }
            }
        }
    }
    bracketed
}

struct Found<'a> {
    roots: &'a mut [Root; MODELS],
    count: usize,
}

impl Found<'_> {
    #[inline(always)]
    fn push(&mut self, polynomial: u32, s: f64, z: f64) {
        if self.count < MODELS {
            let negative = polynomial >= LANES as u32;
            self.roots[self.count] = Root {
                sample: polynomial % LANES as u32,
                order: if negative { 1.0 + s } else { s },
                z: if negative { -z } else { z },
            };
            self.count += 1;
        }
    }

    #[inline(always)]
    fn sorted(self) -> usize {
        let roots = &mut self.roots[..self.count];
        for i in 1..roots.len() {
            let mut at = i;
            let root = roots[i];
            while at > 0 && (root.sample, root.order) < (roots[at - 1].sample, roots[at - 1].order)
            {
                roots[at] = roots[at - 1];
                at -= 1;
            }
            roots[at] = root;
        }
        self.count
    }
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

#[inline(always)]
fn of_lane(values: &[[f64; LANES]; N], lane: usize) -> [f64; N] {
    let mut one = [0.0; N];
    for i in 0..N {
        one[i] = values[i][lane];
    }
    one
}

#[inline(always)]
fn sign_changes<V: Lanes>(values: &[V; N]) -> [f64; LANES] {
    let mut changes = V::zero();
    // The last value other than 0.
    let mut last = V::zero();
    for &value in values {
        let positive = value.above(V::zero());
        let negative = V::zero().above(value);
        let change = (positive.and(V::zero().above(last))).or(negative.and(last.above(V::zero())));
        changes = (changes + V::all(1.0)).where_or(change, changes);
        last = value.where_or(positive.or(negative), last);
    }
    changes.values()
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

/// The root in each of at most eight brackets.
#[inline(always)]
fn newton<V: Lanes>(brackets: &[Bracket], polynomials: &[[f64; N]; 2 * LANES]) -> [f64; LANES] {
    // Highest power first. Beyond s = 1/2, 1 / z is the root of the polynomial with the coefficients in reverse order.
    let mut coefficients = [[0.0; LANES]; N];
    let (mut lows, mut highs) = ([0.0; LANES], [0.0; LANES]);
    let mut falling = 0;
    for (lane, bracket) in brackets.iter().enumerate() {
        let polynomial = &polynomials[bracket.polynomial as usize];
        let small = bracket.high <= 0.5;
        for i in 0..N {
            coefficients[i][lane] = polynomial[if small { N - 1 - i } else { i }];
        }
        let (from, to) = (bracket.low, bracket.high);
        (lows[lane], highs[lane]) = if small {
            (from / (1.0 - from), to / (1.0 - to))
        } else {
            ((1.0 - to) / to, (1.0 - from) / from)
        };
        falling |= u8::from(bracket.rising != small) << lane;
    }
    let c = lanes_of(&coefficients);
    let (mut low, mut high) = (V::new(lows), V::new(highs));
    let falling = V::Mask::from_bits(falling);
    let mut x = V::all(0.5) * (low + high);
    let mut going = V::Mask::first(brackets.len());
    for step in 0..MAX_STEPS {
        let (mut value, mut slope) = (V::zero(), V::zero());
        for &c in &c {
            slope = slope * x + value;
            value = value * x + c;
        }
        let from_low = V::zero().above(value).differs(falling);
        low = x.where_or(going.and(from_low), low);
        high = x.where_or(going.and_not(from_low), high);
        let next = x - value / slope;
        // No number is not inside either.
        let inside = next.at_least(low).and(high.at_least(next));
        let middle = V::all(0.5) * (low + high);
        let next = if step >= NEWTON_STEPS && step % 2 == 0 {
            middle
        } else {
            next.where_or(inside, middle)
        };
        let moved = (next - x).abs();
        x = next.where_or(going, x);
        // Convergence is quadratic: the error left is about the square of the step.
        going = going.and_not((V::all(1e-10) * x.abs()).at_least(moved));
        if !going.any() {
            break;
        }
    }
    let mut z = x.values();
    for (z, bracket) in z.iter_mut().zip(brackets) {
        if bracket.high > 0.5 {
            *z = 1.0 / *z;
        }
    }
    z
}

/// The roots of each of eight polynomials, lowest power first, by the portable kernel, for tests.
#[cfg(test)]
pub fn roots_of_each(polynomials: &[[f64; N]; LANES]) -> [Vec<f64>; LANES] {
    let mut lanes = [[0.0; LANES]; N];
    for (i, lanes) in lanes.iter_mut().enumerate() {
        *lanes = std::array::from_fn(|lane| polynomials[lane][i]);
    }
    let mut roots = [Root::NONE; MODELS];
    let lanes = lanes_of::<crate::simd::lanes::Portable, N>(&lanes);
    let count = roots_of_eight(&lanes, &mut roots);
    std::array::from_fn(|lane| {
        let of_lane = roots[..count].iter().filter(|r| r.sample == lane as u32);
        of_lane.map(|root| root.z).collect()
    })
}
