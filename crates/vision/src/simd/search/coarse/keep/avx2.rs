//! With vectors of 32 bytes.

use std::arch::x86_64::{
    __m256i, _mm256_add_epi16, _mm256_add_epi32, _mm256_cmpgt_epi32, _mm256_loadu_si256,
    _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_maskload_epi32, _mm256_set1_epi16,
    _mm256_set1_epi32, _mm256_setr_epi32, _mm256_setzero_si256, _mm256_unpackhi_epi32,
    _mm256_unpacklo_epi32,
};

use super::{AT_ONCE, Pair, Rows, keep_of_width, sum_of_halves};

/// See [`keep_of_width`].
#[target_feature(enable = "avx2,fma")]
pub(in super::super) fn keep(pairs: &[Pair], rows: Rows<'_>, kept: &mut [(Pair, i32)]) -> usize {
    let none = _mm256_setzero_si256();
    let lanes = |query: &[i32], candidate: &[i32]| lanes(query, candidate);
    let sums = |of_pairs| sums(of_pairs);
    match rows.width() {
        32 => keep_of_width::<32, _>(pairs, rows, kept, none, lanes, sums),
        _ => keep_of_width::<0, _>(pairs, rows, kept, none, lanes, sums),
    }
}

/// The sum of the lanes of 16 bits of each of four vectors.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn sums(mut sums: [__m256i; AT_ONCE]) -> [i32; AT_ONCE] {
    for sums in &mut sums {
        *sums = _mm256_madd_epi16(*sums, _mm256_set1_epi16(1));
    }
    let [a, b, c, d] = sums;
    let ac = _mm256_add_epi32(_mm256_unpacklo_epi32(a, c), _mm256_unpackhi_epi32(a, c));
    let bd = _mm256_add_epi32(_mm256_unpacklo_epi32(b, d), _mm256_unpackhi_epi32(b, d));
    // In each half: sums of a, b, c, d.
    let sums = _mm256_add_epi32(_mm256_unpacklo_epi32(ac, bd), _mm256_unpackhi_epi32(ac, bd));
    sum_of_halves(sums)
}

/// Sums of products of the bytes of a query and of a candidate, which add up to that of all.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn lanes(query: &[i32], candidate: &[i32]) -> __m256i {
    assert_eq!(query.len(), candidate.len(), "rows of one width");
    let ((query, last_query), (candidate, last)) =
        (query.as_chunks::<8>(), candidate.as_chunks::<8>());
    let mut sums = _mm256_setzero_si256();
    for (query, candidate) in query.iter().zip(candidate) {
        // SAFETY: 32 bytes can be read from 8 quads.
        let (query, candidate) = unsafe {
            (
                _mm256_loadu_si256(query.as_ptr().cast()),
                _mm256_loadu_si256(candidate.as_ptr().cast()),
            )
        };
        sums = _mm256_add_epi16(sums, _mm256_maddubs_epi16(query, candidate));
    }
    if !last.is_empty() {
        let number = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let lanes = _mm256_cmpgt_epi32(_mm256_set1_epi32(last.len() as i32), number);
        // SAFETY: no more is read than the quads that are left.
        let (query, candidate) = unsafe {
            (
                _mm256_maskload_epi32(last_query.as_ptr(), lanes),
                _mm256_maskload_epi32(last.as_ptr(), lanes),
            )
        };
        sums = _mm256_add_epi16(sums, _mm256_maddubs_epi16(query, candidate));
    }
    sums
}
