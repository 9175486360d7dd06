//! Which pairs of a query and a candidate remain, when they are compared by the bytes of all their values.
//!
//! *How it works.* After the principal components, few candidates of a panel are left, each for a few queries, so
//! there is nothing to share. Each pair is a product of two rows, whose lanes are summed up. With AVX-512 the lanes
//! of four such products are summed together.

use std::arch::x86_64::{
    __m512i, _mm_add_epi32, _mm_cvtsi128_si32, _mm_shuffle_epi32, _mm_storeu_si128,
    _mm_unpackhi_epi64, _mm256_add_epi16, _mm256_add_epi32, _mm256_castsi256_si128,
    _mm256_extracti128_si256, _mm256_loadu_si256, _mm256_madd_epi16, _mm256_maddubs_epi16,
    _mm256_set1_epi16, _mm256_setzero_si256, _mm512_add_epi32, _mm512_castsi512_si256,
    _mm512_dpbusd_epi32, _mm512_extracti64x4_epi64, _mm512_loadu_si512, _mm512_maskz_loadu_epi32,
    _mm512_setzero_si512, _mm512_unpackhi_epi32, _mm512_unpacklo_epi32,
};

use super::within::LANES;

/// A query and a lane of a panel.
#[derive(Clone, Copy)]
pub(super) struct Pair(u32);

impl Pair {
    #[inline]
    pub(super) fn new(query: usize, lane: usize) -> Self {
        Self((query * LANES + lane) as u32)
    }

    #[inline]
    pub(super) fn query(self) -> usize {
        self.0 as usize / LANES
    }

    #[inline]
    pub(super) fn lane(self) -> usize {
        self.0 as usize % LANES
    }
}

/// Keeps those pairs of a query and a candidate of a panel whose squared distance in bytes, less the
/// query's part of it, is at most the query's limit; `parts` are those of the candidates. Without branches,
/// whose outcome nobody could predict.
#[target_feature(enable = "avx2,fma")]
pub(super) fn keep(
    pairs: &[Pair],
    queries: &[i32],
    candidates: &[i32],
    parts: &[i32],
    limits: &[i32],
    kept: &mut [(Pair, i32)],
) -> usize {
    let width = candidates.len() / parts.len();
    let mut count = 0;
    for &pair in pairs {
        let query = &queries[pair.query() * width..][..width];
        let candidate = &candidates[pair.lane() * width..][..width];
        let distance = parts[pair.lane()] - 2 * product(query, candidate);
        kept[count] = (pair, distance);
        count += usize::from(distance <= limits[pair.query()]);
    }
    count
}

/// [`keep`] with one instruction for the products of 64 bytes and their sums, and the lanes of four such sums
/// added together.
///
/// *Benefit*: half the time by the instruction, of that three quarters by the sums of four where rows are as long as
/// SIFT's. *Correctness*: as of [`within_avx512`](super::within::within_avx512).
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) fn keep_avx512(
    pairs: &[Pair],
    queries: &[i32],
    candidates: &[i32],
    parts: &[i32],
    limits: &[i32],
    kept: &mut [(Pair, i32)],
) -> usize {
    // Without a loop where rows are as long as SIFT's.
    match candidates.len() / parts.len() {
        32 => keep_of_width::<32>(pairs, queries, candidates, parts, limits, kept),
        _ => keep_of_width::<0>(pairs, queries, candidates, parts, limits, kept),
    }
}

/// [`keep_avx512`] where rows have `WIDTH` quads, or any number if that is 0.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn keep_of_width<const WIDTH: usize>(
    pairs: &[Pair],
    queries: &[i32],
    candidates: &[i32],
    parts: &[i32],
    limits: &[i32],
    kept: &mut [(Pair, i32)],
) -> usize {
    let width = match WIDTH {
        0 => candidates.len() / parts.len(),
        width => width,
    };
    let mut count = 0;
    for pairs in pairs.chunks(AT_ONCE) {
        let mut lanes = [_mm512_setzero_si512(); AT_ONCE];
        for (number, lanes) in lanes.iter_mut().enumerate() {
            let pair = pairs[number.min(pairs.len() - 1)];
            let query = &queries[pair.query() * width..][..width];
            let candidate = &candidates[pair.lane() * width..][..width];
            *lanes = lanes_avx512(query, candidate);
        }
        for (&pair, product) in pairs.iter().zip(sums_of_four(lanes)) {
            let distance = parts[pair.lane()] - 2 * product;
            kept[count] = (pair, distance);
            count += usize::from(distance <= limits[pair.query()]);
        }
    }
    count
}

