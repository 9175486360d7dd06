//! Symmetric filters on 8-bit pixels, with sums in single precision.
//!
//! # Both passes in registers
//! A filter of seven weights (ORB's) is written by hand. The sums between the passes stay in registers, and no pixel
//! is moved to another lane to become a number: a lane of 32 bits holds four neighbouring pixels, and masks and shifts
//! take them apart. So four vectors hold every fourth column each. What is to the right of a column of one vector is
//! then in the same lane of the next vector, or one lane further in the first.
//!
//! *Benefit*: with AVX2 0.4 of the time of the portable code, since its sums between the passes are written, and read
//! again at seven places of which most cross cache lines. *Correctness*: each pixel is computed by the operations of
//! the portable code in its order. The middle pixel counts twice, and is multiplied by twice its weight, which rounds
//! alike. A test compares the bits.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;

const LANES: usize = 32;

/// Adding this leaves the rounded integer in the lowest bits of the mantissa.
const ROUND: f32 = 1.5 * (1 << 23) as f32;

/// Weights of one half, with the middle one, of the filter that is written by hand.
#[cfg(target_arch = "x86_64")]
const HALF: usize = 4;
/// Rows, and columns, that a pixel is made of there.
#[cfg(target_arch = "x86_64")]
const AROUND: usize = 2 * HALF - 1;
/// Columns from one to the next of a vector there.
#[cfg(target_arch = "x86_64")]
const STRIDE: usize = 4;

/// The weights, for a middle pixel that is not added to itself.
#[cfg(target_arch = "x86_64")]
fn doubled_middle(half: &[f32; HALF]) -> [f32; HALF] {
    let mut weights = *half;
    weights[0] *= 2.0;
    weights
}

/// [`weigh_rows_u8`] and then [`weigh_along_u8`]: rows have `half.len() - 1` pixels more at each end than `out`.
/// `between` is for what is between the passes; what it holds afterwards means nothing.
///
/// # Panics
/// If the lengths do not fit.
pub fn weigh_both_u8(rows: &[&[u8]], half: &[f32], between: &mut [f32], out: &mut [u8]) {
    #[cfg(target_arch = "x86_64")]
    if let (Ok(rows), Ok(half)) = (rows.try_into(), half.try_into()) {
        let set = InstructionSet::in_use();
        if set >= InstructionSet::Avx512 {
            // SAFETY: what is in use was detected on this processor.
            return unsafe { avx512::weigh_both_u8(rows, half, out) };
        }
        if set >= InstructionSet::Avx2 && out.len() >= avx2::COLUMNS {
            // SAFETY: as before.
            return unsafe { avx2::weigh_both_u8(rows, half, out) };
        }
    }
    weigh_rows_u8(rows, half, between);
    weigh_along_u8(between, half, out);
}

multiversioned! {
    #![avx512]

    /// The vertical pass: the sum, for each column, of `half[k]` times the two rows at distance
    /// `k` from the middle one, which counts twice for `k = 0`.
    ///
    /// # Panics
    /// If there are not `2 half.len() - 1` rows, or one is shorter than `out`.
    pub fn weigh_rows_u8(rows: &[&[u8]], half: &[f32], out: &mut [f32]) {
        assert_eq!(rows.len() + 1, 2 * half.len(), "a row for each weight");
        let mut x = 0;
        while x + LANES <= out.len() {
            rows_block::<LANES>(rows, half, out, x);
            x += LANES;
        }
        if x < out.len() && LANES <= out.len() {
            // The last block again makes some of what is made.
            x = out.len();
            rows_block::<LANES>(rows, half, out, x - LANES);
        }
        while x < out.len() {
            rows_block::<1>(rows, half, out, x);
            x += 1;
        }
    }

    /// The horizontal pass with the same weights, over a row that has `half.len() - 1` pixels more
    /// at each end than `out`; rounded to the nearest integer, half to even. The weights must not
    /// lift a sum out of `0..=255`.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn weigh_along_u8(padded: &[f32], half: &[f32], out: &mut [u8]) {
        assert_eq!(padded.len() + 2, out.len() + 2 * half.len(), "padding for the weights");
        let mut x = 0;
        while x + LANES <= out.len() {
            along_block::<LANES>(padded, half, out, x);
            x += LANES;
        }
        if x < out.len() && LANES <= out.len() {
            x = out.len();
            along_block::<LANES>(padded, half, out, x - LANES);
        }
        while x < out.len() {
            along_block::<1>(padded, half, out, x);
            x += 1;
        }
    }
}

