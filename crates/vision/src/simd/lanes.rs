//! Eight numbers side by side.
//!
//! Code that is written with [`Lanes`] is the portable code of eight like tasks at once: every operation acts on each
//! of the numbers, with the same rounding in each instruction set.
//!
//! *Benefit*: in long computations on many small arrays, the compiler does not find the eight tasks by itself, or
//! vectorises the wrong loop and gathers number by number.
//! *Correctness*: the unsafe operations are instructions of the set that the type is named after. Such a type is only
//! used in functions that are called where the set is [in use](super::InstructionSet::in_use).

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
}

impl Mask for u8 {
    #[inline(always)]
    fn from_bits(bits: u8) -> Self {
        bits
    }

    #[inline(always)]
    fn bits(self) -> u8 {
        self
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self & other
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self | other
    }

    #[inline(always)]
    fn and_not(self, other: Self) -> Self {
        self & !other
    }

    #[inline(always)]
    fn differs(self, other: Self) -> Self {
        self ^ other
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
    fn compare(self, other: Self, f: impl Fn(f64, f64) -> bool) -> u8 {
        (0..LANES).fold(0, |bits, lane| {
            bits | u8::from(f(self.0[lane], other.0[lane])) << lane
        })
    }
}

impl Lanes for Portable {
    type Mask = u8;

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
    fn above(self, other: Self) -> u8 {
        self.compare(other, |x, y| x > y)
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> u8 {
        self.compare(other, |x, y| x >= y)
    }

    #[inline(always)]
    fn where_or(self, mask: u8, other: Self) -> Self {
        Self(std::array::from_fn(|lane| {
            if mask.at(lane) {
                self.0[lane]
            } else {
                other.0[lane]
            }
        }))
    }
}

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

operators!(
    Portable,
    |x, y| Add add x.with(y, f64::add),
    Sub sub x.with(y, f64::sub),
    Mul mul x.with(y, f64::mul),
    Div div x.with(y, f64::div);
    Self(x.0.map(f64::neg))
);

#[cfg(target_arch = "x86_64")]
pub use wide::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod wide {
    use std::arch::x86_64::{
        __m256d, __m512d, _CMP_GE_OQ, _CMP_GT_OQ, _mm256_add_pd, _mm256_and_pd, _mm256_and_si256,
        _mm256_andnot_pd, _mm256_blendv_pd, _mm256_castsi256_pd, _mm256_cmp_pd, _mm256_cmpeq_epi64,
        _mm256_div_pd, _mm256_loadu_pd, _mm256_movemask_pd, _mm256_mul_pd, _mm256_or_pd,
        _mm256_set_epi64x, _mm256_set1_epi64x, _mm256_set1_pd, _mm256_sqrt_pd, _mm256_storeu_pd,
        _mm256_sub_pd, _mm256_xor_pd, _mm512_abs_pd, _mm512_add_pd, _mm512_and_pd,
        _mm512_andnot_pd, _mm512_cmp_pd_mask, _mm512_div_pd, _mm512_loadu_pd, _mm512_mask_blend_pd,
        _mm512_mul_pd, _mm512_or_pd, _mm512_set1_pd, _mm512_sqrt_pd, _mm512_storeu_pd,
        _mm512_sub_pd, _mm512_xor_pd,
    };
    use std::ops::{Add, Div, Mul, Neg, Sub};

    use super::{LANES, Lanes, Mask};

    /// Eight numbers in one register.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx512(__m512d);

    /// Eight numbers in two registers.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2(__m256d, __m256d);

    /// Answers for eight numbers in two registers, all bits of each or none.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2Mask(__m256d, __m256d);

    // SAFETY, here and below: this type is only used where AVX-512 is in use (see the head of the file).
    impl Lanes for Avx512 {
        type Mask = u8;

        #[inline(always)]
        fn new(values: [f64; LANES]) -> Self {
            // SAFETY: as above; there are eight values.
            Self(unsafe { _mm512_loadu_pd(values.as_ptr()) })
        }

        #[inline(always)]
        fn all(value: f64) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm512_set1_pd(value) })
        }

