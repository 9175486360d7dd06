//! Eight numbers in two registers of AVX2.

use std::arch::x86_64::{
    __m256d, __m256i, _CMP_GE_OQ, _CMP_GT_OQ, _mm256_add_pd, _mm256_and_pd, _mm256_and_si256,
    _mm256_andnot_pd, _mm256_blendv_pd, _mm256_castpd_ps, _mm256_castps_pd, _mm256_castsi256_pd,
    _mm256_cmp_pd, _mm256_cmpeq_epi64, _mm256_div_pd, _mm256_loadu_pd, _mm256_loadu_si256,
    _mm256_movemask_pd, _mm256_mul_pd, _mm256_or_pd, _mm256_or_si256, _mm256_permutevar8x32_ps,
    _mm256_set_epi64x, _mm256_set1_epi64x, _mm256_set1_pd, _mm256_slli_epi64, _mm256_sqrt_pd,
    _mm256_storeu_pd, _mm256_sub_pd, _mm256_xor_pd,
};
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{LANES, Lanes, Mask};

/// Eight numbers in two registers.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(__m256d, __m256d);

/// Answers for eight numbers in two registers, all bits of each or none.
#[derive(Clone, Copy, Debug)]
pub struct Avx2Mask(__m256d, __m256d);

// SAFETY, here and below: this type is only used where AVX2 is in use (see the head of the file).
impl Lanes for Avx2 {
    type Mask = Avx2Mask;
    type Places = Avx2Places;

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
            let with = |x, sign| _mm256_or_pd(_mm256_and_pd(bit, sign), _mm256_andnot_pd(bit, x));
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

    #[inline(always)]
    fn places(lanes: [u64; LANES]) -> Avx2Places {
        // SAFETY: as above; there are eight numbers.
        let (low, high) = unsafe {
            let lanes: *const __m256i = lanes.as_ptr().cast();
            (_mm256_loadu_si256(lanes), _mm256_loadu_si256(lanes.add(1)))
        };
        Avx2Places(HalfPlaces::new(low), HalfPlaces::new(high))
    }

    #[inline(always)]
    fn taken(self, places: Avx2Places) -> Self {
        Self(places.0.of(self), places.1.of(self))
    }

    #[inline(always)]
    fn pack(self, mask: Avx2Mask, to: &mut [f64; LANES]) {
        // SAFETY: as above; at most four of the first half are before four of the other.
        unsafe {
            let low = _mm256_movemask_pd(mask.0) as usize % FIRST.len();
            let high = _mm256_movemask_pd(mask.1) as usize % FIRST.len();
            let to = to.as_mut_ptr();
            _mm256_storeu_pd(to, first_of(self.0, low));
            _mm256_storeu_pd(to.add(low.count_ones() as usize), first_of(self.1, high));
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

/// Lanes for eight numbers in two registers.
#[derive(Clone, Copy, Debug)]
pub struct Avx2Places(HalfPlaces, HalfPlaces);

/// Lanes for the four numbers of a register.
#[derive(Clone, Copy, Debug)]
struct HalfPlaces {
    /// Where they are in either register, in halves of a number.
    places: __m256i,
    /// Which are in the second register (the highest bit of each).
    second: __m256d,
}

impl HalfPlaces {
    #[inline(always)]
    fn new(lanes: __m256i) -> Self {
        // SAFETY: as above.
        unsafe {
            let twice = _mm256_slli_epi64::<1>(lanes);
            let both = _mm256_or_si256(twice, _mm256_slli_epi64::<32>(twice));
            Self {
                // The instruction takes the lowest three bits.
                places: _mm256_or_si256(both, _mm256_set1_epi64x(1 << 32)),
                second: _mm256_castsi256_pd(_mm256_slli_epi64::<61>(lanes)),
            }
        }
    }

    #[inline(always)]
    fn of(self, numbers: Avx2) -> __m256d {
        // SAFETY: as above.
        unsafe {
            let first = _mm256_permutevar8x32_ps(_mm256_castpd_ps(numbers.0), self.places);
            let second = _mm256_permutevar8x32_ps(_mm256_castpd_ps(numbers.1), self.places);
            let (first, second) = (_mm256_castps_pd(first), _mm256_castps_pd(second));
            _mm256_blendv_pd(first, second, self.second)
        }
    }
}

/// Those of four numbers that a mask names first. A function, since the compiler may leave a closure without the
/// instructions of its caller.
#[inline(always)]
fn first_of(four: __m256d, mask: usize) -> __m256d {
    // SAFETY: as above; there are eight places.
    unsafe {
        let places = _mm256_loadu_si256(FIRST[mask].as_ptr().cast());
        _mm256_castps_pd(_mm256_permutevar8x32_ps(_mm256_castpd_ps(four), places))
    }
}

/// For each mask of four numbers their halves, those of the mask first.
static FIRST: [[u32; 8]; 16] = first();

const fn first() -> [[u32; 8]; 16] {
    let mut places = [[0; 8]; 16];
    let mut mask = 0;
    while mask < places.len() {
        let (mut next, mut lane) = (0, 0);
        while lane < 4 {
            if mask >> lane & 1 == 1 {
                places[mask][next] = 2 * lane;
                places[mask][next + 1] = 2 * lane + 1;
                next += 2;
            }
            lane += 1;
        }
        mask += 1;
    }
    places
}

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
