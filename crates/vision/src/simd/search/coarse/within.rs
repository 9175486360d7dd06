//! Which candidates of a panel may be within the bounds of a block of queries.
//!
//! *How it works.* With `|a - b|^2 = |a|^2 + |b|^2 - 2 a.b` a candidate is within the bound of a query if the
//! products of their bytes sum up to enough. Sums start at minus half of the candidate's part of the distance, so
//! each has only to be compared with one number of its query. A panel has as many lanes as sums of a whole block fit
//! into the registers of AVX-512. So each value of a query that is loaded serves all lanes, and each vector of a
//! panel serves all queries; the units that multiply do not have to wait. AVX2 has half as many registers of half the
//! size, and takes a quarter of the lanes at a time.

use std::arch::x86_64::{
    __m256i, __m512i, _mm256_add_epi16, _mm256_add_epi32, _mm256_castsi256_ps, _mm256_cmpgt_epi32,
    _mm256_loadu_si256, _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_max_epi32,
    _mm256_min_epi32, _mm256_movemask_ps, _mm256_set1_epi16, _mm256_set1_epi32,
    _mm256_setzero_si256, _mm256_storeu_si256, _mm512_cmpge_epi32_mask, _mm512_dpbusd_epi32,
    _mm512_loadu_si512, _mm512_max_epi32, _mm512_min_epi32, _mm512_set1_epi32, _mm512_storeu_si512,
};

/// Candidates of a panel: four vectors of sixteen, or eight of eight.
pub(super) const LANES: usize = 64;

/// Queries of a block: with four vectors each, 24 of 32 registers hold sums; of AVX2, with two vectors
/// each, twelve of sixteen.
pub(super) const ROWS: usize = 6;

/// For each query, block by block, one bit for each candidate of a panel, the first lowest: whether the sum of
/// the products of their bytes and the candidate's of `starts` is at least the query's of `least`.
#[inline]
#[target_feature(enable = "avx2,fma")]
pub(super) fn within(
    quads: &[i32],
    least: &[[i32; ROWS]],
    panel: &[[i32; LANES]],
    starts: &[i32; LANES],
    within: &mut [[u64; ROWS]],
) {
    by_blocks(quads, least, panel.len(), within, |quads, least| {
        block(quads, least, panel, starts)
    });
}

/// Looks at the queries block by block; `width` is that of their rows.
#[inline(always)]
fn by_blocks(
    quads: &[i32],
    least: &[[i32; ROWS]],
    width: usize,
    within: &mut [[u64; ROWS]],
    block: impl Fn(&[i32], &[i32; ROWS]) -> [u64; ROWS],
) {
    let blocks = quads.chunks_exact(ROWS * width);
    for ((within, least), quads) in within.iter_mut().zip(least).zip(blocks) {
        *within = block(quads, least);
    }
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn block(
    quads: &[i32],
    least: &[i32; ROWS],
    panel: &[[i32; LANES]],
    starts: &[i32; LANES],
) -> [u64; ROWS] {
    let rows = rows(quads, panel.len());
    let mut within = [0; ROWS];
    for first in (0..LANES).step_by(16) {
        let sums = sums(&rows, panel, first);
        let starts = load(starts, first);
        for row in 0..ROWS {
            let least = _mm256_set1_epi32(least[row]);
            for half in 0..2 {
                let sums = complete(sums[row][half], starts[half]);
                let far = _mm256_castsi256_ps(_mm256_cmpgt_epi32(least, sums));
                let near = !_mm256_movemask_ps(far) as u8;
                within[row] |= u64::from(near) << (first + 8 * half);
            }
        }
    }
    within
}

/// For each query of a block the sums of products of sixteen lanes from `first` on: of each candidate two that belong
/// together.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn sums(rows: &[&[i32]; ROWS], panel: &[[i32; LANES]], first: usize) -> [[__m256i; 2]; ROWS] {
    let mut sums = [[_mm256_setzero_si256(); 2]; ROWS];
    for (k, candidates) in panel.iter().enumerate() {
        let candidates = load(candidates, first);
        for row in 0..ROWS {
            let query = _mm256_set1_epi32(rows[row][k]);
            for half in 0..2 {
                let products = _mm256_maddubs_epi16(query, candidates[half]);
                sums[row][half] = _mm256_add_epi16(sums[row][half], products);
            }
        }
    }
    sums
}

/// Both sums of each candidate, and what they start at.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn complete(sums: __m256i, starts: __m256i) -> __m256i {
    _mm256_add_epi32(starts, _mm256_madd_epi16(sums, _mm256_set1_epi16(1)))
}

