//! Comparisons of pairs with permutations of bytes (AVX-512 VBMI), written by hand.
//!
//! *How it works.* All places are turned first. The disc about a keypoint is nine tables of 128 bytes, in which its rows
//! follow each other without gaps; masked loads put them together in registers. A permutation looks up 64 places in one
//! table. The bits of a place above the lowest seven say in which table it lies: places of this table take what was
//! found, and all others keep what they have.
//!
//! *Benefit*: looking up place by place takes four instructions for each of 512 places. *Correctness*: places are
//! turned and rounded by the operations of the portable code in its order; a test compares both.

use std::arch::x86_64::{
    __m512, __m512i, __mmask32, __mmask64, _mm512_add_epi16, _mm512_add_ps, _mm512_castps_si512,
    _mm512_cmpeq_epi8_mask, _mm512_cmplt_epu8_mask, _mm512_load_ps, _mm512_load_si512,
    _mm512_mask_blend_epi16, _mm512_mask_loadu_epi8, _mm512_mask2_permutex2var_epi8,
    _mm512_maskz_loadu_epi8, _mm512_mul_ps, _mm512_permutex2var_epi16, _mm512_set1_epi8,
    _mm512_set1_epi16, _mm512_set1_ps, _mm512_setzero_si512, _mm512_slli_epi16, _mm512_slli_epi32,
    _mm512_srli_epi16, _mm512_sub_ps,
};

use super::{PAIR_REACH, PairTable, ROUND};
use crate::simd::orb::Pixels;
use crate::simd::sixteen::select;

/// Bytes of a vector.
const VECTOR: usize = 64;

/// Bytes of a table: what a permutation looks up in.
const TABLE: usize = 2 * VECTOR;

/// Tables that hold the rows of the disc.
const TABLES: usize = 9;

/// Half the length of the rows that hold pixels to which places within 18.5 pixels are rounded, from the
/// middle row outwards.
const HALF_WIDTHS: [usize; PAIR_REACH + 1] = half_widths();

/// Where the pixel in the middle of each row lies in the tables; rows above the centre, whose numbers are
/// negative, at the end, as the lowest six bits of their numbers say.
static MIDDLES: Middles = Middles(middles());

#[repr(align(64))]
struct Middles([u16; 64]);

/// Vectors of places: 64 first ones of pairs, their second ones, and so on.
const LOOK_UPS: usize = 512 / VECTOR;

/// x of 64 places, then y. Four vectors hold every fourth of them each, so that the rounded numbers need no shuffle to
/// become bytes in the order of the places.
#[repr(align(64))]
struct Places([[[f32; VECTOR / 4]; 4]; 2]);

/// What a vector of the disc holds of one row: the bytes of `lanes`.
#[derive(Clone, Copy)]
struct Run {
    /// Number of the vector, two for each table.
    vector: usize,
    /// Rows below the highest one of the disc.
    row: usize,
    /// Columns from the centre to where the first byte of the vector would lie.
    right: isize,
    lanes: __mmask64,
}

/// All runs of the disc, vector after vector.
const RUNS: [Run; count_runs()] = runs();

/// As the kernel of that name, with as many turns as centres.
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
pub(super) fn compare_pairs(
    pixels: Pixels<'_>,
    centres: &[[u32; 2]],
    turns: &[[f32; 2]],
    pairs: &PairTable,
) -> Vec<u64> {
    let mut bits = Vec::with_capacity(4 * centres.len());
    let upright = places(pairs);
    let mut look_ups = [[_mm512_setzero_si512(); 2]; LOOK_UPS];
    for (&centre, &turn) in centres.iter().zip(turns) {
        for (look_up, upright) in look_ups.iter_mut().zip(&upright) {
            *look_up = turned(upright, turn);
        }
        // Each place lies in one table. It stays as it is until that comes, and what was found stays too.
        let mut found = look_ups.map(|[low, _]| low);
        let corner = pixels.square(centre, PAIR_REACH).as_ptr();
        macro_rules! look_up_in {
            ($($number:literal)*) => {$(
                // SAFETY: the pixels of the square are there.
                let table = unsafe { load_table::<$number>(corner, pixels.width) };
                for (found, [_, number]) in found.iter_mut().zip(&look_ups) {
                    let here = _mm512_cmpeq_epi8_mask(*number, _mm512_set1_epi8($number));
                    *found = _mm512_mask2_permutex2var_epi8(table[0], *found, here, table[1]);
                }
            )*};
        }
        look_up_in!(0 1 2 3 4 5 6 7 8);
        for [first, second] in found.as_chunks::<2>().0 {
            bits.push(_mm512_cmplt_epu8_mask(*first, *second));
        }
    }
    bits
}

