//! Comparisons of intensities at pairs of places about a keypoint.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use super::Pixels;
#[cfg(target_arch = "x86_64")]
use crate::simd::InstructionSet;

/// Places of the compared pairs relative to an upright keypoint, bit after bit.
#[derive(Clone, Debug, PartialEq)]
pub struct PairTable {
    /// x, then y, of the first place of each pair.
    pub first: [[f32; 256]; 2],
    /// x, then y, of the second place of each pair.
    pub second: [[f32; 256]; 2],
}

/// Pixels that turned places reach to each side: they lie in a square of `2 * 19 + 1` rows and columns.
pub const PAIR_REACH: usize = 19;
/// Pixels in a row of that square.
const SQUARE: usize = 2 * PAIR_REACH + 1;
/// Size of the rows of a copy of that square.
const COPY_ROW: usize = 64;

/// 256 bits for each centre: whether the first place of each pair is darker than the second,
/// all places turned by the angle whose cosine and sine are given, to the nearest pixel.
/// Centres must be at least 20 pixels from the border; nearer to it, pixels from the other end of the row
/// are read, or it panics. Places must not be farther from it than 18.5 pixels.
///
/// # Panics
/// If there are not as many turns as centres.
pub fn compare_pairs(
    pixels: Pixels<'_>,
    centres: &[[u32; 2]],
    turns: &[[f32; 2]],
    pairs: &PairTable,
) -> Vec<u64> {
    assert_eq!(centres.len(), turns.len(), "one turn for each centre");
    #[cfg(target_arch = "x86_64")]
    match InstructionSet::in_use() {
        // SAFETY: what is in use was detected on this processor.
        InstructionSet::Avx512 | InstructionSet::Amx => {
            return unsafe { avx512::compare_pairs(pixels, centres, turns, pairs) };
        }
        InstructionSet::Avx2 if avx2::are_in_reach(pixels, turns, pairs) => {
            // SAFETY: as before, and all places are in reach.
            return unsafe { avx2::compare_pairs(pixels, centres, turns, pairs) };
        }
        InstructionSet::Avx2 | InstructionSet::Portable => {}
    }
    compare_pair_by_pair(pixels, centres, turns, pairs)
}

/// Adding this leaves the rounded integer in the lowest bits of the mantissa.
const ROUND: f32 = 1.5 * (1 << 23) as f32;

multiversioned! {
    /// The definition of [`compare_pairs`].
    fn compare_pair_by_pair(
        pixels: Pixels<'_>,
        centres: &[[u32; 2]],
        turns: &[[f32; 2]],
        pairs: &PairTable,
    ) -> Vec<u64> {
        let mut bits = Vec::with_capacity(4 * centres.len());
        // As long as a 16-bit index may reach, so that no access needs a check; only the first
        // rows are used.
        let copy = vec![0; 1 << 16].into_boxed_slice();
        let mut copy: Box<[u8; 1 << 16]> = copy.try_into().expect("as long as that");
        let mut first = [0; 256];
        let mut second = [0; 256];
        for (&centre, &turn) in centres.iter().zip(turns) {
            let square = pixels.square(centre, PAIR_REACH);
            for (row, copied) in square.chunks(pixels.width).zip(copy.as_chunks_mut::<COPY_ROW>().0) {
                copied[..SQUARE].copy_from_slice(&row[..SQUARE]);
            }
            turn_places(&pairs.first, turn, &mut first);
            turn_places(&pairs.second, turn, &mut second);
            for (first, second) in first.as_chunks::<64>().0.iter().zip(second.as_chunks::<64>().0) {
                let mut word = 0_u64;
                for i in (0..64).rev() {
                    let a = copy[usize::from(first[i])];
                    let b = copy[usize::from(second[i])];
                    word = word << 1 | u64::from(a < b);
                }
                bits.push(word);
            }
        }
        bits
    }
}

/// Places in the copied square, after a turn by the angle of cosine and sine `turn`.
#[inline(always)]
fn turn_places(places: &[[f32; 256]; 2], turn: [f32; 2], out: &mut [u16; 256]) {
    const ROW: u32 = COPY_ROW as u32;
    const MIDDLE: u32 = PAIR_REACH as u32 * (ROW + 1);
    let [cos, sin] = turn;
    for (i, out) in out.iter_mut().enumerate() {
        let (x, y) = (places[0][i], places[1][i]);
        let turned_x = (x * cos - y * sin + ROUND).to_bits();
        let turned_y = (x * sin + y * cos + ROUND).to_bits();
        // Made shorter only at the end, since that moves numbers from lane to lane. Of `ROUND` nothing is left then.
        let place = turned_y
            .wrapping_mul(ROW)
            .wrapping_add(turned_x)
            .wrapping_add(MIDDLE);
        *out = place as u16;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;
    use crate::simd::orb::tests::{CENTRES, WIDTH, noise, pixel};

    #[test]
    fn bits_follow_the_definition() {
        let data = noise();
        let pixels = Pixels {
            data: &data,
            width: WIDTH,
        };
        let mut rng = Seed(9).rng();
        let mut places = || std::array::from_fn(|_| rng.below(27) as f32 - 13.0);
        let pairs = PairTable {
            first: [places(), places()],
            second: [places(), places()],
        };
        let turns = [[1.0, 0.0], [0.0, -1.0], [0.8, 0.6]];
        let bits = compare_pairs(pixels, &CENTRES, &turns, &pairs);
        InstructionSet::for_each(|set| {
            assert_eq!(
                compare_pairs(pixels, &CENTRES, &turns, &pairs),
                bits,
                "{set:?}"
            );
        });
        assert_eq!(bits.len(), 4 * CENTRES.len());
        for (k, (&centre, [cos, sin])) in CENTRES.iter().zip(turns).enumerate() {
            let value = |places: &[[f32; 256]; 2], i: usize| {
                let (x, y) = (places[0][i], places[1][i]);
                let round = |v: f32| v.round_ties_even() as i32;
                pixel(
                    &data,
                    centre,
                    round(x * cos - y * sin),
                    round(x * sin + y * cos),
                )
            };
            for i in 0..256 {
                let darker = value(&pairs.first, i) < value(&pairs.second, i);
                assert_eq!(
                    bits[4 * k + i / 64] >> (i % 64) & 1,
                    u64::from(darker),
                    "{k} {i}"
                );
            }
        }
    }
}