        #[inline(always)]
        fn values(self) -> [f64; LANES] {
            let mut values = [0.0; LANES];
            // SAFETY: as above; there is space for eight.
            unsafe { _mm512_storeu_pd(values.as_mut_ptr(), self.0) };
            values
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm512_sqrt_pd(self.0) })
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm512_abs_pd(self.0) })
        }

        #[inline(always)]
        fn copysign(self, sign: Self) -> Self {
            // SAFETY: as above.
            unsafe {
                let bit = _mm512_set1_pd(-0.0);
                let sign = _mm512_and_pd(bit, sign.0);
                Self(_mm512_or_pd(sign, _mm512_andnot_pd(bit, self.0)))
            }
        }

        #[inline(always)]
        fn above(self, other: Self) -> u8 {
            // SAFETY: as above.
            unsafe { _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, other.0) }
        }

        #[inline(always)]
        fn at_least(self, other: Self) -> u8 {
            // SAFETY: as above.
            unsafe { _mm512_cmp_pd_mask::<_CMP_GE_OQ>(self.0, other.0) }
        }

        #[inline(always)]
        fn where_or(self, mask: u8, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm512_mask_blend_pd(mask, other.0, self.0) })
        }
    }

    // SAFETY, of each: as above.
    operators!(
        Avx512,
        |x, y| Add add Self(unsafe { _mm512_add_pd(x.0, y.0) }),
        Sub sub Self(unsafe { _mm512_sub_pd(x.0, y.0) }),
        Mul mul Self(unsafe { _mm512_mul_pd(x.0, y.0) }),
        Div div Self(unsafe { _mm512_div_pd(x.0, y.0) });
        Self(unsafe { _mm512_xor_pd(x.0, _mm512_set1_pd(-0.0)) })
    );

    // SAFETY, here and below: this type is only used where AVX2 is in use (see the head of the file).
    impl Lanes for Avx2 {
        type Mask = Avx2Mask;

        #[inline(always)]
        fn new(values: [f64; LANES]) -> Self {
            // SAFETY: as above; there are eight values.
            unsafe {
                let values = values.as_ptr();
                Self(_mm256_loadu_pd(values), _mm256_loadu_pd(values.add(4)))
            }
        }

        #[inline(always)]
        fn all(value: f64) -> Self {
            // SAFETY: as above.
            let value = unsafe { _mm256_set1_pd(value) };
            Self(value, value)
        }

        #[inline(always)]
        fn values(self) -> [f64; LANES] {
            let mut values = [0.0; LANES];
            // SAFETY: as above; there is space for eight.
            unsafe {
                let to = values.as_mut_ptr();
                _mm256_storeu_pd(to, self.0);
                _mm256_storeu_pd(to.add(4), self.1);
            }
            values
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: as above.
            unsafe { Self(_mm256_sqrt_pd(self.0), _mm256_sqrt_pd(self.1)) }
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: as above.
            unsafe {
                let bit = _mm256_set1_pd(-0.0);
                Self(_mm256_andnot_pd(bit, self.0), _mm256_andnot_pd(bit, self.1))
            }
        }

        #[inline(always)]
        fn copysign(self, sign: Self) -> Self {
            // SAFETY: as above.
            unsafe {
                let bit = _mm256_set1_pd(-0.0);
                let with =
                    |x, sign| _mm256_or_pd(_mm256_and_pd(bit, sign), _mm256_andnot_pd(bit, x));
                Self(with(self.0, sign.0), with(self.1, sign.1))
            }
        }

        #[inline(always)]
        fn above(self, other: Self) -> Avx2Mask {
            // SAFETY: as above.
            unsafe {
                Avx2Mask(
                    _mm256_cmp_pd::<_CMP_GT_OQ>(self.0, other.0),
                    _mm256_cmp_pd::<_CMP_GT_OQ>(self.1, other.1),
                )
            }
        }

        #[inline(always)]
        fn at_least(self, other: Self) -> Avx2Mask {
            // SAFETY: as above.
            unsafe {
                Avx2Mask(
                    _mm256_cmp_pd::<_CMP_GE_OQ>(self.0, other.0),
                    _mm256_cmp_pd::<_CMP_GE_OQ>(self.1, other.1),
                )
            }
        }

        #[inline(always)]
        fn where_or(self, mask: Avx2Mask, other: Self) -> Self {
            // SAFETY: as above.
            unsafe {
                Self(
                    _mm256_blendv_pd(other.0, self.0, mask.0),
                    _mm256_blendv_pd(other.1, self.1, mask.1),
                )
            }
        }
    }

    // SAFETY, of each: as above.
    operators!(
        Avx2,
        |x, y| Add add unsafe { Self(_mm256_add_pd(x.0, y.0), _mm256_add_pd(x.1, y.1)) },
        Sub sub unsafe { Self(_mm256_sub_pd(x.0, y.0), _mm256_sub_pd(x.1, y.1)) },
        Mul mul unsafe { Self(_mm256_mul_pd(x.0, y.0), _mm256_mul_pd(x.1, y.1)) },
        Div div unsafe { Self(_mm256_div_pd(x.0, y.0), _mm256_div_pd(x.1, y.1)) };
        unsafe {
            let bit = _mm256_set1_pd(-0.0);
            Self(_mm256_xor_pd(x.0, bit), _mm256_xor_pd(x.1, bit))
        }
    );

    impl Mask for Avx2Mask {
        #[inline(always)]
        fn from_bits(bits: u8) -> Self {
            let half = |bits: i64| {
                // SAFETY: as above.
                unsafe {
                    let each = _mm256_set_epi64x(8, 4, 2, 1);
                    let set = _mm256_and_si256(_mm256_set1_epi64x(bits), each);
                    _mm256_castsi256_pd(_mm256_cmpeq_epi64(set, each))
                }
            };
            Self(half(i64::from(bits)), half(i64::from(bits >> 4)))
        }

        #[inline(always)]
        fn bits(self) -> u8 {
            // SAFETY: as above.
            let (low, high) = unsafe { (_mm256_movemask_pd(self.0), _mm256_movemask_pd(self.1)) };
            (low | high << 4) as u8
        }

        #[inline(always)]
        fn and(self, other: Self) -> Self {
            // SAFETY: as above.
            unsafe {
                Self(
                    _mm256_and_pd(self.0, other.0),
                    _mm256_and_pd(self.1, other.1),
                )
            }
        }

        #[inline(always)]
        fn or(self, other: Self) -> Self {
            // SAFETY: as above.
            unsafe { Self(_mm256_or_pd(self.0, other.0), _mm256_or_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn and_not(self, other: Self) -> Self {
            // SAFETY: as above.
            unsafe {
                Self(
                    _mm256_andnot_pd(other.0, self.0),
                    _mm256_andnot_pd(other.1, self.1),
                )
            }
        }

        #[inline(always)]
        fn differs(self, other: Self) -> Self {
            // SAFETY: as above.
            unsafe {
                Self(
                    _mm256_xor_pd(self.0, other.0),
                    _mm256_xor_pd(self.1, other.1),
                )
            }
        }
    }
}