/// The places of all pairs in the order in which they are looked up.
fn places(pairs: &PairTable) -> [Places; LOOK_UPS] {
    std::array::from_fn(|i| {
        let of_all = [&pairs.first, &pairs.second][i % 2];
        let start = i / 2 * VECTOR;
        Places(std::array::from_fn(|axis| {
            std::array::from_fn(|j| std::array::from_fn(|lane| of_all[axis][start + 4 * lane + j]))
        }))
    })
}

/// Table `NUMBER` of the disc in the square whose first pixel is `corner`.
///
/// # Safety
/// The square must have `2 * PAIR_REACH + 1` rows and columns.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
unsafe fn load_table<const NUMBER: usize>(corner: *const u8, width: usize) -> [__m512i; 2] {
    let mut vectors = [_mm512_setzero_si512(); 2];
    let mut i = const { first_run(2 * NUMBER) };
    while i < const { first_run(2 * NUMBER + 2) } {
        let run = RUNS[i];
        let start = corner
            .wrapping_add(run.row * width)
            .wrapping_offset(PAIR_REACH as isize + run.right);
        let vector = &mut vectors[run.vector % 2];
        // SAFETY: only pixels of the disc are read, which lies in the square.
        *vector = unsafe {
            if run.lanes & 1 == 1 {
                _mm512_maskz_loadu_epi8(run.lanes, start.cast())
            } else {
                _mm512_mask_loadu_epi8(*vector, run.lanes, start.cast())
            }
        };
        i += 1;
    }
    vectors
}

/// 64 places in the disc, turned: the low byte of each, whose highest bit means nothing, and the number of its table.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn turned(Places([x, y]): &Places, turn: [f32; 2]) -> [__m512i; 2] {
    const ODD: __mmask32 = 0xaaaa_aaaa;
    let (cos, sin) = (_mm512_set1_ps(turn[0]), _mm512_set1_ps(turn[1]));
    let (mut columns, mut rows) = ([_mm512_setzero_si512(); 4], [_mm512_setzero_si512(); 4]);
    for i in 0..4 {
        // SAFETY: 16 values can be read, and are aligned.
        let (x, y) = unsafe { (_mm512_load_ps(x[i].as_ptr()), _mm512_load_ps(y[i].as_ptr())) };
        let turned_x = _mm512_sub_ps(_mm512_mul_ps(x, cos), _mm512_mul_ps(y, sin));
        let turned_y = _mm512_add_ps(_mm512_mul_ps(x, sin), _mm512_mul_ps(y, cos));
        // A rounded number is in the lowest bits of a mantissa.
        let rounded = |v: __m512| _mm512_castps_si512(_mm512_add_ps(v, _mm512_set1_ps(ROUND)));
        columns[i] = rounded(turned_x);
        rows[i] = rounded(turned_y);
    }
    // SAFETY: 64 numbers of two bytes are two vectors, and aligned.
    let middles =
        [0, 32].map(|first| unsafe { _mm512_load_si512(MIDDLES.0.as_ptr().add(first).cast()) });
    // The low halves of two vectors of 32-bit numbers become one of 16-bit numbers, and the low bytes of two of
    // these one of bytes.
    let halves = |numbers: [__m512i; 4], i: usize| {
        _mm512_mask_blend_epi16(ODD, numbers[i], _mm512_slli_epi32::<16>(numbers[i + 2]))
    };
    let place = |i: usize| {
        let row = _mm512_permutex2var_epi16(middles[0], halves(rows, i), middles[1]);
        _mm512_add_epi16(row, halves(columns, i))
    };
    let bytes = |even, odd| select(_mm512_set1_epi16(0xff), even, odd);
    let (even, odd) = (place(0), place(1));
    [
        bytes(even, _mm512_slli_epi16::<8>(odd)),
        // Shifted by 7 - 8 to the right.
        bytes(_mm512_srli_epi16::<7>(even), _mm512_slli_epi16::<1>(odd)),
    ]
}

