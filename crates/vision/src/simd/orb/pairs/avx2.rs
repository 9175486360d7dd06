//! Comparisons of pairs, two places in one number (AVX2), written by hand.
//!
//! *How it works.* The first and the second places of eight pairs are turned, and their distances from the first pixel
//! of the square about the keypoint are put beside each other, so that one load gives both places of a pair. Pixels are
//! read where they lie in the image. The carry of a comparison goes into the word of bits (`adc`). While sixteen pairs are
//! looked up, which needs no vectors, as many are turned for the next keypoint, which needs little else.
//!
//! *Benefit*: the definition copies the square first, since only then do its places fit into 16 bits and need no check,
//! and it loads the two places of a pair one by one. *Correctness*: places are turned and rounded by the operations of
//! the definition in its order; a test compares both.

use std::arch::x86_64::{
    __m256, __m256i, _addcarry_u64, _mm256_add_epi32, _mm256_add_ps, _mm256_castps_si256,
    _mm256_load_ps, _mm256_mul_ps, _mm256_mullo_epi32, _mm256_set1_epi32, _mm256_set1_ps,
    _mm256_store_si256, _mm256_sub_ps, _mm256_unpackhi_epi32, _mm256_unpacklo_epi32,
};

use super::{PAIR_REACH, PairTable, ROUND};
use crate::simd::orb::Pixels;

/// Values of a vector.
const LANES: usize = 8;

/// Pairs that are looked up, and turned, at a time.
const STEP: usize = 2 * LANES;

/// The largest squares of the distance of a place, in pixels, and of the length of a turn.
const LARGEST: [f32; 2] = [18.5 * 18.5, 1.01];

/// x and y of the first places of [`STEP`] pairs, then of their second ones; in vectors, as [`upright`] says.
#[repr(align(32))]
struct Upright([[[[f32; LANES]; 2]; 2]; STEP / LANES]);

/// Where [`STEP`] pairs lie in the square about a keypoint, in pixels from its first one: the first place in the lower
/// half of a number, the second one in the upper.
#[repr(align(32))]
#[derive(Clone, Copy)]
struct Places([u64; STEP]);

/// Whether all places, turned, lie in the squares about the centres, and numbers of 32 bits say where.
pub(super) fn are_in_reach(pixels: Pixels<'_>, turns: &[[f32; 2]], pairs: &PairTable) -> bool {
    let [distance, length] = LARGEST;
    let is_near =
        |[x, y]: &[[f32; 256]; 2]| x.iter().zip(y).all(|(x, y)| x * x + y * y <= distance);
    pixels.width < 1 << 24
        && is_near(&pairs.first)
        && is_near(&pairs.second)
        && turns
            .iter()
            .all(|[cos, sin]| cos * cos + sin * sin <= length)
}

/// As the kernel of that name, with as many turns as centres.
///
/// # Safety
/// All places must be [in reach](are_in_reach).
#[target_feature(enable = "avx2")]
pub(super) unsafe fn compare_pairs(
    pixels: Pixels<'_>,
    centres: &[[u32; 2]],
    turns: &[[f32; 2]],
    pairs: &PairTable,
) -> Vec<u64> {
    const STEPS: usize = 64 / STEP;
    let mut bits = Vec::with_capacity(4 * centres.len());
    let Some((&first, others)) = turns.split_first() else {
        return bits;
    };
    let upright = upright(pairs);
    let mut places = [[Places([0; STEP]); 256 / STEP]; 2];
    let [mut these, mut next] = places.each_mut();
    for (upright, places) in upright.iter().zip(these.iter_mut()) {
        turn_places(upright, first, pixels.width, places);
    }
    // After the last keypoint there is none to turn for; any turn will do.
    for (&centre, &turn) in centres.iter().zip(others.iter().chain(&[first])) {
        let square = pixels.square(centre, PAIR_REACH);
        let steps = these
            .as_chunks::<STEPS>()
            .0
            .iter()
            .zip(next.as_chunks_mut::<STEPS>().0);
        for ((these, next), upright) in steps.zip(upright.as_chunks::<STEPS>().0) {
            let mut word = 0;
            for ((Places(these), next), upright) in these.iter().zip(next).zip(upright) {
                for places in these {
                    // SAFETY: the number can be read. If that is volatile, it happens where the places are needed; the
                    // compiler would load all of a step first, into more registers than there are.
                    let places = unsafe { std::ptr::read_volatile(places) };
                    // SAFETY: the places are in the square, as the caller ensures.
                    let [first, second] = [places as u32, (places >> 32) as u32]
                        .map(|place| unsafe { *square.get_unchecked(place as usize) });
                    let is_darker = u8::from(first < second);
                    let shifted = word;
                    // SAFETY: every x86-64 adds with a carry. Later versions of Rust than the oldest call this safe.
                    #[allow(unused_unsafe)]
                    unsafe {
                        _addcarry_u64(is_darker, shifted, shifted, &mut word);
                    }
                }
                turn_places(upright, turn, pixels.width, next);
            }
            bits.push(word);
        }
        std::mem::swap(&mut these, &mut next);
    }
    bits
}