/// [`within`] with one instruction for the products of 64 bytes and their sums.
///
/// *Benefit*: a fifth of the instructions. *Correctness*: sums of 32 bits hold what those of 16 bits
/// hold, so all integers are the same.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) fn within_avx512(
    quads: &[i32],
    least: &[[i32; ROWS]],
    panel: &[[i32; LANES]],
    starts: &[i32; LANES],
    within: &mut [[u64; ROWS]],
) {
    by_blocks(quads, least, panel.len(), within, |quads, least| {
        block_avx512(quads, least, panel, starts)
    });
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn block_avx512(
    quads: &[i32],
    least: &[i32; ROWS],
    panel: &[[i32; LANES]],
    starts: &[i32; LANES],
) -> [u64; ROWS] {
    let sums = sums_avx512(quads, panel, starts);
    let mut within = [0; ROWS];
    for row in 0..ROWS {
        let least = _mm512_set1_epi32(least[row]);
        for (quarter, &sums) in sums[row].iter().enumerate() {
            let near = _mm512_cmpge_epi32_mask(sums, least);
            within[row] |= u64::from(near) << (16 * quarter);
        }
    }
    within
}

/// For each query of a block the sums of all lanes.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn sums_avx512(
    quads: &[i32],
    panel: &[[i32; LANES]],
    starts: &[i32; LANES],
) -> [[__m512i; 4]; ROWS] {
    let rows = rows(quads, panel.len());
    let quarters = |lanes: &[i32; LANES]| {
        let start: *const i32 = lanes.as_ptr();
        // SAFETY: 64 bytes can be read from lanes 0, 16, 32, and 48 of 64 lanes of 4 bytes.
        unsafe {
            [
                _mm512_loadu_si512(start.cast()),
                _mm512_loadu_si512(start.add(16).cast()),
                _mm512_loadu_si512(start.add(32).cast()),
                _mm512_loadu_si512(start.add(48).cast()),
            ]
        }
    };
    let mut sums = [quarters(starts); ROWS];
    for (k, candidates) in panel.iter().enumerate() {
        let candidates = quarters(candidates);
        for row in 0..ROWS {
            let query = _mm512_set1_epi32(rows[row][k]);
            for quarter in 0..4 {
                sums[row][quarter] =
                    _mm512_dpbusd_epi32(sums[row][quarter], query, candidates[quarter]);
            }
        }
    }
    sums
}

/// For each query, block by block, the second largest sum of all lanes of all `panels`: of the second nearest of
/// their candidates. No candidate is looked at by itself: the two largest of each of 8 lanes are kept, and the second
/// largest of all is among them.
#[target_feature(enable = "avx2,fma")]
pub(super) fn second_sums(
    quads: &[i32],
    panels: &[(&[[i32; LANES]], &[i32; LANES])],
    second: &mut [[i32; ROWS]],
) {
    let width = panels[0].0.len();
    for (second, quads) in second.iter_mut().zip(quads.chunks_exact(ROWS * width)) {
        let rows = rows(quads, width);
        let mut most = [[_mm256_set1_epi32(i32::MIN); 2]; ROWS];
        for (panel, starts) in panels {
            for first in (0..LANES).step_by(16) {
                let sums = sums(&rows, panel, first);
                let starts = load(starts, first);
                for ([most, next], sums) in most.iter_mut().zip(sums) {
                    for half in 0..2 {
                        let sums = complete(sums[half], starts[half]);
                        *next = _mm256_max_epi32(*next, _mm256_min_epi32(*most, sums));
                        *most = _mm256_max_epi32(*most, sums);
                    }
                }
            }
        }
        for (second, most) in second.iter_mut().zip(most) {
            let mut lanes = [[0_i32; 8]; 2];
            for (lanes, most) in lanes.iter_mut().zip(most) {
                // SAFETY: 32 bytes can be written to 8 lanes.
                unsafe { _mm256_storeu_si256(lanes.as_mut_ptr().cast(), most) };
            }
            *second = second_of(lanes.as_flattened());
        }
    }
}

/// [`second_sums`] with vectors of 64 bytes. *Correctness*: as of [`within_avx512`].
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) fn second_sums_avx512(
    quads: &[i32],
    panels: &[(&[[i32; LANES]], &[i32; LANES])],
    second: &mut [[i32; ROWS]],
) {
    let width = panels[0].0.len();
    for (second, quads) in second.iter_mut().zip(quads.chunks_exact(ROWS * width)) {
        let mut most = [[_mm512_set1_epi32(i32::MIN); 2]; ROWS];
        for (panel, starts) in panels {
            let sums = sums_avx512(quads, panel, starts);
            for ([most, next], sums) in most.iter_mut().zip(sums) {
                for sums in sums {
                    *next = _mm512_max_epi32(*next, _mm512_min_epi32(*most, sums));
                    *most = _mm512_max_epi32(*most, sums);
                }
            }
        }
        for (second, most) in second.iter_mut().zip(most) {
            let mut lanes = [[0_i32; 16]; 2];
            for (lanes, most) in lanes.iter_mut().zip(most) {
                // SAFETY: 64 bytes can be written to 16 lanes.
                unsafe { _mm512_storeu_si512(lanes.as_mut_ptr().cast(), most) };
            }
            *second = second_of(lanes.as_flattened());
        }
    }
}

/// The second largest.
#[inline(always)]
fn second_of(values: &[i32]) -> i32 {
    let (mut most, mut next) = (i32::MIN, i32::MIN);
    for &value in values {
        next = next.max(most.min(value));
        most = most.max(value);
    }
    next
}

/// The rows of a block.
#[inline]
fn rows(quads: &[i32], width: usize) -> [&[i32]; ROWS] {
    let mut rows = [quads; ROWS];
    for (number, row) in rows.iter_mut().enumerate() {
        *row = &quads[number * width..][..width];
    }
    rows
}

/// Two vectors of eight lanes, from lane `first` on.
#[inline]
#[target_feature(enable = "avx2")]
fn load(lanes: &[i32; LANES], first: usize) -> [__m256i; 2] {
    let start = lanes[first..][..16].as_ptr();
    // SAFETY: 32 bytes can be read from lane 0 and from lane 8 of 16 lanes of 4 bytes.
    unsafe {
        [
            _mm256_loadu_si256(start.cast()),
            _mm256_loadu_si256(start.add(8).cast()),
        ]
    }
}
