//! Bilinear interpolation between 8-bit pixels, exact with weights of 8 bits.

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;

/// Where a pixel of the output lies among those of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Between {
    /// The input pixel before it.
    pub first: u32,
    /// Weight of the input pixel after it, in 256ths; that of `first` makes it 256.
    pub weight: u16,
}

multiversioned! {
    /// `between[x] = (256 - weight) first[x] + weight second[x]`, in 256ths.
    ///
    /// # Panics
    /// If a row is shorter than `between` or `weight` is above 256.
    pub fn blend_rows(first: &[u8], second: &[u8], weight: u16, between: &mut [u16]) {
        assert!(weight <= 256, "weights are in 256ths");
        let (first, second) = (&first[..between.len()], &second[..between.len()]);
        for (x, between) in between.iter_mut().enumerate() {
            *between = (256 - weight) * u16::from(first[x]) + weight * u16::from(second[x]);
        }
    }
}

/// Pixels that [`BlendColumns`] reads at once, and how many it may read beyond the end of a row.
pub const COLUMNS_AT_ONCE: usize = 8;

/// Interpolation along rows, prepared for rows of one length.
#[derive(Clone, Debug)]
pub struct BlendColumns {
    positions: Vec<Between>,
    /// Eight outputs each, from the left on; read by the versions in intrinsics.
    #[cfg_attr(not(target_arch = "x86_64"), expect(dead_code))]
    blocks: Vec<Block>,
}

/// Eight outputs, as two halves of four whose inputs lie within eight pixels.
#[derive(Clone, Debug)]
struct Block {
    /// First of the eight pixels, for each half.
    starts: [u32; 2],
    /// For each output the four bytes of its two inputs, counted from the start of its half.
    shuffle: [u8; 32],
    /// For each output the weights of its two inputs.
    weights: [i16; 16],
}

impl BlendColumns {
    /// Interpolation at the given ascending positions.
    pub fn new(positions: Vec<Between>) -> Self {
        let blocks = positions
            .as_chunks::<8>()
            .0
            .iter()
            .map_while(Block::new)
            .collect();
        Self { positions, blocks }
    }

    /// The pixels of `out` between those of `row`, which are in 256ths, rounded half up.
    ///
    /// # Panics
    /// If `row` has fewer than [`COLUMNS_AT_ONCE`] pixels after the last position's first one, or
    /// if `out` has not as many pixels as there are positions.
    pub fn apply(&self, row: &[u16], out: &mut [u8]) {
        assert_eq!(
            out.len(),
            self.positions.len(),
            "one pixel for each position"
        );
        #[cfg(target_arch = "x86_64")]
        let done = if InstructionSet::in_use() >= InstructionSet::Avx2 {
            // SAFETY: what is in use was detected on this processor.
            unsafe { avx2::blend(&self.blocks, row, out) };
            8 * self.blocks.len()
        } else {
            0
        };
        #[cfg(not(target_arch = "x86_64"))]
        let done = 0;
        blend_scalar(&self.positions[done..], row, &mut out[done..]);
    }
}

impl Block {
    /// `None` if four inputs do not lie within eight pixels: where the image is made more than
    /// twice smaller.
    fn new(positions: &[Between; 8]) -> Option<Self> {
        let mut block = Self {
            starts: [positions[0].first, positions[4].first],
            shuffle: [0; 32],
            weights: [0; 16],
        };
        for (i, at) in positions.iter().enumerate() {
            let byte = 2 * (at.first - block.starts[i / 4]) as usize;
            if byte > 12 {
                return None;
            }
            for k in 0..4 {
                block.shuffle[4 * i + k] = (byte + k) as u8;
            }
            block.weights[2 * i] = 256 - at.weight as i16;
            block.weights[2 * i + 1] = at.weight as i16;
        }
        Some(block)
    }
}

