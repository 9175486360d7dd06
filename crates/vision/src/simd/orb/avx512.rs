//! Comparisons of pairs with permutations of bytes (AVX-512 VBMI) and moments with products of bytes
//! (VNNI), written by hand.
//!
//! *How it works.* For moments, two rows of a patch fill a vector, and one instruction multiplies its pixels by their
//! offsets and sums the products. For comparisons, the disc about a keypoint is copied, row after row without gaps,
//! into nine tables of 128 bytes, which registers hold. A permutation looks up 64 places in one table. The bits of a
//! place above the lowest seven say in which table it lies: places of this table take what was found, and all others
//! keep what they have.
//!
//! *Benefit*: looking up place by place takes four instructions for each of 512 places. *Correctness*: places are turned and rounded by the operations
//! of the portable text in its order, and moments are whole numbers, which no order of sums changes; a test
//! compares both.

use std::arch::x86_64::{
    __m512, __m512i, _mm256_loadu_si256, _mm512_add_epi16, _mm512_add_ps, _mm512_castps_si512,
    _mm512_castsi256_si512, _mm512_cmpeq_epi8_mask, _mm512_cmplt_epu8_mask, _mm512_dpbusd_epi32,
    _mm512_inserti64x4, _mm512_loadu_ps, _mm512_loadu_si512, _mm512_mask2_permutex2var_epi8,
    _mm512_mul_ps, _mm512_permutex2var_epi8, _mm512_permutex2var_epi16, _mm512_reduce_add_epi32,
    _mm512_set1_epi8, _mm512_set1_ps, _mm512_setzero_si512, _mm512_srli_epi16, _mm512_sub_ps,
};

use super::{HALF_ROWS, MOMENT_RADIUS, PAIR_REACH, PairTable, Pixels, ROUND};

/// Bytes that are copied of each row: the longest has 39.
const ROW: usize = 40;

/// Bytes that two vectors hold.
const TABLE: usize = 128;

/// Tables that hold the rows of the disc.
const TABLES: usize = 9;

/// Half the length of the rows that hold pixels to which places within 18.5 pixels are rounded, from the
/// middle row outwards.
const HALF_WIDTHS: [usize; PAIR_REACH + 1] = half_widths();

/// Where the pixel in the middle of each row lies in the tables; rows above the centre, whose numbers are
/// negative, at the end, as the lowest six bits of their numbers say.
static MIDDLES: [u16; 64] = middles();

/// Places that are looked up together.
const AT_ONCE: usize = 64;

/// Numbers of the low halves of 32 words in two vectors, and of the low bytes of 64 half words.
static LOW_HALVES: [u16; 32] = low_halves();
static LOW_BYTES: [u8; AT_ONCE] = low_bytes();

/// Of the rows above and below the middle one, from that on outwards: x and y of each pixel that lies in
/// the circle. The middle row counts once.
static OFFSETS: [[[i8; 64]; 2]; MOMENT_RADIUS + 1] = offsets();

/// The disc about a keypoint, row after row, and what is copied beyond its last pixel.
#[repr(align(64))]
struct Disc([u8; TABLES * TABLE + TABLE]);

/// The two halves of each table.
type Tables = [[__m512i; 2]; TABLES];

/// As the kernel of that name, with as many turns as centres.
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
pub(super) fn compare_pairs(
    pixels: Pixels<'_>,
    centres: &[[u32; 2]],
    turns: &[[f32; 2]],
    pairs: &PairTable,
) -> Vec<u64> {
    let mut bits = Vec::with_capacity(4 * centres.len());
    let mut disc = Disc([0; TABLES * TABLE + TABLE]);
    for (&centre, &turn) in centres.iter().zip(turns) {
        let mut start = 0;
        // Each row overwrites what was copied beyond the end of the one before.
        for down in -(PAIR_REACH as isize)..=PAIR_REACH as isize {
            let half = HALF_WIDTHS[down.unsigned_abs()];
            disc.0[start..][..ROW].copy_from_slice(pixels.run::<ROW>(centre, half, down));
            start += 2 * half + 1;
        }
        let mut tables: Tables = [[_mm512_setzero_si512(); 2]; TABLES];
        for (table, bytes) in tables.iter_mut().zip(disc.0.as_chunks::<TABLE>().0) {
            // SAFETY: 64 bytes can be read from byte 0 and from byte 64 of 128.
            *table = unsafe {
                let start = bytes.as_ptr();
                [
                    _mm512_loadu_si512(start.cast()),
                    _mm512_loadu_si512(start.add(TABLE / 2).cast()),
                ]
            };
        }
        for start in (0..256).step_by(AT_ONCE) {
            let first = look_up(&tables, turned(&pairs.first, start, turn));
            let second = look_up(&tables, turned(&pairs.second, start, turn));
            bits.push(_mm512_cmplt_epu8_mask(first, second));
        }
    }
    bits
}

