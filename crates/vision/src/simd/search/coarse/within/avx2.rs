//! With vectors of 32 bytes.
//!
//! *How it works.* An instruction multiplies bytes and adds two products in 16 bits, which also hold the sum of all
//! products of two rows (see [`Grid`](super::super::grid::Grid)). So panels are [arranged](arrange) in words of two bytes,
//! sixteen candidates in a vector, and each word of a query is there [twice](twice), to fill a lane of 32 bits.

use std::arch::x86_64::{
    __m256i, _mm256_add_epi16, _mm256_add_epi32, _mm256_adds_epi16, _mm256_castsi256_ps,
    _mm256_castsi256_si128, _mm256_cmpgt_epi16, _mm256_cmpgt_epi32, _mm256_cvtepi16_epi32,
    _mm256_extracti128_si256, _mm256_loadu_si256, _mm256_maddubs_epi16, _mm256_max_epi32,
    _mm256_min_epi32, _mm256_movemask_epi8, _mm256_movemask_ps, _mm256_packs_epi16,
    _mm256_packs_epi32, _mm256_permute4x64_epi64, _mm256_set1_epi16, _mm256_set1_epi32,
    _mm256_setzero_si256, _mm256_srai_epi32, _mm256_storeu_si256, _mm256_sub_epi32,
};

use super::{LANES, Panel, ROWS, by_blocks, rows, second_of};

/// Rearranges the quads of a panel's candidates: first both lower bytes of all, then both upper bytes. Of each 32
/// candidates one vector has 0 to 7 and 16 to 23 and the next has the others, which is the order in which AVX2 packs
/// vectors.
pub(in super::super) fn arrange(panel: &mut [[i32; LANES]]) {
    for quads in panel {
        let of = *quads;
        let (words, _) = quads.as_chunks_mut::<{ LANES / 2 }>();
        for (pair, first) in (0..LANES).step_by(2).enumerate() {
            // Of each 32 candidates the second and the third eight change places.
            let from = match first / 8 % 4 {
                1 => first + 8,
                2 => first - 8,
                _ => first,
            };
            let [even, odd] = [of[from], of[from + 1]];
            words[0][pair] = (even & 0xffff) | (odd << 16);
            words[1][pair] = (even >> 16 & 0xffff) | (odd & !0xffff);
        }
    }
}

/// Both words of two bytes of each quad, each of them twice.
pub(in super::super) fn twice(quads: &[i32]) -> Vec<i32> {
    let mut twice = vec![0; 2 * quads.len()];
    for (words, quad) in twice.as_chunks_mut().0.iter_mut().zip(quads) {
        let low = quad & 0xffff;
        let high = quad & !0xffff;
        *words = [low | (low << 16), high | (high >> 16 & 0xffff)];
    }
    twice
}

/// For each query, block by block, one bit for each candidate of an [arranged](arrange) panel, the first lowest: whether
/// the sum of the products of their bytes and the candidate's of `starts` is at least the query's of `least`. Both are
/// cut off where 16 bits end, so some more may be told to be within. Queries are there [twice](twice).
#[inline]
#[target_feature(enable = "avx2,fma")]
pub(in super::super) fn within(
    words: &[i32],
    least: &[[i32; ROWS]],
    panel: &[[i32; LANES]],
    starts: &[i32; LANES],
    within: &mut [[u64; ROWS]],
) {
    // The width is known where rows are principal components or as long as SIFT's.
    match panel.len() {
        8 => within_of_width::<8>(words, least, panel, starts, within),
        32 => within_of_width::<32>(words, least, panel, starts, within),
        _ => within_of_width::<0>(words, least, panel, starts, within),
    }
}

/// [`within`] where rows have `WIDTH` quads, or any number if that is 0.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn within_of_width<const WIDTH: usize>(
    words: &[i32],
    least: &[[i32; ROWS]],
    panel: &[[i32; LANES]],
    starts: &[i32; LANES],
    within: &mut [[u64; ROWS]],
) {
    // Sums of products fit 16 bits, halves of what they start at do too; one far below is raised, which is safe.
    let narrow = |lanes: [__m256i; 2]| {
        let packed = _mm256_packs_epi32(lanes[0], lanes[1]);
        _mm256_permute4x64_epi64::<0b11_01_10_00>(packed)
    };
    let starts: [[__m256i; 2]; GROUPS] = std::array::from_fn(|group| {
        let first = 32 * (group / 2) + 8 * (group % 2);
        let starts = [load(&starts[first..]), load(&starts[first + 16..])];
        let halves = starts.map(|starts| _mm256_srai_epi32::<1>(starts));
        let others = [0, 1].map(|lanes| _mm256_sub_epi32(starts[lanes], halves[lanes]));
        [narrow(halves), narrow(others)]
    });
    by_blocks(words, least, 2 * panel.len(), within, |words, least| {
        block::<WIDTH>(words, least, panel, &starts)
    });
}

/// Groups of sixteen candidates in an [arranged](arrange) panel.
const GROUPS: usize = LANES / 16;

