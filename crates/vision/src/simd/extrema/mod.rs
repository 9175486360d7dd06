//! Extrema of a scale space, row by row: among the 26 neighbours in three layers, or the 8 neighbours in one layer.
//! With differences of Gaussians, which are stored nowhere, they are taken from four layers.
#![allow(clippy::needless_bitwise_bool)] // a lazy `&&` is a branch, and lanes have none

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use std::ops::Range;

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;

/// Three neighbouring rows of one layer.
pub type ThreeRows<'a> = [&'a [f32]; 3];

/// [`find_extrema`] in differences that are stored nowhere, at all scales in one pass over the rows: difference `d` is
/// layer `d + 1` minus layer `d`, and `found[s]` gets the columns of difference `s + 1`, whose neighbours are `s` and
/// `s + 2`.
///
/// # Panics
/// If there are not three more layers than `found`, or if `columns` does not leave a column free on each side in every
/// row.
pub fn find_extrema_of_differences(
    layers: &[ThreeRows<'_>],
    columns: Range<usize>,
    threshold: f32,
    found: &mut [Vec<u32>],
) {
    let mut rows = layers.as_flattened().iter();
    assert!(
        columns.start > 0 && rows.all(|row| columns.end < row.len()),
        "a column on each side"
    );
    assert_eq!(layers.len(), found.len() + 3);
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() >= InstructionSet::Avx512 {
        // SAFETY: what is in use was detected on this processor, and rows are long enough.
        return unsafe { avx512::find(layers, columns, threshold, found) };
    }
    search_differences(layers, columns, threshold, found);
}

multiversioned! {
    #![avx512]

    /// Appends to `found` the columns in `columns` where the middle row of the middle layer
    /// exceeds `threshold` (at least 0) in absolute value and is not smaller (if positive) or not
    /// larger (if negative) than any of its 26 neighbours.
    ///
    /// # Panics
    /// If `columns` does not leave a column free on each side in every row.
    pub fn find_extrema(layers: &[ThreeRows<'_>; 3], columns: Range<usize>, threshold: f32, found: &mut Vec<u32>) {
        search::<3>(layers, columns, threshold, std::slice::from_mut(found));
    }

    /// The definition of [`find_extrema_of_differences`].
    fn search_differences(layers: &[ThreeRows<'_>], columns: Range<usize>, threshold: f32, found: &mut [Vec<u32>]) -> () {
        search::<4>(layers, columns, threshold, found);
    }

    /// Columns in `columns` where `rows[1]` exceeds `threshold` and each of its 8 neighbours.
    ///
    /// # Panics
    /// If `columns` does not leave a column free on each side in every row.
    pub fn find_maxima(rows: &ThreeRows<'_>, columns: Range<usize>, threshold: f32, found: &mut Vec<u32>) {
        let mut x = columns.start;
        while x + LANES <= columns.end {
            maxima_block::<LANES, WIDER>(rows, x, 0, threshold, found);
            x += LANES;
        }
        if x < columns.end && columns.len() >= LANES {
            // The last block again covers some columns of the block before.
            let start = columns.end - LANES;
            maxima_block::<LANES, WIDER>(rows, start, x - start, threshold, found);
            x = columns.end;
        }
        while x < columns.end {
            maxima_block::<1, 3>(rows, x, 0, threshold, found);
            x += 1;
        }
    }
}

/// Columns of a block. Loops of this length become vectors; shorter ones would be unrolled, and the
/// overlapping neighbours of their columns shuffled together.
const LANES: usize = 64;

/// Columns that the neighbours of a block lie in.
const WIDER: usize = LANES + 2;

/// Three rows of each layer about a block, from the column before it on.
type Windows<'a, const LAYERS: usize, const WIDTH: usize> = [[&'a [f32; WIDTH]; 3]; LAYERS];

/// Three layers are searched as they are, of four the differences. All scales of a block are searched before the next
/// block, so that rows are read once.
#[inline(always)]
fn search<const LAYERS: usize>(
    layers: &[ThreeRows<'_>],
    columns: Range<usize>,
    threshold: f32,
    found: &mut [Vec<u32>],
) {
    let mut x = columns.start;
    while x + LANES <= columns.end {
        blocks::<LAYERS, LANES, WIDER>(layers, x, 0, threshold, found);
        x += LANES;
    }
    if x < columns.end && columns.len() >= LANES {
        // The last block again covers some columns of the block before.
        let start = columns.end - LANES;
        blocks::<LAYERS, LANES, WIDER>(layers, start, x - start, threshold, found);
        x = columns.end;
    }
    while x < columns.end {
        blocks::<LAYERS, 1, 3>(layers, x, 0, threshold, found);
        x += 1;
    }
}

#[inline(always)]
fn blocks<const LAYERS: usize, const L: usize, const WIDTH: usize>(
    layers: &[ThreeRows<'_>],
    x: usize,
    done: usize,
    threshold: f32,
    found: &mut [Vec<u32>],
) {
    for (layers, found) in layers.windows(LAYERS).zip(found) {
        let layers = layers.first_chunk().expect("a window");
        block::<LAYERS, L, WIDTH>(layers, x, done, threshold, found);
    }
}

/// The block at `x` without its first `done` columns. Most blocks end at the threshold or among the
/// eight neighbours in their own layer.
#[inline(always)]
fn block<const LAYERS: usize, const L: usize, const WIDTH: usize>(
    layers: &[ThreeRows<'_>; LAYERS],
    x: usize,
    done: usize,
    threshold: f32,
    found: &mut Vec<u32>,
) {
    let windows: Windows<'_, LAYERS, WIDTH> = windows(layers, x - 1);
    let mut strong = 0;
    for i in 0..L {
        strong |= u32::from(value(&windows, 1, 1, i + 1).abs() > threshold);
    }
    if strong == 0 {
        return;
    }
    let mut left = candidates::<LAYERS, L, WIDTH>(&windows, threshold) & (u64::MAX << done);
    while left != 0 {
        let i = left.trailing_zeros() as usize;
        left &= left - 1;
        if beats_other_layers(&windows, i) {
            found.push((x + i) as u32);
        }
    }
}

/// A bit for each column of a block that exceeds the threshold and beats its eight neighbours in the middle
/// layer.
#[inline(always)]
fn candidates<const LAYERS: usize, const L: usize, const WIDTH: usize>(
    windows: &Windows<'_, LAYERS, WIDTH>,
    threshold: f32,
) -> u64 {
    #[cfg(target_arch = "x86_64")]
    if LAYERS == 4 && L == LANES && InstructionSet::in_use() == InstructionSet::Avx2 {
        // SAFETY: what is in use was detected on this processor.
        return unsafe { avx2::candidates(&windows[1], &windows[2], threshold) };
    }
    let mut candidates = [0_u8; L];
    for (i, candidate) in candidates.iter_mut().enumerate() {
        let at = |row: usize, dx: usize| value(windows, 1, row, i + dx);
        let centre = at(1, 1);
        let (mut low, mut high) = (at(1, 0), at(1, 0));
        for other in [
            at(1, 2),
            at(0, 0),
            at(0, 1),
            at(0, 2),
            at(2, 0),
            at(2, 1),
            at(2, 2),
        ] {
            low = smaller(low, other);
            high = larger(high, other);
        }
        let top = (centre > threshold) & (centre >= high);
        let bottom = (centre < -threshold) & (centre <= low);
        *candidate = u8::from(top | bottom);
    }
    bits(&candidates)
}

/// Bit `i` is that of flag `i`, which is 0 or 1. There is one flag, or whole eights.
#[inline(always)]
fn bits<const L: usize>(flags: &[u8; L]) -> u64 {
    let (eights, rest) = flags.as_chunks::<8>();
    let mut bits = rest.first().map_or(0, |&flag| u64::from(flag));
    for (i, eight) in eights.iter().enumerate() {
        // Moves the lowest bit of each byte to the highest byte.
        let byte = u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        bits |= byte << (8 * i);
    }
    bits
}

/// The columns from `x` on.
#[inline(always)]
fn windows<'a, const LAYERS: usize, const WIDTH: usize>(
    layers: &[ThreeRows<'a>; LAYERS],
    x: usize,
) -> Windows<'a, LAYERS, WIDTH> {
    let mut windows = [[lanes(layers[0][0], x); 3]; LAYERS];
    for (windows, rows) in windows.iter_mut().zip(layers) {
        for (window, row) in windows.iter_mut().zip(rows) {
            *window = lanes(row, x);
        }
    }
    windows
}

/// Column `i` of a row in the windows.
#[inline(always)]
fn value<const LAYERS: usize, const WIDTH: usize>(
    windows: &Windows<'_, LAYERS, WIDTH>,
    layer: usize,
    row: usize,
    i: usize,
) -> f32 {
    if LAYERS == 4 {
        windows[layer + 1][row][i] - windows[layer][row][i]
    } else {
        windows[layer][row][i]
    }
}

#[inline(always)]
fn beats_other_layers<const LAYERS: usize, const WIDTH: usize>(
    windows: &Windows<'_, LAYERS, WIDTH>,
    i: usize,
) -> bool {
    let centre = value(windows, 1, 1, i + 1);
    for layer in [0, 2] {
        for row in 0..3 {
            let at = |dx: usize| value(windows, layer, row, i + dx);
            let (low, high) = (
                smaller(smaller(at(0), at(1)), at(2)),
                larger(larger(at(0), at(1)), at(2)),
            );
            let is_beaten = if centre > 0.0 {
                centre < high
            } else {
                centre > low
            };
            if is_beaten {
                return false;
            }
        }
    }
    true
}

/// The block at `x` without its first `done` columns. Most blocks end at the threshold.
#[inline(always)]
fn maxima_block<const L: usize, const WIDTH: usize>(
    rows: &ThreeRows<'_>,
    x: usize,
    done: usize,
    threshold: f32,
    found: &mut Vec<u32>,
) {
    let [above, here, below] = [0, 1, 2].map(|row| lanes::<WIDTH>(rows[row], x - 1));
    let mut strong = 0;
    for i in 0..L {
        strong |= u32::from(here[i + 1] > threshold);
    }
    if strong == 0 {
        return;
    }
    let mut maxima = [0_u8; L];
    for (i, maximum) in maxima.iter_mut().enumerate() {
        let mut high = larger(here[i], here[i + 2]);
        for row in [above, below] {
            high = larger(high, larger(larger(row[i], row[i + 1]), row[i + 2]));
        }
        *maximum = u8::from((here[i + 1] > threshold) & (here[i + 1] > high));
    }
    let mut left = bits(&maxima) & (u64::MAX << done);
    while left != 0 {
        found.push((x + left.trailing_zeros() as usize) as u32);
        left &= left - 1;
    }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn lanes<const L: usize>(row: &[f32], x: usize) -> &[f32; L] {
    row[x..].first_chunk::<L>().expect("rows of one width")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Rng, Seed};
    use crate::simd::InstructionSet;

    #[test]
    fn blocks_find_what_the_definition_finds() {
        let mut rng = Seed(5).rng();
        for width in [3, 40, 66, 67, 400] {
            blocks_find_what_the_definition_finds_in(&mut rng, width);
        }
    }

    fn blocks_find_what_the_definition_finds_in(rng: &mut Rng, width: usize) {
        // Few distinct values, so that ties occur.
        let rows: Vec<Vec<f32>> = (0..9)
            .map(|_| (0..width).map(|_| rng.below(13) as f32 - 6.0).collect())
            .collect();
        let layers: [ThreeRows<'_>; 3] =
            std::array::from_fn(|l| std::array::from_fn(|y| rows[3 * l + y].as_slice()));
        let mut found = Vec::new();
        find_extrema(&layers, 1..width - 1, 2.0, &mut found);
        let expected: Vec<u32> = (1..width - 1)
            .filter(|&x| {
                let value = rows[4][x];
                let mut around = rows.iter().flat_map(|row| &row[x - 1..=x + 1]);
                (value > 2.0 && around.clone().all(|&v| value >= v))
                    || (value < -2.0 && around.all(|&v| value <= v))
            })
            .map(|x| x as u32)
            .collect();
        assert!(expected.len() > 10 || width < 400, "the test sees extrema");
        assert_eq!(found, expected);
    }

    #[test]
    fn all_scales_find_what_each_finds_in_its_differences() {
        let mut rng = Seed(7).rng();
        for (width, scales) in [(3, 1), (40, 2), (66, 3), (67, 5), (400, 3), (400, 7)] {
            let differences: Vec<Vec<f32>> = (0..3 * (scales + 2))
                .map(|_| (0..width).map(|_| rng.below(13) as f32 - 6.0).collect())
                .collect();
            // Layers of which these are the differences.
            let mut sums = vec![vec![0.0; width]; 3];
            for row in &differences {
                let sum = sums[sums.len() - 3].iter().zip(row);
                sums.push(sum.map(|(a, b)| a + b).collect());
            }
            let (sums, _) = sums.as_chunks::<3>();
            let layers: Vec<ThreeRows<'_>> = sums
                .iter()
                .map(|three| three.each_ref().map(Vec::as_slice))
                .collect();
            let (differences, _) = differences.as_chunks::<3>();
            for columns in [1..width - 1, (width / 3).max(1)..width / 2] {
                let expected: Vec<Vec<u32>> = (0..scales)
                    .map(|scale| {
                        let mut found = Vec::new();
                        let three: &[[Vec<f32>; 3]; 3] = differences[scale..]
                            .first_chunk()
                            .expect("two more than scales");
                        let three = three
                            .each_ref()
                            .map(|rows| rows.each_ref().map(Vec::as_slice));
                        find_extrema(&three, columns.clone(), 2.0, &mut found);
                        found
                    })
                    .collect();
                assert!(width < 400 || expected.iter().all(|found| found.len() > 1));
                InstructionSet::for_each(|set| {
                    let mut found = vec![Vec::new(); scales];
                    find_extrema_of_differences(&layers, columns.clone(), 2.0, &mut found);
                    assert_eq!(found, expected, "{width} columns, {scales} scales, {set:?}");
                });
            }
        }
    }

    #[test]
    fn maxima_exceed_threshold_and_neighbours() {
        let mut rng = Seed(6).rng();
        for width in [3, 40, 66, 67, 400] {
            let rows: Vec<Vec<f32>> = (0..3)
                .map(|_| (0..width).map(|_| rng.below(9) as f32 - 4.0).collect())
                .collect();
            let layer: ThreeRows<'_> = std::array::from_fn(|y| rows[y].as_slice());
            let expected: Vec<u32> = (1..width - 1)
                .filter(|&x| {
                    let value = rows[1][x];
                    let around = rows.iter().flat_map(|row| &row[x - 1..=x + 1]);
                    value > 1.0 && around.filter(|&&v| v >= value).count() == 1
                })
                .map(|x| x as u32)
                .collect();
            assert!(expected.len() > 10 || width < 400, "the test sees maxima");
            InstructionSet::for_each(|set| {
                let mut found = Vec::new();
                find_maxima(&layer, 1..width - 1, 1.0, &mut found);
                assert_eq!(found, expected, "{width} columns, {set:?}");
                found.clear();
                find_maxima(&layer, width / 3..width / 2, 1.0, &mut found);
                let some = expected
                    .iter()
                    .filter(|&&x| (width / 3..width / 2).contains(&(x as usize)));
                assert!(found.iter().eq(some), "{width} columns, {set:?}");
            });
        }
    }
}
