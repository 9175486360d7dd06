//! The two nearest by Hamming distance.
//!
//! V. L. Arlazarov, E. A. Dinic, M. A. Kronrod, I. A. Faradzhev: "On Economical Construction of
//! the Transitive Closure of a Directed Graph", Soviet Mathematics Doklady 11(5), 1209-1210, 1970:
//! the method of the four Russians, who cut vectors of bits into groups so short that the answers
//! for all patterns of a group fit a table.
//!
//! *How it works.*
//! 1. The bits are cut into groups of five. For each group and each of the 32 patterns that a query
//!    may have there, a table holds in how many bits 128 candidates differ from it; each bit doubles
//!    the table. A query then only adds one entry per group.
//! 2. A count of at most five takes four bits, so a byte holds those of two candidates. Three counts still fit (3 * 5
//!    = 15), so only after each third addition the two are separated. 15 bits of 64 candidates cost six instructions
//!    on vectors of 32 bytes; looking up four bits at a time with byte shuffles takes fifteen. Two such vectors lie
//!    side by side, so that the entry is located once for both.
//! 3. The tables of one word (26 KiB) stay in the first-level cache while the queries of a tile pass
//!    by; each adds its counts to sums that stop at 255.
//! 4. When a candidate of a panel is near enough to matter, the two nearest of the panel are found by minima over all
//!    lanes; to look at lanes one by one would take as long as counting.
//! 5. Sums stop at 255. A query with fewer than two candidates nearer than that is unlike everything, and is compared
//!    once more, one by one.
//!
//! Where the processor multiplies tiles of bytes, distances are [sums of products](products) instead.

#[cfg(target_arch = "x86_64")]
mod products;

use super::{TILE_BYTES, TwoNearest};
#[cfg(target_arch = "x86_64")]
use crate::simd::{InstructionSet, tiles::Tiles};

/// Candidates of a panel.
const LANES: usize = 128;

/// Bytes that hold the counts of a panel, and candidates in either half of the bytes' bits.
const BYTES: usize = LANES / 2;

/// Bits of a group: three counts fit four bits.
const GROUP_BITS: usize = 5;

/// Groups of a word; the last has four bits.
const GROUPS: usize = 64_usize.div_ceil(GROUP_BITS);

/// Groups whose counts are added before lower and upper bits of a byte are separated.
const JOINED: usize = 3;

/// All bits of a group.
const PATTERN: u8 = (1 << GROUP_BITS) - 1;

/// Queries of a tile. A table costs as much time as some fifty queries that use it.
const QUERIES: usize = TILE_BYTES / size_of::<Sums>();

/// Entry after entry, the counts of a panel for each pattern of a group: candidate `i` in the lower
/// four bits of byte `i`, candidate 64 + `i` in its upper four. Aligned, so that no entry lies across
/// two cache lines.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Table([u8; BYTES << GROUP_BITS]);

/// The tables of a word.
type Tables = [Table; GROUPS];

/// Distances of a query to a panel of candidates, those above 255 as 255.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Sums([u8; LANES]);

/// For each row of `a`, the numbers of bits in which its two nearest rows of `b` differ from it;
/// both are rows of `words` words.
///
/// # Panics
/// If `words` is 0.
pub fn two_nearest_bits(a: &[u64], b: &[u64], words: usize) -> Vec<TwoNearest> {
    assert!(words > 0, "rows without words");
    #[cfg(target_arch = "x86_64")]
    if words <= products::MAX_WORDS && InstructionSet::in_use() == InstructionSet::Amx {
        // SAFETY: what is in use was detected on this processor, and this thread uses tiles nowhere else meanwhile.
        return unsafe { products::two_nearest(a, b, words, &mut Tiles::of_this_thread()) };
    }
    let count = b.len() / words;
    let panels = pack(b, words);
    let mut best = vec![TwoNearest::none(u8::MAX); a.len() / words];
    let mut tables = vec![Table([0; _]); GROUPS];
    let tables: &mut Tables = tables.first_chunk_mut().expect("one for each group");
    let mut sums = vec![Sums([0; LANES]); best.len().min(QUERIES)];
    for (a, best) in a.chunks(QUERIES * words).zip(best.chunks_mut(QUERIES)) {
        let sums = &mut sums[..best.len()];
        let columns: Vec<Vec<u64>> = (0..words).map(|word| column(a, words, word)).collect();
        for (panel, first) in panels.chunks_exact(words).zip((0..).step_by(LANES)) {
            for ((groups, column), word) in panel.iter().zip(&columns).zip(0..) {
                fill(tables, groups);
                add_counts(tables, column, sums, word == 0);
            }
            offer(sums, first, count, best);
        }
    }

    let exact = |(best, a): (TwoNearest<u8>, &[u64])| match best.second {
        u8::MAX => compare_one_by_one(a, b),
        second => TwoNearest {
            nearest: f32::from(best.nearest),
            second: f32::from(second),
            index: best.index,
        },
    };
    best.into_iter()
        .zip(a.chunks_exact(words))
        .map(exact)
        .collect()
}

