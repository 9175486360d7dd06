//! The two nearest by Euclidean distance, where all values are integers in `0..=255`.
//!
//! With `|a - b|^2 = |a|^2 + |b|^2 - 2 a.b` each instruction multiplies and adds sixteen pairs of
//! 16-bit integers. Candidates are stored times minus two and the sums start at the squared
//! norms, so the last addition leaves the squared distance.

use std::arch::x86_64::{
    __m256i, _mm256_add_epi32, _mm256_cvtepi32_ps, _mm256_loadu_si256, _mm256_madd_epi16,
    _mm256_set1_epi32, _mm256_storeu_ps,
};

use super::{TILE_BYTES, TwoNearest, pack};

/// Candidates of a panel: two vectors of eight.
const LANES: usize = 16;

/// Queries of a block: with two vectors each, twelve of sixteen registers hold sums.
const ROWS: usize = 6;

/// Longest row whose squared distances (at most `255^2` per value) and all their partial sums are
/// exact in `f32`.
const MAX_DIM: usize = (1 << 24) / (255 * 255);

/// What [`super::two_nearest_floats`] returns, or `None` where some value is not a byte, the rows
/// are too long to be exact, or the processor lacks AVX2.
pub(super) fn two_nearest(a: &[f32], b: &[f32], dim: usize) -> Option<Vec<TwoNearest>> {
    let possible = dim <= MAX_DIM && std::arch::is_x86_feature_detected!("avx2");
    if !(possible && are_bytes(a) && are_bytes(b)) {
        return None;
    }
    let count = b.len() / dim;
    let pairs = dim.div_ceil(2);
    let (a_norms, b_norms) = (squared_norms(a, dim), squared_norms(b, dim));
    let a = pair_up(a, dim, 1);
    let panels = pack(&pair_up(b, dim, -2), pairs);
    let panel_norms = pack(&b_norms, 1);

    let mut best = vec![TwoNearest::none(f32::INFINITY); a_norms.len()];
    let tile = (TILE_BYTES / size_of::<i32>() / pairs).max(ROWS);
    let a_tiles = a.chunks(tile * pairs).zip(a_norms.chunks(tile));
    for ((a, a_norms), best) in a_tiles.zip(best.chunks_mut(tile)) {
        let panels = panels.chunks_exact(pairs).zip(&panel_norms);
        for ((panel, b_norms), first) in panels.zip((0..).step_by(LANES)) {
            // SAFETY: AVX2 was detected on this processor.
            unsafe { scan(a, a_norms, panel, b_norms, first, count, best) };
        }
    }
    Some(best)
}

multiversioned! {
    /// Whether all values are integers in `0..=255`.
    fn are_bytes(values: &[f32]) -> bool {
        values.chunks(1024).all(|values| {
            values
                .iter()
                .fold(true, |all, &value| all & (f32::from(value as u8) == value))
        })
    }
}

/// Squared norm of each row.
fn squared_norms(rows: &[f32], dim: usize) -> Vec<i32> {
    let squared_norm = |row: &[f32]| row.iter().map(|&value| value as i32 * value as i32).sum();
    rows.chunks_exact(dim).map(squared_norm).collect()
}

/// Rows of 16-bit integers times `factor`, two in each `i32`; an odd row ends with a zero.
fn pair_up(rows: &[f32], dim: usize, factor: i32) -> Vec<i32> {
    let half = |value: f32| value as i32 * factor;
    rows.chunks_exact(dim)
        .flat_map(|row| row.chunks(2))
        .map(|pair| half(pair[0]) & 0xffff | half(*pair.get(1).unwrap_or(&0.0)) << 16)
        .collect()
}

/// Offers the candidates of one panel to the queries `a`.
#[target_feature(enable = "avx2")]
fn scan(
    a: &[i32],
    a_norms: &[i32],
    panel: &[[i32; LANES]],
    b_norms: &[i32; LANES],
    first: usize,
    count: usize,
    best: &mut [TwoNearest],
) {
    let pairs = panel.len();
    let blocks = a.chunks(ROWS * pairs).zip(a_norms.chunks(ROWS));
    for ((rows, norms), best) in blocks.zip(best.chunks_mut(ROWS)) {
        // The last block repeats its last row; the zip below drops what is too much.
        let row_or_last = |row: usize| row.min(norms.len() - 1);
        let rows: [&[i32]; ROWS] =
            std::array::from_fn(|row| &rows[row_or_last(row) * pairs..][..pairs]);
        let mut sums: [[__m256i; 2]; ROWS] = std::array::from_fn(|row| {
            let norm = _mm256_set1_epi32(norms[row_or_last(row)]);
            load(b_norms).map(|b_norms| _mm256_add_epi32(norm, b_norms))
        });
        for k in 0..pairs {
            let candidates = load(&panel[k]);
            for row in 0..ROWS {
                let query = _mm256_set1_epi32(rows[row][k]);
                for half in 0..2 {
                    let products = _mm256_madd_epi16(query, candidates[half]);
                    sums[row][half] = _mm256_add_epi32(sums[row][half], products);
                }
            }
        }
        for (best, sums) in best.iter_mut().zip(sums) {
            let mut distances = [0.0; LANES];
            let (halves, _) = distances.as_chunks_mut::<8>();
            for (half, sums) in halves.iter_mut().zip(sums) {
                // SAFETY: `half` is 32 bytes long.
                unsafe { _mm256_storeu_ps(half.as_mut_ptr(), _mm256_cvtepi32_ps(sums)) };
            }
            best.offer_lanes(&distances, first, count);
        }
    }
}

/// Two vectors of eight lanes.
#[inline]
#[target_feature(enable = "avx2")]
fn load(lanes: &[i32; LANES]) -> [__m256i; 2] {
    let start = lanes.as_ptr();
    // SAFETY: 32 bytes can be read from lane 0 and from lane 8 of 16 lanes of 4 bytes.
    unsafe {
        [
            _mm256_loadu_si256(start.cast()),
            _mm256_loadu_si256(start.add(8).cast()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bytes_are_bytes() {
        assert!(are_bytes(&[]) && are_bytes(&[0.0, -0.0, 1.0, 255.0]));
        for value in [-1.0, 0.5, 256.0, 300.0, f32::NAN, f32::INFINITY] {
            assert!(!are_bytes(&[0.0, value]), "{value}");
        }
    }

    #[test]
    fn rows_too_long_to_be_exact_are_refused() {
        assert_eq!(MAX_DIM, 258);
        assert!(two_nearest(&[255.0; 259], &[0.0; 259], 259).is_none());
    }
}
