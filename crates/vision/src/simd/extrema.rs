//! Extrema among the 26 neighbours in three layers of a scale space, or the 8 in one layer.
#![allow(clippy::needless_bitwise_bool)] // a lazy `&&` is a branch, and lanes have none

use std::ops::Range;

/// Three neighbouring rows of one layer.
pub type ThreeRows<'a> = [&'a [f32]; 3];

multiversioned! {
    /// Appends to `found` the columns in `columns` where the middle row of the middle layer
    /// exceeds `threshold` (at least 0) in absolute value and is not smaller (if positive) or not
    /// larger (if negative) than any of its 26 neighbours.
    ///
    /// # Panics
    /// If `columns` does not leave a column free on each side in every row.
    pub fn find_extrema(layers: &[ThreeRows<'_>; 3], columns: Range<usize>, threshold: f32, found: &mut Vec<u32>) {
        search(layers, columns, threshold, found);
    }

    /// [`find_extrema`] in three differences that are stored nowhere: difference `d` is layer `d + 1`
    /// minus layer `d`.
    ///
    /// # Panics
    /// If `columns` does not leave a column free on each side in every row.
    pub fn find_extrema_of_differences(layers: &[ThreeRows<'_>; 4], columns: Range<usize>, threshold: f32, found: &mut Vec<u32>) {
        search(layers, columns, threshold, found);
    }

    /// Columns in `columns` where `rows[1]` exceeds `threshold` and each of its 8 neighbours.
    ///
    /// # Panics
    /// If `columns` does not leave a column free on each side in every row.
    pub fn find_maxima(rows: &ThreeRows<'_>, columns: Range<usize>, threshold: f32, found: &mut Vec<u32>) {
        const LANES: usize = 16;
        let mut x = columns.start;
        while x + LANES <= columns.end {
            maxima_block::<LANES>(rows, x, threshold, found);
            x += LANES;
        }
        while x < columns.end {
            maxima_block::<1>(rows, x, threshold, found);
            x += 1;
        }
    }
}

/// Three rows of three layers of values.
trait Cube {
    /// Values of `row` of `layer` from column `x` on.
    fn values<const L: usize>(&self, layer: usize, row: usize, x: usize) -> [f32; L];
}

impl Cube for [ThreeRows<'_>; 3] {
    #[inline(always)]
    fn values<const L: usize>(&self, layer: usize, row: usize, x: usize) -> [f32; L] {
        *lanes(self[layer][row], x)
    }
}

/// The differences of neighbouring layers.
impl Cube for [ThreeRows<'_>; 4] {
    #[inline(always)]
    fn values<const L: usize>(&self, layer: usize, row: usize, x: usize) -> [f32; L] {
        let finer = lanes::<L>(self[layer][row], x);
        let mut values = *lanes::<L>(self[layer + 1][row], x);
        for i in 0..L {
            values[i] -= finer[i];
        }
        values
    }
}

#[inline(always)]
fn search(cube: &impl Cube, columns: Range<usize>, threshold: f32, found: &mut Vec<u32>) {
    const LANES: usize = 16;
    let mut x = columns.start;
    while x + LANES <= columns.end {
        block::<LANES>(cube, x, threshold, found);
        x += LANES;
    }
    while x < columns.end {
        block::<1>(cube, x, threshold, found);
        x += 1;
    }
}

/// Most blocks end at the threshold or among the eight neighbours in their own layer.
#[inline(always)]
fn block<const L: usize>(cube: &impl Cube, x: usize, threshold: f32, found: &mut Vec<u32>) {
    let centre = cube.values::<L>(1, 1, x);
    let mut strong = false;
    for value in centre {
        strong |= value.abs() > threshold;
    }
    if !strong {
        return;
    }
    let mut low = cube.values::<L>(1, 1, x - 1);
    let mut high = low;
    widen(&mut low, &mut high, &cube.values(1, 1, x + 1));
    for row in [0, 2] {
        for x in x - 1..=x + 1 {
            widen(&mut low, &mut high, &cube.values(1, row, x));
        }
    }
    if !is_any_extreme(&centre, &low, &high, threshold) {
        return;
    }
    for layer in [0, 2] {
        for row in 0..3 {
            for x in x - 1..=x + 1 {
                widen(&mut low, &mut high, &cube.values(layer, row, x));
            }
        }
        if !is_any_extreme(&centre, &low, &high, threshold) {
            return;
        }
    }
    for i in 0..L {
        if is_extreme(centre[i], low[i], high[i], threshold) {
            found.push((x + i) as u32);
        }
    }
}

#[inline(always)]
fn is_extreme(value: f32, low: f32, high: f32, threshold: f32) -> bool {
    ((value > threshold) & (value >= high)) | ((value < -threshold) & (value <= low))
}

#[inline(always)]
fn is_any_extreme<const L: usize>(
    values: &[f32; L],
    low: &[f32; L],
    high: &[f32; L],
    threshold: f32,
) -> bool {
    let mut any = false;
    for i in 0..L {
        any |= is_extreme(values[i], low[i], high[i], threshold);
    }
    any
}

/// Most blocks end at the threshold.
#[inline(always)]
fn maxima_block<const L: usize>(
    &[above, here, below]: &ThreeRows<'_>,
    x: usize,
    threshold: f32,
    found: &mut Vec<u32>,
) {
    let centre = lanes::<L>(here, x);
    let mut strong = false;
    for &value in centre {
        strong |= value > threshold;
    }
    if !strong {
        return;
    }
    let mut low = *lanes::<L>(here, x - 1);
    let mut high = low;
    widen(&mut low, &mut high, lanes(here, x + 1));
    for row in [above, below] {
        widen(&mut low, &mut high, lanes(row, x - 1));
        widen(&mut low, &mut high, lanes(row, x));
        widen(&mut low, &mut high, lanes(row, x + 1));
    }
    for i in 0..L {
        if centre[i] > threshold && centre[i] > high[i] {
            found.push((x + i) as u32);
        }
    }
}

#[inline(always)]
fn widen<const L: usize>(low: &mut [f32; L], high: &mut [f32; L], values: &[f32; L]) {
    for i in 0..L {
        low[i] = smaller(low[i], values[i]);
        high[i] = larger(high[i], values[i]);
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
    use crate::seed::Seed;

    #[test]
    fn blocks_find_what_the_definition_finds() {
        let mut rng = Seed(5).rng();
        let width = 400;
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
        assert!(expected.len() > 10, "the test sees extrema");
        assert_eq!(found, expected);

        // Layers of which these are the differences.
        let mut sums = vec![vec![0.0; width]; 3];
        for row in &rows {
            let sum = sums[sums.len() - 3].iter().zip(row);
            sums.push(sum.map(|(a, b)| a + b).collect());
        }
        let layers: [ThreeRows<'_>; 4] =
            std::array::from_fn(|l| std::array::from_fn(|y| sums[3 * l + y].as_slice()));
        found.clear();
        find_extrema_of_differences(&layers, 1..width - 1, 2.0, &mut found);
        assert_eq!(found, expected);
    }

    #[test]
    fn maxima_exceed_threshold_and_neighbours() {
        let mut rng = Seed(6).rng();
        let width = 400;
        let rows: Vec<Vec<f32>> = (0..3)
            .map(|_| (0..width).map(|_| rng.below(9) as f32 - 4.0).collect())
            .collect();
        let layer: ThreeRows<'_> = std::array::from_fn(|y| rows[y].as_slice());
        let mut found = Vec::new();
        find_maxima(&layer, 1..width - 1, 1.0, &mut found);
        let expected: Vec<u32> = (1..width - 1)
            .filter(|&x| {
                let value = rows[1][x];
                let around = rows.iter().flat_map(|row| &row[x - 1..=x + 1]);
                value > 1.0 && around.filter(|&&v| v >= value).count() == 1
            })
            .map(|x| x as u32)
            .collect();
        assert!(expected.len() > 10, "the test sees maxima");
        assert_eq!(found, expected);
    }
}
