//! Eight numbers side by side.
//!
//! Code that is written with [`Lanes`] is the portable code of eight like tasks at once: every operation acts on each
//! of the numbers, with the same rounding in each instruction set.
//!
//! *Benefit*: in long computations on many small arrays, the compiler does not find the eight tasks by itself, or
//! vectorises the wrong loop and gathers number by number.
//! *Correctness*: the unsafe operations are instructions of the set that the type is named after. Such a type is only
//! used in functions that are called where the set is [in use](super::InstructionSet::in_use).

/// The operators of a type. A text, not a function of two: the compiler leaves some of those without the instructions of
/// their caller.
macro_rules! operators {
    ($type:ty, |$x:ident, $y:ident| $($name:ident $method:ident $of:expr),*; $neg:expr) => {
        $(impl $name for $type {
            type Output = Self;

            #[inline(always)]
            fn $method(self, $y: Self) -> Self {
                let $x = self;
                $of
            }
        })*
        impl Neg for $type {
            type Output = Self;

            #[inline(always)]
            fn neg(self) -> Self {
                let $x = self;
                $neg
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod pool;
mod portable;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub use avx512::Avx512;
pub use pool::Pool;
pub use portable::Portable;

use std::ops::{Add, Div, Mul, Neg, Sub};

/// How many there are.
pub const LANES: usize = 8;

/// Eight numbers, one for each of as many tasks.
pub trait Lanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// For each of the tasks: yes or no.
    type Mask: Mask;

    /// For each of the tasks one of the lanes.
    type Places: Copy;

    fn new(values: [f64; LANES]) -> Self;

    fn values(self) -> [f64; LANES];

    fn sqrt(self) -> Self;

    fn abs(self) -> Self;

    fn copysign(self, sign: Self) -> Self;

    /// Where this is larger; no where either is no number.
    fn above(self, other: Self) -> Self::Mask;

    /// Where this is larger or both are equal; no where either is no number.
    fn at_least(self, other: Self) -> Self::Mask;

    /// This where the mask says yes, else the other.
    fn where_or(self, mask: Self::Mask, other: Self) -> Self;

    /// These lanes, each below [`LANES`].
    fn places(lanes: [u64; LANES]) -> Self::Places;

    /// For each task the number in its place.
    fn taken(self, places: Self::Places) -> Self;

    /// Writes the numbers where the mask says yes one after another, and any numbers behind them.
    fn pack(self, mask: Self::Mask, to: &mut [f64; LANES]);

    #[inline(always)]
    fn all(value: f64) -> Self {
        Self::new([value; LANES])
    }

    #[inline(always)]
    fn zero() -> Self {
        Self::all(0.0)
    }
}

/// The numbers of each. Not by `map`, which the compiler may leave without the instructions of its caller.
#[inline(always)]
pub fn values_of<V: Lanes, const N: usize>(lanes: &[V; N]) -> [[f64; LANES]; N] {
    let mut values = [[0.0; LANES]; N];
    for (values, lanes) in values.iter_mut().zip(lanes) {
        *values = lanes.values();
    }
    values
}

/// Lanes of these numbers.
#[inline(always)]
pub fn lanes_of<V: Lanes, const N: usize>(values: &[[f64; LANES]; N]) -> [V; N] {
    let mut lanes = [V::zero(); N];
    for (lanes, values) in lanes.iter_mut().zip(values) {
        *lanes = V::new(*values);
    }
    lanes
}

/// The places of these numbers, which are whole: for each its remainder modulo [`LANES`].
#[inline(always)]
pub fn places_of<V: Lanes>(numbers: V) -> V::Places {
    let mut places = [0; LANES];
    for (place, number) in places.iter_mut().zip(numbers.values()) {
        *place = number as u64 % LANES as u64;
    }
    V::places(places)
}

/// Eight answers.
pub trait Mask: Copy {
    /// Yes of those whose bit is set.
    fn from_bits(bits: u8) -> Self;

    fn bits(self) -> u8;

    fn and(self, other: Self) -> Self;

    fn or(self, other: Self) -> Self;

    fn and_not(self, other: Self) -> Self;

    fn differs(self, other: Self) -> Self;

    #[inline(always)]
    fn first(count: usize) -> Self {
        Self::from_bits(((1_u32 << count) - 1) as u8)
    }

    #[inline(always)]
    fn all() -> Self {
        Self::from_bits(u8::MAX)
    }

    #[inline(always)]
    fn none() -> Self {
        Self::from_bits(0)
    }

    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }

    #[inline(always)]
    fn at(self, lane: usize) -> bool {
        self.bits() >> lane & 1 == 1
    }

    #[inline(always)]
    fn count(self) -> usize {
        self.bits().count_ones() as usize
    }
}
