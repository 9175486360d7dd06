//! [Maxima](super::strict_maxima) with vectors of 32 bytes, written by hand: see [`super::avx512`].

use std::arch::x86_64::{
    __m256i, _mm256_and_si256, _mm256_andnot_si256, _mm256_cmpeq_epi8, _mm256_loadu_si256,
    _mm256_max_epu8, _mm256_movemask_epi8, _mm256_set1_epi8,
};

use super::{Bar, push_columns};

/// Columns that are looked at together.
pub(super) const COLUMNS: usize = 32;

/// As [`super::maxima`], for rows of at least [`COLUMNS`] and two more.
#[target_feature(enable = "avx2")]
pub(super) fn maxima(rows: [&[u8]; 3], least: u8, bar: Bar, found: &mut Vec<usize>) {
    let width = rows[1].len();
    assert!(
        width >= COLUMNS + 2 && rows.iter().all(|row| row.len() == width),
        "rows of one length, a block and what is beside it"
    );
    let least = _mm256_set1_epi8(least.cast_signed());
    let last = width - 1 - COLUMNS;
    for x in (1..width - 1).step_by(COLUMNS) {
        // The last block has columns that were looked at.
        let start = x.min(last);
        // SAFETY: the columns `start - 1 .. start + COLUMNS + 1` lie in each row.
        let load = |row: &[u8], x: usize| -> __m256i {
            unsafe { _mm256_loadu_si256(row.as_ptr().add(x).cast()) }
        };
        let here = load(rows[1], start);
        let is_score = reaches(here, least);
        if _mm256_movemask_epi8(is_score) == 0 {
            continue;
        }
        let [above, beside, below] = rows.map(|row| [load(row, start - 1), load(row, start + 1)]);
        let [above, beside, below] =
            [above, beside, below].map(|[left, right]| _mm256_max_epu8(left, right));
        let most = _mm256_max_epu8(
            _mm256_max_epu8(above, _mm256_max_epu8(beside, below)),
            _mm256_max_epu8(load(rows[0], start), load(rows[2], start)),
        );
        let is_maximum = match bar {
            Bar::Above => _mm256_andnot_si256(reaches(most, here), is_score),
            Bar::AtLeast => _mm256_and_si256(reaches(here, most), is_score),
        };
        let bits = _mm256_movemask_epi8(is_maximum).cast_unsigned() >> (x - start);
        push_columns(bits.into(), x, found);
    }
}

/// Where bytes of `a` are at least those of `b`.
#[inline]
#[target_feature(enable = "avx2")]
fn reaches(a: __m256i, b: __m256i) -> __m256i {
    _mm256_cmpeq_epi8(_mm256_max_epu8(a, b), a)
}
