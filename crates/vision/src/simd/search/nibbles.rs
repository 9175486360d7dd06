//! The two nearest by Hamming distance.
//!
//! Four bits of a query and four bits of a candidate differ in a number of bits that is looked up
//! in a table of sixteen entries, one table for each value of the query's four bits. The tables of
//! a query lie in vector registers or the first-level cache, and one byte shuffle looks up four
//! bits of 32 candidates at once: two instructions where counting bits takes eight. (The idea is
//! known from product quantisation: Andre, Kermarrec and Le Scouarnec, "Cache Locality is not
//! Enough: High-Performance Nearest Neighbor Search with Product Quantization Fast Scan", VLDB
//! 2015.)

use super::TwoNearest;

/// For each row of `a`, the numbers of bits in which its two nearest rows of `b` differ from it;
/// both are rows of `words` words.
///
/// # Panics
/// If `words` is 0 or above 1023, where a distance would not fit 16 bits.
pub fn two_nearest_bits(a: &[u64], b: &[u64], words: usize) -> Vec<TwoNearest> {
    assert!(
        (1..=1023).contains(&words),
        "rows of {words} words, not 1 to 1023"
    );
    #[cfg(target_arch = "x86_64")]
    let best = x86::two_nearest(a, b, words).unwrap_or_else(|| two_nearest(a, b, words));
    #[cfg(not(target_arch = "x86_64"))]
    let best = two_nearest(a, b, words);

    let distance = |bits: u16| match bits {
        u16::MAX => f32::INFINITY,
        bits => f32::from(bits),
    };
    best.into_iter()
        .map(|best| TwoNearest {
            nearest: distance(best.nearest),
            second: distance(best.second),
            index: best.index,
        })
        .collect()
}

