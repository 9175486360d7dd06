//! Eight numbers in a register of AVX-512.

use std::arch::x86_64::{
    __m512d, __m512i, _CMP_GE_OQ, _CMP_GT_OQ, _mm512_abs_pd, _mm512_add_pd, _mm512_and_pd,
    _mm512_andnot_pd, _mm512_cmp_pd_mask, _mm512_div_pd, _mm512_loadu_pd, _mm512_loadu_si512,
    _mm512_mask_blend_pd, _mm512_maskz_compress_pd, _mm512_mul_pd, _mm512_or_pd,
    _mm512_permutexvar_pd, _mm512_set1_pd, _mm512_sqrt_pd, _mm512_storeu_pd, _mm512_sub_pd,
    _mm512_xor_pd,
};
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{LANES, Lanes, Mask};

/// Eight numbers in one register.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(__m512d);

// SAFETY, here and below: this type is only used where AVX-512 is in use (see the head of the file).
impl Lanes for Avx512 {
    type Mask = u8;
    type Places = __m512i;

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

    #[inline(always)]
    fn places(lanes: [u64; LANES]) -> __m512i {
        // SAFETY: as above; there are eight numbers.
        unsafe { _mm512_loadu_si512(lanes.as_ptr().cast()) }
    }

    #[inline(always)]
    fn taken(self, places: __m512i) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm512_permutexvar_pd(places, self.0) })
    }

    #[inline(always)]
    fn pack(self, mask: u8, to: &mut [f64; LANES]) {
        // Not the instruction that writes to memory, which is slow on Zen 4.
        // SAFETY: as above; there is space for eight.
        unsafe { _mm512_storeu_pd(to.as_mut_ptr(), _mm512_maskz_compress_pd(mask, self.0)) };
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

/// Answers in the register of a mask.
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
