//! Which pairs of a query and a candidate remain, when they are compared by the bytes of all their values.
//!
//! *How it works.* After the principal components, few candidates of a panel are left, each for a few queries, so
//! there is nothing to share. Each pair is a product of two rows, whose lanes are summed up, those of four such products
//! together.

pub(super) mod avx2;
pub(super) mod avx512;

use std::arch::x86_64::{
    __m256i, _mm_add_epi32, _mm_storeu_si128, _mm256_castsi256_si128, _mm256_extracti128_si256,
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

/// The rows of pairs, as bytes.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    /// Of the queries, one after the other.
    pub(super) queries: &'a [i32],
    /// Of each query the largest squared distance, less its own part of it.
    pub(super) limits: &'a [i32],
    /// Of the candidates of a panel, one after the other.
    pub(super) candidates: &'a [i32],
    /// Their parts of squared distances.
    pub(super) parts: &'a [i32],
}

impl Rows<'_> {
    /// Quads of a row.
    #[inline]
    fn width(&self) -> usize {
        self.candidates.len() / self.parts.len()
    }
}

/// Pairs whose products are summed side by side.
const AT_ONCE: usize = 4;

/// The sums of four pairs, of which either half of the lanes has a part.
#[inline]
#[target_feature(enable = "avx2")]
fn sum_of_halves(sums: __m256i) -> [i32; AT_ONCE] {
    let sums = _mm_add_epi32(
        _mm256_castsi256_si128(sums),
        _mm256_extracti128_si256::<1>(sums),
    );
    let mut products = [0; AT_ONCE];
    // SAFETY: 16 bytes can be written to 4 lanes.
    unsafe { _mm_storeu_si128(products.as_mut_ptr().cast(), sums) };
    products
}

/// Keeps those pairs of a query and a candidate of a panel whose squared distance in bytes, less the query's part of it,
/// is at most the query's limit, and returns how many. Rows have `WIDTH` quads, or any
/// number if that is 0: without a loop where rows are as long as SIFT's. Without branches, whose outcome nobody could
/// predict.
///
/// `lanes` are sums of products of the bytes of a query and of a candidate, `none` of nothing, and `sums` add those of four
/// pairs up.
#[inline(always)]
fn keep_of_width<const WIDTH: usize, V: Copy>(
    pairs: &[Pair],
    rows: Rows<'_>,
    kept: &mut [(Pair, i32)],
    none: V,
    lanes: impl Fn(&[i32], &[i32]) -> V,
    sums: impl Fn([V; AT_ONCE]) -> [i32; AT_ONCE],
) -> usize {
    let width = match WIDTH {
        0 => rows.width(),
        width => width,
    };
    let mut count = 0;
    for pairs in pairs.chunks(AT_ONCE) {
        let mut of_pairs = [none; AT_ONCE];
        for (number, of_pair) in of_pairs.iter_mut().enumerate() {
            let pair = pairs[number.min(pairs.len() - 1)];
            let query = &rows.queries[pair.query() * width..][..width];
            *of_pair = lanes(query, &rows.candidates[pair.lane() * width..][..width]);
        }
        let products = sums(of_pairs);
        for (&pair, product) in pairs.iter().zip(products) {
            let distance = rows.parts[pair.lane()] - 2 * product;
            kept[count] = (pair, distance);
            count += usize::from(distance <= rows.limits[pair.query()]);
        }
    }
    count
}