/// The definition.
fn blend_scalar(positions: &[Between], row: &[u16], out: &mut [u8]) {
    for (out, at) in out.iter_mut().zip(positions) {
        let first = at.first as usize;
        let weight = u32::from(at.weight);
        let sum = (256 - weight) * u32::from(row[first]) + weight * u32::from(row[first + 1]);
        *out = ((sum + (1 << 15)) >> 16) as u8;
    }
}

/// *Benefit*: one byte shuffle fetches the inputs of four outputs; 4 times the speed of the
/// portable code, which fetches them one by one.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m128i, __m256i, _mm256_add_epi32, _mm256_extract_epi32, _mm256_madd_epi16,
        _mm256_packs_epi32, _mm256_packus_epi16, _mm256_set_m128i, _mm256_set1_epi16,
        _mm256_set1_epi32, _mm256_shuffle_epi8, _mm256_srli_epi32, _mm256_xor_si256,
    };
    use std::mem::transmute;

    use super::{Block, COLUMNS_AT_ONCE};

    #[target_feature(enable = "avx2")]
    pub(super) fn blend(blocks: &[Block], row: &[u16], out: &mut [u8]) {
        // Products are signed, so inputs are taken relative to 2^15; as the weights sum to 256
        // that is 2^23 in all. Rounding adds 2^15.
        let sign = _mm256_set1_epi16(i16::MIN);
        let offset = _mm256_set1_epi32((1 << 23) + (1 << 15));
        for (block, out) in blocks.iter().zip(out.as_chunks_mut::<8>().0) {
            let load = |start: u32| {
                let pixels = row[start as usize..].first_chunk::<COLUMNS_AT_ONCE>();
                // SAFETY: sixteen bytes either way, and every pattern of bits is valid.
                unsafe { transmute::<[u16; 8], __m128i>(*pixels.expect("pixels beyond the end")) }
            };
            let inputs = _mm256_set_m128i(load(block.starts[1]), load(block.starts[0]));
            // SAFETY: 32 bytes either way, and every pattern of bits is valid.
            let shuffle = unsafe { transmute::<[u8; 32], __m256i>(block.shuffle) };
            // SAFETY: the same.
            let weights = unsafe { transmute::<[i16; 16], __m256i>(block.weights) };
            let pairs = _mm256_xor_si256(_mm256_shuffle_epi8(inputs, shuffle), sign);
            let sums = _mm256_madd_epi16(pairs, weights);
            let rounded = _mm256_srli_epi32::<16>(_mm256_add_epi32(sums, offset));
            let words = _mm256_packs_epi32(rounded, rounded);
            let bytes = _mm256_packus_epi16(words, words);
            out[..4].copy_from_slice(&_mm256_extract_epi32::<0>(bytes).to_ne_bytes());
            out[4..].copy_from_slice(&_mm256_extract_epi32::<4>(bytes).to_ne_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn blocks_are_the_same_bits_as_single_pixels() {
        let mut rng = Seed(4).rng();
        for step in [0.3, 0.9, 1.2, 1.9, 2.5] {
            let count = 83;
            let positions: Vec<Between> = (0..count)
                .map(|i| Between {
                    first: (step * f64::from(i)) as u32,
                    weight: rng.below(257) as u16,
                })
                .collect();
            let width = positions[count as usize - 1].first as usize + COLUMNS_AT_ONCE;
            let row: Vec<u16> = (0..width).map(|_| 256 * rng.below(256) as u16).collect();
            let mut expected = vec![0; count as usize];
            blend_scalar(&positions, &row, &mut expected);
            let mut out = vec![0; count as usize];
            BlendColumns::new(positions).apply(&row, &mut out);
            assert_eq!(out, expected, "step {step}");
        }
    }

    #[test]
    fn extremes_do_not_overflow() {
        let positions = vec![
            Between {
                first: 0,
                weight: 128
            };
            16
        ];
        let mut out = [0; 16];
        BlendColumns::new(positions).apply(&[255 * 256; 8], &mut out);
        assert_eq!(out, [255; 16]);
    }
}