/// The definition: the two nearest rows of `b` to the row `a`.
fn compare_one_by_one(a: &[u64], b: &[u64]) -> TwoNearest {
    let mut best = TwoNearest::none(f32::INFINITY);
    for (b, index) in b.chunks_exact(a.len()).zip(0..) {
        let differences = a.iter().zip(b).map(|(a, b)| (a ^ b).count_ones());
        best.offer(differences.sum::<u32>() as f32, index);
    }
    best
}

/// The words at place `word` of all rows.
fn column(rows: &[u64], words: usize, word: usize) -> Vec<u64> {
    rows.iter().skip(word).step_by(words).copied().collect()
}

/// The bits of a group.
#[inline(always)]
fn pattern(word: u64, group: usize) -> u8 {
    (word >> (GROUP_BITS * group)) as u8 & PATTERN
}

#[inline(always)]
fn least(lanes: &[u8; LANES]) -> u8 {
    lanes.iter().fold(u8::MAX, |least, &lane| least.min(lane))
}

multiversioned! {
    #![avx512]

    /// The groups of the candidates, panel by panel and word by word: candidate after candidate
    /// within a group. Lanes without a candidate are zero.
    fn pack(rows: &[u64], words: usize) -> Vec<[[u8; LANES]; GROUPS]> {
        let panels = rows.chunks(LANES * words);
        let mut packed = vec![[[0; LANES]; GROUPS]; panels.len() * words];
        for (panel, rows) in packed.chunks_exact_mut(words).zip(panels) {
            for (word, groups) in panel.iter_mut().enumerate() {
                let mut column = [0; LANES];
                for (lane, row) in column.iter_mut().zip(rows.chunks_exact(words)) {
                    *lane = row[word];
                }
                for (lanes, group) in groups.iter_mut().zip(0..) {
                    for (lane, &word) in lanes.iter_mut().zip(&column) {
                        *lane = pattern(word, group);
                    }
                }
            }
        }
        packed
    }

    /// Fills the tables of a word for a panel.
    fn fill(tables: &mut Tables, groups: &[[u8; LANES]; GROUPS]) -> () {
        for (table, lanes) in tables.iter_mut().zip(groups) {
            let (lower, upper) = lanes.split_at(BYTES);
            let (entries, _) = table.0.as_chunks_mut::<BYTES>();
            entries[0] = [0; BYTES];
            // What the counts change by when a bit of the pattern turns from zero to one: 1 where the
            // candidate has a zero, -1 where it has a one. Borrows between the two of a byte cancel
            // out in the sum.
            let mut steps = [[0; BYTES]; GROUP_BITS];
            for (step, bit) in steps.iter_mut().zip(0..) {
                for i in 0..BYTES {
                    let ones = (lower[i] >> bit & 1) | (upper[i] >> bit & 1) << 4;
                    entries[0][i] += ones;
                    step[i] = 0x11_u8.wrapping_sub(2 * ones);
                }
            }
            for (step, bit) in steps.iter().zip(0..) {
                let (without, with) = entries.split_at_mut(1 << bit);
                for (without, with) in without.iter().zip(with) {
                    for i in 0..BYTES {
                        with[i] = without[i].wrapping_add(step[i]);
                    }
                }
            }
        }
    }

    /// Adds the counts of a word to the sums of each query, which `afresh` starts from zero.
    fn add_counts(tables: &Tables, column: &[u64], sums: &mut [Sums], afresh: bool) -> () {
        for (sums, &query) in sums.iter_mut().zip(column) {
            if afresh {
                *sums = Sums([0; LANES]);
            }
            // Lower counts plus 16 times the upper ones, modulo 256; and the upper ones alone.
            let mut both = [0_u8; BYTES];
            let mut upper = [0_u8; BYTES];
            for (tables, first) in tables.chunks(JOINED).zip((0..).step_by(JOINED)) {
                let mut joined = [0_u8; BYTES];
                for (table, group) in tables.iter().zip(first..) {
                    let entry = usize::from(pattern(query, group)) * BYTES;
                    let counts = &table.0[entry..entry + BYTES];
                    for i in 0..BYTES {
                        joined[i] += counts[i];
                    }
                }
                for i in 0..BYTES {
                    both[i] = both[i].wrapping_add(joined[i]);
                    upper[i] += joined[i] >> 4;
                }
            }
            let (lower_sums, upper_sums) = sums.0.split_at_mut(BYTES);
            for i in 0..BYTES {
                let lower = both[i].wrapping_sub(upper[i] << 4);
                lower_sums[i] = lower_sums[i].saturating_add(lower);
                upper_sums[i] = upper_sums[i].saturating_add(upper[i]);
            }
        }
    }

    /// Offers the candidates of a panel, `first` and those that follow it, to each query.
    fn offer(sums: &[Sums], first: usize, count: usize, best: &mut [TwoNearest<u8>]) -> () {
        let mut padding = [0; LANES];
        padding[LANES.min(count - first)..].fill(u8::MAX);
        let mut numbers = [0; LANES];
        for (number, lane) in numbers.iter_mut().zip(0..) {
            *number = lane;
        }
        for (Sums(sums), best) in sums.iter().zip(best) {
            if !best.loses_to_one(sums) {
                continue;
            }
            let mut sums = *sums;
            for (sum, padding) in sums.iter_mut().zip(&padding) {
                *sum |= padding;
            }
            let nearest = least(&sums);
            let mut places = numbers;
            for (place, &sum) in places.iter_mut().zip(&sums) {
                *place = if sum == nearest { *place } else { u8::MAX };
            }
            let place = least(&places);
            for (sum, &number) in sums.iter_mut().zip(&numbers) {
                *sum = if number == place { u8::MAX } else { *sum };
            }
            // The nearest goes first, so that the second cannot win and its place is not needed.
            best.offer(nearest, (first + usize::from(place)) as u32);
            best.second = best.second.min(least(&sums));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Rng, Seed};
    use crate::simd::InstructionSet;

    fn draw(rng: &mut Rng, words: usize) -> Vec<u64> {
        let word = |rng: &mut Rng| u64::from(rng.next_u32()) << 32 | u64::from(rng.next_u32());
        (0..words).map(|_| word(rng)).collect()
    }

    fn assert_exact(a: &[u64], b: &[u64], words: usize) {
        let (rows_a, rows_b) = (a.len() / words, b.len() / words);
        let expected: Vec<TwoNearest> = (a.chunks_exact(words))
            .map(|a| compare_one_by_one(a, b))
            .collect();
        InstructionSet::for_each(|set| {
            let shape = format!("{set:?}: {rows_a} and {rows_b} rows of {words} words");
            assert_eq!(two_nearest_bits(a, b, words), expected, "{shape}");
        });
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

    #[test]
    fn tables_agree_with_the_definition() {
        let mut rng = Seed(7).rng();
        for words in [1, 2, 4, 7, 8, 16, 64, 65] {
            for (rows_a, rows_b) in [
                (0, 7),
                (7, 0),
                (1, 1),
                (7, 63),
                (33, 64),
                (8, 65),
                (9, 127),
                (7, 128),
                (8, 129),
                (13, 300),
            ] {
                let a = draw(&mut rng, rows_a * words);
                let b = draw(&mut rng, rows_b * words);
                assert_exact(&a, &b, words);
            }
        }
    }

    #[test]
    fn ties_go_to_the_lowest_index() {
        let mut rng = Seed(9).rng();
        for words in [1, 8] {
            let [a, b] = [90, 300].map(|rows| {
                let mut rows = draw(&mut rng, rows * words);
                // Few bits make many ties, among them both neighbours at distance 0.
                for word in &mut rows {
                    *word &= 1 << 63 | 1 << 4;
                }
                rows
            });
            assert_exact(&a, &b, words);
        }
    }

    #[test]
    fn every_bit_counts_once() {
        let words = 3;
        let a: Vec<u64> = (0..64 * words)
            .flat_map(|bit| (0..words).map(move |word| u64::from(bit / 64 == word) << (bit % 64)))
            .collect();
        let complements: Vec<u64> = a.iter().map(|word| !word).collect();
        assert_exact(&a, &a, words);
        assert_exact(&a, &complements, words);
    }

    #[test]
    fn distances_need_more_than_a_byte() {
        // Around 255 the sums of bytes stop; 256 and more would start again at 0.
        let words = 9;
        let row = |bits: usize| -> Vec<u64> {
            (0..words)
                .map(|word| match bits.saturating_sub(64 * word) {
                    0 => 0,
                    bits => u64::MAX >> 64_usize.saturating_sub(bits),
                })
                .collect()
        };
        let distances = [0, 253, 254, 255, 256, 257, 511, 512, 513, 576];
        for first in distances {
            for second in distances {
                let b = [row(first), row(second), row(576)].concat();
                assert_exact(&row(0), &b, words);
                assert_exact(&row(0), &b[..2 * words], words);
            }
        }
    }

    #[test]
    fn tiles_join() {
        let mut rng = Seed(8).rng();
        let a = draw(&mut rng, QUERIES + 5);
        let b = draw(&mut rng, 1000);
        assert_exact(&a, &b, 1);
        assert_exact(&b, &a, 1);
    }
}