/// Pairs whose products are summed side by side.
const AT_ONCE: usize = 4;

/// The sum of the lanes of each of four vectors.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn sums_of_four([a, b, c, d]: [__m512i; AT_ONCE]) -> [i32; AT_ONCE] {
    let ac = _mm512_add_epi32(_mm512_unpacklo_epi32(a, c), _mm512_unpackhi_epi32(a, c));
    let bd = _mm512_add_epi32(_mm512_unpacklo_epi32(b, d), _mm512_unpackhi_epi32(b, d));
    // In each quarter: sums of a, b, c, d.
    let sums = _mm512_add_epi32(_mm512_unpacklo_epi32(ac, bd), _mm512_unpackhi_epi32(ac, bd));
    let sums = _mm256_add_epi32(
        _mm512_castsi512_si256(sums),
        _mm512_extracti64x4_epi64::<1>(sums),
    );
    let sums = _mm_add_epi32(
        _mm256_castsi256_si128(sums),
        _mm256_extracti128_si256::<1>(sums),
    );
    let mut products = [0; AT_ONCE];
    // SAFETY: 16 bytes can be written to 4 lanes.
    unsafe { _mm_storeu_si128(products.as_mut_ptr().cast(), sums) };
    products
}

/// Sums of products of the bytes of a query and of a candidate, which add up to that of all.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn lanes_avx512(query: &[i32], candidate: &[i32]) -> __m512i {
    assert_eq!(query.len(), candidate.len(), "rows of one width");
    let ((query, last_query), (candidate, last)) =
        (query.as_chunks::<16>(), candidate.as_chunks::<16>());
    let mut sums = _mm512_setzero_si512();
    for (query, candidate) in query.iter().zip(candidate) {
        // SAFETY: 64 bytes can be read from 16 quads.
        let (query, candidate) = unsafe {
            (
                _mm512_loadu_si512(query.as_ptr().cast()),
                _mm512_loadu_si512(candidate.as_ptr().cast()),
            )
        };
        sums = _mm512_dpbusd_epi32(sums, query, candidate);
    }
    if !last.is_empty() {
        let lanes = (1 << last.len()) - 1;
        // SAFETY: no more is read than the quads that are left.
        let (query, candidate) = unsafe {
            (
                _mm512_maskz_loadu_epi32(lanes, last_query.as_ptr()),
                _mm512_maskz_loadu_epi32(lanes, last.as_ptr()),
            )
        };
        sums = _mm512_dpbusd_epi32(sums, query, candidate);
    }
    sums
}

/// The sum of the products of the bytes of a query and of a candidate.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn product(query: &[i32], candidate: &[i32]) -> i32 {
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
    let sums = _mm256_madd_epi16(sums, _mm256_set1_epi16(1));
    let sums = _mm_add_epi32(
        _mm256_castsi256_si128(sums),
        _mm256_extracti128_si256::<1>(sums),
    );
    let sums = _mm_add_epi32(sums, _mm_unpackhi_epi64(sums, sums));
    let sums = _mm_add_epi32(sums, _mm_shuffle_epi32::<1>(sums));
    let mut sum = _mm_cvtsi128_si32(sums);
    for (query, candidate) in last_query.iter().zip(last) {
        let (query, candidate) = (query.to_le_bytes(), candidate.to_le_bytes());
        for (query, candidate) in query.into_iter().zip(candidate) {
            sum += i32::from(query) * i32::from(candidate as i8);
        }
    }
    sum
}