/// Whether rounding takes a place of this row and column from within 18.5 pixels: it may be half a pixel
/// nearer to the middle along either axis.
const fn is_reached(row: usize, column: usize) -> bool {
    // Twice the least distances.
    let nearest = [(2 * row).saturating_sub(1), (2 * column).saturating_sub(1)];
    nearest[0] * nearest[0] + nearest[1] * nearest[1] <= 37 * 37
}

const fn half_widths() -> [usize; PAIR_REACH + 1] {
    let mut widths = [0; PAIR_REACH + 1];
    let mut row = 0;
    while row <= PAIR_REACH {
        while widths[row] < PAIR_REACH && is_reached(row, widths[row] + 1) {
            widths[row] += 1;
        }
        row += 1;
    }
    widths
}

const fn middles() -> [u16; 64] {
    let mut middles = [0; 64];
    let (mut start, mut i) = (0, 0);
    while i <= 2 * PAIR_REACH {
        let half = HALF_WIDTHS[i.abs_diff(PAIR_REACH)];
        middles[(i + 64 - PAIR_REACH) % 64] = (start + half) as u16;
        start += 2 * half + 1;
        i += 1;
    }
    assert!(start <= TABLES * TABLE, "tables for all rows");
    middles
}

/// The number of the first run in vector `number` or a later one.
const fn first_run(number: usize) -> usize {
    let mut i = 0;
    while i < RUNS.len() && RUNS[i].vector < number {
        i += 1;
    }
    i
}

/// The last byte of the disc that lies in the row of the byte `at` and in its vector, and one.
const fn end_of_run(at: usize, end_of_row: usize) -> usize {
    let end_of_vector = (at / VECTOR + 1) * VECTOR;
    if end_of_row < end_of_vector {
        end_of_row
    } else {
        end_of_vector
    }
}

const fn count_runs() -> usize {
    let (mut count, mut row, mut at) = (0, 0, 0);
    while row <= 2 * PAIR_REACH {
        let end = at + 2 * HALF_WIDTHS[row.abs_diff(PAIR_REACH)] + 1;
        while at < end {
            at = end_of_run(at, end);
            count += 1;
        }
        row += 1;
    }
    count
}

const fn runs() -> [Run; count_runs()] {
    let none = Run {
        vector: 0,
        row: 0,
        right: 0,
        lanes: 0,
    };
    let mut runs = [none; count_runs()];
    let (mut count, mut row, mut at) = (0, 0, 0);
    while row <= 2 * PAIR_REACH {
        let half = HALF_WIDTHS[row.abs_diff(PAIR_REACH)];
        let (start, end) = (at, at + 2 * half + 1);
        while at < end {
            let (vector, end) = (at / VECTOR, end_of_run(at, end));
            let first = vector * VECTOR;
            runs[count] = Run {
                vector,
                row,
                right: first as isize - (start + half) as isize,
                lanes: __mmask64::MAX >> (VECTOR - (end - at)) << (at - first),
            };
            at = end;
            count += 1;
        }
        row += 1;
    }
    runs
}