#[inline(always)]
fn rows_block<const L: usize>(rows: &[&[u8]], half: &[f32], out: &mut [f32], x: usize) {
    let radius = half.len() - 1;
    let lanes = |row: usize| {
        rows[row][x..]
            .first_chunk::<L>()
            .expect("rows of one width")
    };
    let mut sum = [0.0; L];
    for (k, &weight) in half.iter().enumerate() {
        let (above, below) = (lanes(radius - k), lanes(radius + k));
        for i in 0..L {
            let both = u16::from(above[i]) + u16::from(below[i]);
            sum[i] = weight.mul_add(f32::from(both), sum[i]);
        }
    }
    out[x..x + L].copy_from_slice(&sum);
}

#[inline(always)]
fn along_block<const L: usize>(padded: &[f32], half: &[f32], out: &mut [u8], x: usize) {
    let radius = half.len() - 1;
    let lanes = |offset: usize| padded[x + offset..].first_chunk::<L>().expect("padding");
    let mut sum = [0.0; L];
    for (k, &weight) in half.iter().enumerate() {
        let (left, right) = (lanes(radius - k), lanes(radius + k));
        for i in 0..L {
            sum[i] = weight.mul_add(left[i] + right[i], sum[i]);
        }
    }
    let out = &mut out[x..x + L];
    for i in 0..L {
        out[i] = (sum[i] + ROUND).to_bits() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    #[test]
    fn blocks_and_single_pixels_are_the_same_bits() {
        let half = [0.15, 0.2, 0.15];
        let mut rng = Seed(2).rng();
        let rows: Vec<Vec<u8>> = (0..5)
            .map(|_| (0..75).map(|_| rng.below(256) as u8).collect())
            .collect();
        let rows: Vec<&[u8]> = rows.iter().map(Vec::as_slice).collect();
        let mut padded = vec![0.0; 75];
        weigh_rows_u8(&rows, &half, &mut padded);
        let pair = |a: u8, b: u8| f32::from(u16::from(a) + u16::from(b));
        for (x, &value) in padded.iter().enumerate() {
            let inner = half[0].mul_add(pair(rows[2][x], rows[2][x]), 0.0);
            let middle = half[1].mul_add(pair(rows[1][x], rows[3][x]), inner);
            assert_eq!(value, half[2].mul_add(pair(rows[0][x], rows[4][x]), middle));
        }
        let mut out = vec![0; 71];
        weigh_along_u8(&padded, &half, &mut out);
        for (p, &value) in padded.windows(5).zip(&out) {
            let inner = half[0].mul_add(p[2] + p[2], 0.0);
            let middle = half[1].mul_add(p[1] + p[3], inner);
            let sum = half[2].mul_add(p[0] + p[4], middle);
            assert_eq!(f32::from(value), sum.round_ties_even());
        }
    }

    #[test]
    fn both_passes_are_the_same_bits_in_all_sets() {
        let mut rng = Seed(6).rng();
        for half in [&[0.08, 0.16, 0.12, 0.14][..], &[0.15, 0.2, 0.15]] {
            let radius = half.len() - 1;
            for width in (1..100).chain([200]) {
                let read = width + 2 * radius;
                let rows: Vec<Vec<u8>> = (0..=2 * radius)
                    .map(|_| (0..read).map(|_| rng.below(256) as u8).collect())
                    .collect();
                let rows: Vec<&[u8]> = rows.iter().map(Vec::as_slice).collect();
                let mut between = vec![0.0; read];
                let mut expected = vec![0; width];
                weigh_rows_u8(&rows, half, &mut between);
                weigh_along_u8(&between, half, &mut expected);
                InstructionSet::for_each(|set| {
                    let mut out = vec![0; width];
                    weigh_both_u8(&rows, half, &mut between, &mut out);
                    assert_eq!(out, expected, "{set:?}, {width} pixels");
                });
            }
        }
    }
}