/// The definition.
fn two_nearest(a: &[u64], b: &[u64], words: usize) -> Vec<TwoNearest<u16>> {
    let distance = |a: &[u64], b: &[u64]| -> u32 {
        let differences = a.iter().zip(b).map(|(a, b)| a ^ b);
        differences.map(u64::count_ones).sum()
    };
    a.chunks_exact(words)
        .map(|a| {
            let mut best = TwoNearest::none(u16::MAX);
            for (b, index) in b.chunks_exact(words).zip(0..) {
                best.offer(distance(a, b) as u16, index);
            }
            best
        })
        .collect()
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{
        __m256i, _mm_loadu_si128, _mm256_add_epi8, _mm256_add_epi16, _mm256_broadcastsi128_si256,
        _mm256_castsi256_si128, _mm256_cvtepu8_epi16, _mm256_extracti128_si256, _mm256_loadu_si256,
        _mm256_setzero_si256, _mm256_shuffle_epi8, _mm256_storeu_si256,
    };

    use super::super::{TILE_BYTES, TwoNearest};

    /// Candidates of a panel: two vectors of bytes.
    const LANES: usize = 64;

    /// Queries of a block: with two vectors each, six registers are loaded for eight look-ups, and
    /// the tables (4 KiB for 256 bits) stay in the first-level cache beside the panel.
    const ROWS: usize = 4;

    /// Look-ups, of at most four bits each, whose sum is sure to fit a byte.
    const LOOKUPS: usize = 32;

    /// Entry `[i][j]` is the number of bits in which `i` and `j` differ.
    const DIFFERING_BITS: [[u8; 16]; 16] = {
        let mut table = [[0; 16]; 16];
        let mut cell = 0;
        while cell < 256 {
            table[cell / 16][cell % 16] = ((cell / 16) ^ (cell % 16)).count_ones() as u8;
            cell += 1;
        }
        table
    };

    /// The result of the definition, or `None` where the processor lacks AVX2.
    pub(super) fn two_nearest(a: &[u64], b: &[u64], words: usize) -> Option<Vec<TwoNearest<u16>>> {
        if !std::arch::is_x86_feature_detected!("avx2") {
            return None;
        }
        let count = b.len() / words;
        let nibbles = 16 * words;
        let panels = pack_nibbles(b, words);
        let tile = (TILE_BYTES / LANES / nibbles).max(1);

        let mut best = vec![TwoNearest::none(u16::MAX); a.len() / words];
        let mut tables = vec![[[0; 16]; ROWS]; nibbles];
        for (panels, first) in panels
            .chunks(tile * nibbles)
            .zip((0..).step_by(tile * LANES))
        {
            for (a, best) in a.chunks(ROWS * words).zip(best.chunks_mut(ROWS)) {
                for (row, a) in a.chunks_exact(words).enumerate() {
                    for (tables, word) in tables.chunks_exact_mut(16).zip(a) {
                        for (tables, nibble) in tables.iter_mut().zip(split(*word)) {
                            tables[row] = DIFFERING_BITS[usize::from(nibble)];
                        }
                    }
                }
                // SAFETY: AVX2 was detected on this processor.
                unsafe { scan(&tables, panels, first, count, best) };
            }
        }
        Some(best)
    }

    /// As `pack` of what [`split`] makes of the words: lane after lane within a
    /// group of four bits, which vectors can do.
    fn pack_nibbles(rows: &[u64], words: usize) -> Vec<[u8; LANES]> {
        let panels = rows.chunks(LANES * words);
        let mut packed = vec![[0; LANES]; panels.len() * 16 * words];
        for (panel, rows) in packed.chunks_exact_mut(16 * words).zip(panels) {
            for (word, nibbles) in panel.chunks_exact_mut(16).enumerate() {
                let mut column = [0; LANES];
                for (lane, row) in column.iter_mut().zip(rows.chunks_exact(words)) {
                    *lane = row[word];
                }
                for (shift, lanes) in (0..).step_by(4).zip(nibbles) {
                    for (lane, word) in lanes.iter_mut().zip(&column) {
                        *lane = (word >> shift) as u8 & 15;
                    }
                }
            }
        }
        packed
    }

    /// The sixteen groups of four bits of a word, least significant first.
    fn split(word: u64) -> [u8; 16] {
        std::array::from_fn(|nibble| (word >> (4 * nibble)) as u8 & 15)
    }

    /// Offers the candidates of the panels to the block of queries that `tables` stand for.
    #[target_feature(enable = "avx2")]
    fn scan(
        tables: &[[[u8; 16]; ROWS]],
        panels: &[[u8; LANES]],
        first: usize,
        count: usize,
        best: &mut [TwoNearest<u16>],
    ) {
        let panels = panels.chunks_exact(tables.len());
        for (panel, first) in panels.zip((first..).step_by(LANES)) {
            let mut wide = [[_mm256_setzero_si256(); 4]; ROWS];
            for (tables, panel) in tables.chunks(LOOKUPS).zip(panel.chunks(LOOKUPS)) {
                let mut sums = [[_mm256_setzero_si256(); 2]; ROWS];
                for (tables, candidates) in tables.iter().zip(panel) {
                    let candidates = load(candidates);
                    for row in 0..ROWS {
                        let table = load_twice(&tables[row]);
                        for half in 0..2 {
                            let bits = _mm256_shuffle_epi8(table, candidates[half]);
                            sums[row][half] = _mm256_add_epi8(sums[row][half], bits);
                        }
                    }
                }
                for (wide, [low, high]) in wide.iter_mut().zip(sums) {
                    let quarters = [
                        _mm256_castsi256_si128(low),
                        _mm256_extracti128_si256::<1>(low),
                        _mm256_castsi256_si128(high),
                        _mm256_extracti128_si256::<1>(high),
                    ];
                    for (wide, quarter) in wide.iter_mut().zip(quarters) {
                        *wide = _mm256_add_epi16(*wide, _mm256_cvtepu8_epi16(quarter));
                    }
                }
            }
            for (best, wide) in best.iter_mut().zip(wide) {
                let mut distances = [0_u16; LANES];
                let (quarters, _) = distances.as_chunks_mut::<16>();
                for (quarter, wide) in quarters.iter_mut().zip(wide) {
                    // SAFETY: `quarter` is 32 bytes long.
                    unsafe { _mm256_storeu_si256(quarter.as_mut_ptr().cast(), wide) };
                }
                best.offer_lanes(&distances, first, count);
            }
        }
    }

    /// Two vectors of 32 bytes.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn load(bytes: &[u8; LANES]) -> [__m256i; 2] {
        let start = bytes.as_ptr();
        // SAFETY: 32 bytes can be read from byte 0 and from byte 32 of 64.
        unsafe {
            [
                _mm256_loadu_si256(start.cast()),
                _mm256_loadu_si256(start.add(32).cast()),
            ]
        }
    }

    /// A table in both halves of a vector.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn load_twice(table: &[u8; 16]) -> __m256i {
        // SAFETY: 16 bytes can be read.
        _mm256_broadcastsi128_si256(unsafe { _mm_loadu_si128(table.as_ptr().cast()) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Rng, Seed};

    fn draw(rng: &mut Rng, words: usize) -> Vec<u64> {
        let word = |rng: &mut Rng| u64::from(rng.next_u32()) << 32 | u64::from(rng.next_u32());
        (0..words).map(|_| word(rng)).collect()
    }

    #[test]
    fn counts_are_those_of_a_small_example() {
        let best = two_nearest_bits(&[0b1011], &[0b0100, 0b1000, 0b1111], 1);
        let expected = TwoNearest {
            nearest: 1.0,
            second: 2.0,
            index: 2,
        };
        assert_eq!(best, [expected]);
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn tables_agree_with_the_definition() {
        let mut rng = Seed(7).rng();
        for words in [1, 2, 4, 7, 8, 64] {
            for (rows_a, rows_b) in [(0, 7), (7, 0), (1, 1), (7, 33), (33, 7), (8, 32), (13, 100)] {
                let (mut a, mut b) = (
                    draw(&mut rng, rows_a * words),
                    draw(&mut rng, rows_b * words),
                );
                // Few bits make many ties.
                if rows_a == 33 {
                    a.iter_mut().chain(&mut b).for_each(|word| *word &= 5);
                }
                if let Some(best) = x86::two_nearest(&a, &b, words) {
                    let shape = format!("{rows_a} and {rows_b} rows of {words}");
                    assert_eq!(best, two_nearest(&a, &b, words), "{shape}");
                }
            }
        }
    }

    #[test]
    fn opposite_rows_differ_in_every_bit() {
        for words in [1, 4, 8, 1023] {
            let best = two_nearest_bits(&vec![0; words], &vec![u64::MAX; words], words);
            let expected = TwoNearest {
                nearest: 64.0 * words as f32,
                second: f32::INFINITY,
                index: 0,
            };
            assert_eq!(best, [expected]);
        }
    }

    #[test]
    fn tiles_join() {
        let mut rng = Seed(8).rng();
        let (a, b) = (draw(&mut rng, 9), draw(&mut rng, 10_000));
        let nearest = |best: Vec<TwoNearest<u16>>| -> Vec<_> {
            best.iter()
                .map(|best| (f32::from(best.nearest), best.index))
                .collect()
        };
        let fast: Vec<_> = two_nearest_bits(&a, &b, 1)
            .iter()
            .map(|best| (best.nearest, best.index))
            .collect();
        assert_eq!(fast, nearest(two_nearest(&a, &b, 1)));
    }
}
