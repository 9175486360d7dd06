//! Eight numbers in an array: the definition.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{LANES, Lanes, Mask};

/// Answers for eight numbers in an array, all bits of each or none.
#[derive(Clone, Copy, Debug)]
pub struct PortableMask([u64; LANES]);

impl PortableMask {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self(std::array::from_fn(|lane| f(self.0[lane], other.0[lane])))
    }
}

impl Mask for PortableMask {
    #[inline(always)]
    fn from_bits(bits: u8) -> Self {
        Self(std::array::from_fn(|lane| {
            u64::from(bits >> lane & 1).wrapping_neg()
        }))
    }

    #[inline(always)]
    fn bits(self) -> u8 {
        (0..LANES).fold(0, |bits, lane| bits | (self.0[lane] & 1 << lane) as u8)
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.with(other, |x, y| x & y)
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.with(other, |x, y| x | y)
    }

    #[inline(always)]
    fn and_not(self, other: Self) -> Self {
        self.with(other, |x, y| x & !y)
    }

    #[inline(always)]
    fn differs(self, other: Self) -> Self {
        self.with(other, |x, y| x ^ y)
    }
}

/// Eight numbers in an array: the definition.
#[derive(Clone, Copy, Debug)]
pub struct Portable([f64; LANES]);

impl Portable {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|lane| f(self.0[lane], other.0[lane])))
    }

    #[inline(always)]
    fn compare(self, other: Self, f: impl Fn(f64, f64) -> bool) -> PortableMask {
        PortableMask(std::array::from_fn(|lane| {
            u64::from(f(self.0[lane], other.0[lane])).wrapping_neg()
        }))
    }
}

impl Lanes for Portable {
    type Mask = PortableMask;
    type Places = [u64; LANES];

    #[inline(always)]
    fn new(values: [f64; LANES]) -> Self {
        Self(values)
    }

    #[inline(always)]
    fn values(self) -> [f64; LANES] {
        self.0
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.with(sign, f64::copysign)
    }

    #[inline(always)]
    fn above(self, other: Self) -> PortableMask {
        self.compare(other, |x, y| x > y)
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> PortableMask {
        self.compare(other, |x, y| x >= y)
    }

    #[inline(always)]
    fn where_or(self, mask: PortableMask, other: Self) -> Self {
        Self(std::array::from_fn(|lane| {
            let (this, other) = (self.0[lane].to_bits(), other.0[lane].to_bits());
            f64::from_bits(this & mask.0[lane] | other & !mask.0[lane])
        }))
    }

    #[inline(always)]
    fn places(lanes: [u64; LANES]) -> [u64; LANES] {
        lanes
    }

    #[inline(always)]
    fn taken(self, places: [u64; LANES]) -> Self {
        Self(places.map(|lane| self.0[lane as usize % LANES]))
    }

    #[inline(always)]
    fn pack(self, mask: PortableMask, to: &mut [f64; LANES]) {
        let mut next = 0;
        for lane in 0..LANES {
            to[next] = self.0[lane];
            next += usize::from(mask.0[lane] != 0);
        }
    }
}

operators!(
    Portable,
    |x, y| Add add x.with(y, f64::add),
    Sub sub x.with(y, f64::sub),
    Mul mul x.with(y, f64::mul),
    Div div x.with(y, f64::div);
    Self(x.0.map(f64::neg))
);