/// As the kernel of that name.
#[target_feature(enable = "avx512f,avx512vnni")]
pub(super) fn intensity_moments(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<[i32; 2]> {
    let mut moments = Vec::with_capacity(centres.len());
    for &centre in centres {
        let mut sums = [_mm512_setzero_si512(); 2];
        for (offsets, y) in OFFSETS.iter().zip(0..) {
            let above = pixels.run::<32>(centre, MOMENT_RADIUS, -y);
            let below = pixels.run::<32>(centre, MOMENT_RADIUS, y);
            // SAFETY: 32 bytes can be read from either row, and 64 from the offsets.
            unsafe {
                let above = _mm256_loadu_si256(above.as_ptr().cast());
                let below = _mm256_loadu_si256(below.as_ptr().cast());
                let rows = _mm512_inserti64x4::<1>(_mm512_castsi256_si512(above), below);
                for (sum, offsets) in sums.iter_mut().zip(offsets) {
                    let offsets = _mm512_loadu_si512(offsets.as_ptr().cast());
                    *sum = _mm512_dpbusd_epi32(*sum, rows, offsets);
                }
            }
        }
        moments.push([
            _mm512_reduce_add_epi32(sums[0]),
            _mm512_reduce_add_epi32(sums[1]),
        ]);
    }
    moments
}

/// The pixels at 64 places: the low byte of each place, and the place without its seven lowest bits.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
fn look_up(tables: &Tables, [low, table]: [__m512i; 2]) -> __m512i {
    let mut pixels = low;
    for (number, halves) in tables.iter().enumerate() {
        // Each place lies in one table. It stays as it is until that comes, and what was found stays too.
        let here = _mm512_cmpeq_epi8_mask(table, _mm512_set1_epi8(number as i8));
        pixels = _mm512_mask2_permutex2var_epi8(halves[0], pixels, here, halves[1]);
    }
    pixels
}

/// Places `start..start + 64` in the disc, turned: see [`look_up`].
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
fn turned(places: &[[f32; 256]; 2], start: usize, turn: [f32; 2]) -> [__m512i; 2] {
    let (cos, sin) = (_mm512_set1_ps(turn[0]), _mm512_set1_ps(turn[1]));
    let (mut columns, mut rows) = ([_mm512_setzero_si512(); 4], [_mm512_setzero_si512(); 4]);
    for (i, start) in (start..start + AT_ONCE).step_by(16).enumerate() {
        let (x, y) = (load(&places[0], start), load(&places[1], start));
        let turned_x = _mm512_sub_ps(_mm512_mul_ps(x, cos), _mm512_mul_ps(y, sin));
        let turned_y = _mm512_add_ps(_mm512_mul_ps(x, sin), _mm512_mul_ps(y, cos));
        // A rounded number is in the lowest bits of a mantissa.
        let rounded = |v: __m512| _mm512_castps_si512(_mm512_add_ps(v, _mm512_set1_ps(ROUND)));
        columns[i] = rounded(turned_x);
        rows[i] = rounded(turned_y);
    }
    // SAFETY: 64 bytes can be read from 32 numbers of two bytes, twice from 64, and from 64 of one.
    let (halves, bytes, middles) = unsafe {
        (
            _mm512_loadu_si512(LOW_HALVES.as_ptr().cast()),
            _mm512_loadu_si512(LOW_BYTES.as_ptr().cast()),
            [
                _mm512_loadu_si512(MIDDLES.as_ptr().cast()),
                _mm512_loadu_si512(MIDDLES.as_ptr().add(32).cast()),
            ],
        )
    };
    let place = |i: usize| {
        let row = _mm512_permutex2var_epi16(rows[i], halves, rows[i + 1]);
        let column = _mm512_permutex2var_epi16(columns[i], halves, columns[i + 1]);
        _mm512_add_epi16(
            _mm512_permutex2var_epi16(middles[0], row, middles[1]),
            column,
        )
    };
    let (first, last) = (place(0), place(2));
    let (high_first, high_last) = (_mm512_srli_epi16::<7>(first), _mm512_srli_epi16::<7>(last));
    [
        _mm512_permutex2var_epi8(first, bytes, last),
        _mm512_permutex2var_epi8(high_first, bytes, high_last),
    ]
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load(values: &[f32; 256], start: usize) -> __m512 {
    let values = values[start..].first_chunk::<16>().expect("16 at a time");
    // SAFETY: 16 values can be read from 16 values.
    unsafe { _mm512_loadu_ps(values.as_ptr()) }
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

const fn offsets() -> [[[i8; 64]; 2]; MOMENT_RADIUS + 1] {
    let mut offsets = [[[0; 64]; 2]; MOMENT_RADIUS + 1];
    let mut y = 0;
    while y <= MOMENT_RADIUS {
        let mut x = MOMENT_RADIUS - HALF_ROWS[y];
        while x <= MOMENT_RADIUS + HALF_ROWS[y] {
            let along = x as i8 - MOMENT_RADIUS as i8;
            [offsets[y][0][x], offsets[y][1][x]] = [along, -(y as i8)];
            if y > 0 {
                [offsets[y][0][x + 32], offsets[y][1][x + 32]] = [along, y as i8];
            }
            x += 1;
        }
        y += 1;
    }
    offsets
}

const fn low_halves() -> [u16; 32] {
    let mut numbers = [0; 32];
    let mut i = 0;
    while i < 32 {
        numbers[i] = 2 * i as u16;
        i += 1;
    }
    numbers
}

const fn low_bytes() -> [u8; AT_ONCE] {
    let mut numbers = [0; AT_ONCE];
    let mut i = 0;
    while i < AT_ONCE {
        numbers[i] = 2 * i as u8;
        i += 1;
    }
    numbers
}