/// All pairs in the order in which they are looked up: the last of 64 come first, since each further bit moves those that
/// are there to higher places. Two vectors of places interleave to pairs in this order.
fn upright(pairs: &PairTable) -> [Upright; 256 / STEP] {
    const INTERLEAVED: [usize; LANES] = [0, 1, 4, 5, 2, 3, 6, 7];
    std::array::from_fn(|step| {
        Upright(std::array::from_fn(|vector| {
            let of = INTERLEAVED.map(|lane| (STEP * step + LANES * vector + lane) ^ 63);
            [&pairs.first, &pairs.second]
                .map(|places| [0, 1].map(|axis: usize| of.map(|pair| places[axis][pair])))
        }))
    })
}

/// The places of pairs in the square, after a turn by the angle of cosine and sine `turn`.
#[inline]
#[target_feature(enable = "avx2")]
fn turn_places(Upright(upright): &Upright, turn: [f32; 2], width: usize, to: &mut Places) {
    let (cos, sin) = (_mm256_set1_ps(turn[0]), _mm256_set1_ps(turn[1]));
    let width = width as i32;
    let row = _mm256_set1_epi32(width);
    // Takes away what rounding leaves above the lowest bits of both coordinates.
    let reach = (PAIR_REACH as i32).wrapping_sub(ROUND.to_bits() as i32);
    let from_first_pixel = _mm256_set1_epi32(reach.wrapping_mul(width.wrapping_add(1)));
    let rounded = |v: __m256| _mm256_castps_si256(_mm256_add_ps(v, _mm256_set1_ps(ROUND)));
    let to = std::ptr::from_mut(to).cast::<__m256i>();
    for (i, both) in upright.iter().enumerate() {
        let [first, second] = both.each_ref().map(|[x, y]| -> __m256i {
            // SAFETY: eight values can be read, and are aligned.
            let (x, y) = unsafe { (_mm256_load_ps(x.as_ptr()), _mm256_load_ps(y.as_ptr())) };
            let turned_x = _mm256_sub_ps(_mm256_mul_ps(x, cos), _mm256_mul_ps(y, sin));
            let turned_y = _mm256_add_ps(_mm256_mul_ps(x, sin), _mm256_mul_ps(y, cos));
            let down = _mm256_mullo_epi32(rounded(turned_y), row);
            _mm256_add_epi32(_mm256_add_epi32(down, rounded(turned_x)), from_first_pixel)
        });
        // SAFETY: two vectors can be written for each of `upright`, and are aligned.
        unsafe {
            _mm256_store_si256(to.add(2 * i), _mm256_unpacklo_epi32(first, second));
            _mm256_store_si256(to.add(2 * i + 1), _mm256_unpackhi_epi32(first, second));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_places_in_the_squares_are_read() {
        let narrow = Pixels {
            data: &[],
            width: 61,
        };
        let wide = Pixels {
            data: &[],
            width: 1 << 24,
        };
        let at = |x, y| PairTable {
            first: [[0.0; 256]; 2],
            second: [[x; 256], [y; 256]],
        };
        let farthest = at(13.0, -13.0);
        assert!(are_in_reach(narrow, &[[0.8, 0.6]], &farthest));
        assert!(!are_in_reach(wide, &[[0.8, 0.6]], &farthest));
        for turn in [[0.8, 0.7], [f32::NAN, 0.6], [0.0, f32::INFINITY]] {
            assert!(!are_in_reach(narrow, &[[0.8, 0.6], turn], &farthest));
        }
        for pairs in [at(13.2, 13.0), at(f32::NAN, 0.0)] {
            assert!(!are_in_reach(narrow, &[[0.8, 0.6]], &pairs));
        }
    }
}
