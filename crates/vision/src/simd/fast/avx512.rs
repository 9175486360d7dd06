//! [Maxima](super::strict_maxima) with vectors of 64 bytes, written by hand.
//!
//! *Benefit*: a comparison gives one bit for each column; from the portable code the compiler makes bytes, and takes
//! them from memory to bring them together. *Correctness*: the comparisons are those of the portable code; a test
//! compares both.

use std::arch::x86_64::{
    __m512i, __mmask64, _mm512_cmpge_epu8_mask, _mm512_mask_cmpge_epu8_mask,
    _mm512_mask_cmpgt_epu8_mask, _mm512_maskz_loadu_epi8, _mm512_max_epu8, _mm512_set1_epi8,
};

use super::{Bar, push_columns};

/// Columns that are looked at together.
const COLUMNS: usize = 64;

/// As [`super::maxima`].
#[target_feature(enable = "avx512f,avx512bw")]
pub(super) fn maxima(rows: [&[u8]; 3], least: u8, bar: Bar, found: &mut Vec<usize>) {
    let width = rows[1].len();
    assert!(
        rows.iter().all(|row| row.len() == width),
        "rows of one length"
    );
    let least = _mm512_set1_epi8(least.cast_signed());
    for x in (1..width.saturating_sub(1)).step_by(COLUMNS) {
        let count = COLUMNS.min(width - 1 - x);
        let inside = __mmask64::MAX >> (COLUMNS - count);
        // SAFETY: the columns `x - 1 .. x + count + 1` lie in each row, and no others are read.
        let load = |row: &[u8], x: usize| -> __m512i {
            unsafe { _mm512_maskz_loadu_epi8(inside, row.as_ptr().add(x).cast()) }
        };
        let here = load(rows[1], x);
        let is_score = _mm512_cmpge_epu8_mask(here, least);
        if is_score == 0 {
            continue;
        }
        let [above, beside, below] = rows.map(|row| [load(row, x - 1), load(row, x + 1)]);
        let [above, beside, below] =
            [above, beside, below].map(|[left, right]| _mm512_max_epu8(left, right));
        let most = _mm512_max_epu8(
            _mm512_max_epu8(above, _mm512_max_epu8(beside, below)),
            _mm512_max_epu8(load(rows[0], x), load(rows[2], x)),
        );
        let is_maximum = match bar {
            Bar::Above => _mm512_mask_cmpgt_epu8_mask(is_score, here, most),
            Bar::AtLeast => _mm512_mask_cmpge_epu8_mask(is_score, here, most),
        };
        push_columns(is_maximum, x, found);
    }
}