#[inline]
#[target_feature(enable = "avx2,fma")]
fn block<const WIDTH: usize>(
    words: &[i32],
    least: &[i32; ROWS],
    panel: &[[i32; LANES]],
    starts: &[[__m256i; 2]; GROUPS],
) -> [u64; ROWS] {
    let least =
        least.map(|least| _mm256_set1_epi16(least.clamp(i16::MIN.into(), i16::MAX.into()) as i16));
    let mut within = [0; ROWS];
    for half in 0..2 {
        let mut sums = sums::<WIDTH>(words, panel, half);
        for row in 0..ROWS {
            for group in 0..2 {
                let starts = &starts[2 * half + group];
                let sums = &mut sums[row][group];
                *sums = _mm256_adds_epi16(_mm256_adds_epi16(*sums, starts[0]), starts[1]);
                *sums = _mm256_cmpgt_epi16(least[row], *sums);
            }
            let far = _mm256_packs_epi16(sums[row][0], sums[row][1]);
            let near = !_mm256_movemask_epi8(far) as u32;
            within[row] |= u64::from(near) << (32 * half);
        }
    }
    within
}

/// For each query of a block the sums of products of both groups of 32 candidates.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn sums<const WIDTH: usize>(
    words: &[i32],
    panel: &[[i32; LANES]],
    half: usize,
) -> [[__m256i; 2]; ROWS] {
    let width = match WIDTH {
        0 => panel.len(),
        width => width,
    };
    let rows = rows(words, 2 * width);
    let mut sums = [[_mm256_setzero_si256(); 2]; ROWS];
    for (k, candidates) in panel[..width].iter().enumerate() {
        for word in 0..2 {
            let first = 32 * word + 16 * half;
            let candidates = [load(&candidates[first..]), load(&candidates[first + 8..])];
            for row in 0..ROWS {
                let query = _mm256_set1_epi32(rows[row][2 * k + word]);
                for group in 0..2 {
                    let products = _mm256_maddubs_epi16(query, candidates[group]);
                    sums[row][group] = _mm256_add_epi16(sums[row][group], products);
                }
            }
        }
    }
    sums
}

/// The first candidates of some queries, of which nothing is known yet: those in `panels`. Both are as for [`within`]. Calls
/// `least` with each query and its second largest sum of all, which is that of the second nearest candidate, and compares
/// all sums with what this returns: `found` gets what [`within`] would, for each panel. No candidate is looked at by itself:
/// the two largest of each of 8 lanes are kept, and the second largest of all is among them.
#[target_feature(enable = "avx2,fma")]
pub(in super::super) fn within_first(
    words: &[i32],
    panels: &[Panel],
    least: impl FnMut(usize, i32) -> i32,
    found: &mut [Vec<[u64; ROWS]>],
) {
    match panels[0].0.len() {
        32 => within_first_of_width::<32>(words, panels, least, found),
        _ => within_first_of_width::<0>(words, panels, least, found),
    }
}

/// [`within_first`] where rows have `WIDTH` quads, or any number if that is 0.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn within_first_of_width<const WIDTH: usize>(
    words: &[i32],
    panels: &[Panel],
    mut least: impl FnMut(usize, i32) -> i32,
    found: &mut [Vec<[u64; ROWS]>],
) {
    let width = match WIDTH {
        0 => panels[0].0.len(),
        width => width,
    };
    let mut all = vec![[[0; LANES]; ROWS]; panels.len()];
    for (block, words) in words.chunks_exact(2 * ROWS * width).enumerate() {
        let mut most = [[_mm256_set1_epi32(i32::MIN); 2]; ROWS];
        for ((panel, starts), all) in panels.iter().zip(&mut all) {
            for half in 0..2 {
                let sums = sums::<WIDTH>(words, panel, half);
                for row in 0..ROWS {
                    let [most, next] = &mut most[row];
                    for group in 0..2 {
                        let first = 32 * half + 8 * group;
                        let both = [
                            _mm256_castsi256_si128(sums[row][group]),
                            _mm256_extracti128_si256::<1>(sums[row][group]),
                        ];
                        for (eight, first) in [first, first + 16].into_iter().enumerate() {
                            let sums = _mm256_cvtepi16_epi32(both[eight]);
                            let sums = _mm256_add_epi32(sums, load(&starts[first..]));
                            *next = _mm256_max_epi32(*next, _mm256_min_epi32(*most, sums));
                            *most = _mm256_max_epi32(*most, sums);
                            store(&mut all[row][first..], sums);
                        }
                    }
                }
            }
        }
        for row in 0..ROWS {
            let mut lanes = [[0_i32; 8]; 2];
            for (lanes, most) in lanes.iter_mut().zip(most[row]) {
                store(lanes, most);
            }
            let least = least(ROWS * block + row, second_of(lanes.as_flattened()));
            let least = _mm256_set1_epi32(least);
            for (all, found) in all.iter().zip(&mut *found) {
                let mut within = 0;
                for (eighth, sums) in all[row].as_chunks::<8>().0.iter().enumerate() {
                    let far = _mm256_cmpgt_epi32(least, load(sums));
                    let near = !_mm256_movemask_ps(_mm256_castsi256_ps(far)) as u8;
                    within |= u64::from(near) << (8 * eighth);
                }
                found[block][row] = within;
            }
        }
    }
}

/// Writes the first eight lanes.
#[inline]
#[target_feature(enable = "avx2")]
fn store(lanes: &mut [i32], values: __m256i) {
    let lanes = lanes[..8].as_mut_ptr();
    // SAFETY: 32 bytes can be written to 8 lanes of 4 bytes.
    unsafe { _mm256_storeu_si256(lanes.cast(), values) };
}

/// The first eight lanes.
#[inline]
#[target_feature(enable = "avx2")]
fn load(lanes: &[i32]) -> __m256i {
    let lanes = lanes[..8].as_ptr();
    // SAFETY: 32 bytes can be read from 8 lanes of 4 bytes.
    unsafe { _mm256_loadu_si256(lanes.cast()) }
}
