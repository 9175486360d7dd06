//! The nearest by Euclidean distance, with products of bytes.
//!
//! *How it works.*
//! 1. Values become bytes (see [`Grid`](grid::Grid)). By the triangle inequality the distance of two rows of
//!    bytes differs from the scaled distance of the rows by at most the lengths of what rounding
//!    took from either.
//! 2. With `|a - b|^2 = |a|^2 + |b|^2 - 2 a.b` each instruction multiplies and adds 32 pairs of
//!    bytes, or 64.
//! 3. A candidate is rejected if even the lower bound of its distance exceeds the second smallest distance so
//!    far. For the few others the distance is computed in full, which may lower that second smallest.
//! 4. Large searches look at the first principal components alone first ([`Principal`]), a quarter of
//!    the bytes of SIFT: of 100,000 candidates these leave one in 130, of which the bytes of all values leave one
//!    in eleven. Queries that are near to each other see the candidates near to them first, so small
//!    distances are known from the start.
//! 5. The caller compares what is left, mostly the two nearest themselves, by the definition of the
//!    distance; so the results are those of the search by definition.

mod grid;
mod panels;
mod principal;
mod tile;
mod within;

use self::grid::{MAX_DIM, squared_distance};
use self::panels::{Bounds, Panels};
use self::principal::Principal;
use self::tile::Tile;
use self::within::{LANES, ROWS, keep, keep_avx512, prefetch, within, within_avx512};
use crate::simd::InstructionSet;

/// Queries that see a panel one after the other: whole blocks. Their bytes fill a tenth of a second-level
/// cache, and the candidates of each panel are fetched for so many at once; with more of them they have
/// less in common.
const QUERIES: usize = 128 * ROWS;

/// Measured candidates that a query may have on average, besides one in [`MEASURED_SHARE`] of all
/// that it has seen: with more of them the definition is as fast.
const MEASURED: usize = 80;

/// The same of candidates that principal components do not rule out: of descriptors of SIFT, half of those
/// of a whole search are among the first few thousand, the nearest.
const LEFT: usize = 400;

/// See [`MEASURED`].
const MEASURED_SHARE: usize = 16;

/// Values of `b` from which on bytes are worth the work of making them: with fewer, too many of the
/// candidates are measured.
const WORTH: usize = 40_000;

/// Pairs from which on principal components are worth the work of finding them: of SIFT's descriptors 9,800
/// x 7,500 are faster with them, 5,000 x 5,000 slower.
const PAIRS: usize = 60_000_000;

/// For the first rows of `a`, as many as bytes help to find, the rows of `b` that may be nearest, in
/// ascending order. Among them are all that are, by the definition, at most as far as the farther of
/// any two that are `apart`: all that are no farther than the second nearest if `apart` says so of
/// any two rows.
///
/// There are no rows where `b` is small, some value is not finite or of extreme size, rows are very
/// long, or the processor lacks AVX2; and no more of them after rows whose candidates are too much
/// alike.
pub(super) fn near_rows(
    a: &[f32],
    b: &[f32],
    dim: usize,
    apart: impl Fn(u32, u32) -> bool,
) -> Vec<Vec<u32>> {
    if !((1..=MAX_DIM).contains(&dim) && b.len() >= WORTH && has_avx2_and_fma()) {
        return Vec::new();
    }
    let is_large = (a.len() / dim) * (b.len() / dim) >= PAIRS;
    // SAFETY: AVX2 and FMA were detected on this processor.
    unsafe { search(a, b, dim, is_large, apart) }
}

fn has_avx2_and_fma() -> bool {
    InstructionSet::in_use() >= InstructionSet::Avx2
}

/// [`near_rows`] without its tests; principal components are tried if the search `is_large`.
#[target_feature(enable = "avx2,fma")]
fn search(
    a: &[f32],
    b: &[f32],
    dim: usize,
    is_large: bool,
    apart: impl Fn(u32, u32) -> bool,
) -> Vec<Vec<u32>> {
    let is_wide = InstructionSet::in_use() == InstructionSet::Avx512;
    let principal = is_large.then(|| Principal::of(a, b, dim)).flatten();
    let orders = match &principal {
        Some(principal) => principal.orders(),
        None => [a, b].map(|rows| (0..(rows.len() / dim) as u32).collect()),
    };
    let Some(whole) = Bounds::of([a, b], &orders, dim, is_wide) else {
        return Vec::new();
    };
    let search = Search {
        rows: [a, b],
        dim,
        orders: &orders,
        apart,
        is_wide,
    };
    let near = match principal.and_then(|principal| First::of(principal, &orders, is_wide)) {
        Some(first) => search.in_two_steps(first, whole),
        None => search.in_one_step(whole),
    };
    near.into_iter().map_while(|near| near).collect()
}

/// The first of two steps: bounds of the principal components.
struct First {
    panels: Panels,
    principal: Principal,
    /// Of the components of each panel's candidates.
    means: Vec<[f32; principal::COMPONENTS]>,
}

impl First {
    #[target_feature(enable = "avx2,fma")]
    fn of(principal: Principal, orders: &[Vec<u32>; 2], is_wide: bool) -> Option<Self> {
        let rows = [&principal.a[..], &principal.b];
        let mut bounds = Bounds::of(rows, orders, principal::COMPONENTS, is_wide)?;
        bounds.allow(principal.rounding, principal.stretch);
        let panels = orders[1].chunks(LANES);
        Some(Self {
            panels: Panels::of(bounds),
            means: panels
                .map(|rows| principal::mean_of(&principal.b, rows))
                .collect(),
            principal,
        })
    }

    /// All panels, those whose means are near to the mean of `queries` first.
    #[target_feature(enable = "avx2,fma")]
    fn panels_near(&self, queries: &[u32]) -> Vec<usize> {
        let mean = principal::mean_of(&self.principal.a, queries);
        let distances: Vec<f32> = (self.means.iter())
            .map(|panel| squared_distance(panel, &mean))
            .collect();
        let mut panels: Vec<usize> = (0..distances.len()).collect();
        panels.sort_by(|&i, &j| distances[i].total_cmp(&distances[j]));
        panels
    }
}

/// Rows of `a` and `b`, and the orders in which they are looked at.
struct Search<'a, Apart> {
    rows: [&'a [f32]; 2],
    dim: usize,
    orders: &'a [Vec<u32>; 2],
    apart: Apart,
    /// Whether AVX-512 with products of bytes is in use.
    is_wide: bool,
}

impl<Apart: Fn(u32, u32) -> bool> Search<'_, Apart> {
    /// The rows that may be nearest to each row of `a`; `None` where bytes did not help.
    #[target_feature(enable = "avx2,fma")]
    fn in_one_step(&self, whole: Bounds) -> Vec<Option<Vec<u32>>> {
        let panels = Panels::of(whole);
        let mut near = vec![None; self.orders[0].len()];
        for first in (0..near.len()).step_by(QUERIES) {
            let Some(tile) = self.by_all_values(&panels, first) else {
                break;
            };
            self.note(&tile, &mut near);
        }
        near
    }

    /// The same with bounds of the principal components before those of all values.
    #[target_feature(enable = "avx2,fma")]
    fn in_two_steps(&self, first_step: First, whole: Bounds) -> Vec<Option<Vec<u32>>> {
        let mut near = vec![None; self.orders[0].len()];
        // Made when components alone rule out too little.
        let mut panels = None;
        let (mut tried, mut failed) = (0, 0);
        for first in (0..near.len()).step_by(QUERIES) {
            let mut found = None;
            if 2 * failed <= tried {
                let mut tile = self.tile(first);
                let order = first_step.panels_near(&self.orders[0][first..][..tile.queries.len()]);
                let step = self.measure(&first_step.panels, Some(&whole), order, &mut tile);
                tried += 1;
                failed += usize::from(step.is_none());
                found = step.map(|()| tile);
            }
            if found.is_none() {
                let panels = panels.get_or_insert_with(|| Panels::of(whole.clone()));
                found = self.by_all_values(panels, first);
            }
            let Some(tile) = found else {
                break;
            };
            self.note(&tile, &mut near);
        }
        near
    }

    /// The tile whose first query is `first`.
    fn tile(&self, first: usize) -> Tile {
        Tile::new(first, QUERIES.min(self.orders[0].len() - first))
    }

    /// The same after a search in one step.
    #[target_feature(enable = "avx2,fma")]
    fn by_all_values(&self, panels: &Panels, first: usize) -> Option<Tile> {
        let mut tile = self.tile(first);
        let order = (0..panels.count()).collect();
        self.measure(panels, None, order, &mut tile)?;
        Some(tile)
    }

    /// Notes what was found for the queries of a tile.
    fn note(&self, tile: &Tile, near: &mut [Option<Vec<u32>>]) {
        for (query, &row) in tile.queries.iter().zip(&self.orders[0][tile.first..]) {
            near[row as usize] = Some(query.near_enough());
        }
    }

    /// Measures all that may be within the bounds of a tile of queries; `None` if these are too many. In
    /// two steps, what `panels` do not rule out is looked at with the bounds `then`.
    #[target_feature(enable = "avx2,fma")]
    fn measure(
        &self,
        panels: &Panels,
        then: Option<&Bounds>,
        order: Vec<usize>,
        tile: &mut Tile,
    ) -> Option<()> {
        let (mut left, mut seen) = (0, 0);
        for number in order {
            let first = number * LANES;
            let lanes = u64::MAX >> (LANES - LANES.min(self.orders[1].len() - first));
            if seen == 0 {
                // Nothing is known yet: the first few bring bounds for the next few.
                for some in [0xff, 0xff << 8, 0xffff << 16, u64::MAX << 32] {
                    left += self.scan(panels, then, number, lanes & some, tile);
                }
            } else {
                left += self.scan(panels, then, number, lanes, tile);
            }
            let allowed = if then.is_some() { LEFT } else { MEASURED };
            if left > tile.queries.len() * (allowed + seen / MEASURED_SHARE) {
                return None;
            }
            seen += LANES;
        }
        Some(())
    }

    /// Measures those of `lanes` of a panel that may be within the bounds, and returns how many `panels` left.
    #[target_feature(enable = "avx2,fma")]
    fn scan(
        &self,
        panels: &Panels,
        then: Option<&Bounds>,
        number: usize,
        lanes: u64,
        tile: &mut Tile,
    ) -> usize {
        let (panel, starts) = panels.panel(number);
        let quads = panels.bounds.queries_from(tile.first);
        if self.is_wide {
            // SAFETY: what is in use was detected on this processor.
            unsafe { within_avx512(quads, &tile.least, panel, starts, &mut tile.within) };
        } else {
            within(quads, &tile.least, panel, starts, &mut tile.within);
        }
        tile.list_pairs(lanes);
        let left = tile.pairs.len();
        if let Some(then) = then {
            let queries = then.queries_from(tile.first);
            let (candidates, parts) = then.candidates_from(number * LANES);
            let (pairs, limits) = (&mut tile.pairs, &tile.limits);
            if self.is_wide {
                // SAFETY: as before.
                unsafe { keep_avx512(pairs, queries, candidates, parts, limits) };
            } else {
                keep(pairs, queries, candidates, parts, limits);
            }
            for pair in &tile.pairs {
                prefetch(self.row(1, number * LANES + pair.lane()));
            }
        }
        for &pair in &tile.pairs {
            let place = tile.first + pair.query();
            let candidate = number * LANES + pair.lane();
            let distance = squared_distance(self.row(0, place), self.row(1, candidate));
            let query = &mut tile.queries[pair.query()];
            if query.admits(distance) {
                query.offer(self.orders[1][candidate], distance, &self.apart);
                let bound = query.bound;
                tile.least[pair.query() / ROWS][pair.query() % ROWS] =
                    panels.bounds.least(place, bound);
                if let Some(then) = then {
                    tile.limits[pair.query()] = then.limit(place, bound);
                }
            }
        }
        left
    }

    /// The row at a place in the order of queries (side 0) or candidates (side 1).
    #[inline]
    fn row(&self, side: usize, place: usize) -> &[f32] {
        let row = self.orders[side][place] as usize;
        &self.rows[side][row * self.dim..][..self.dim]
    }
}

#[cfg(test)]
mod tests {
    use super::super::{TwoNearest, two_nearest_among, two_nearest_floats};
    use super::*;
    use crate::seed::{Rng, Seed};

    /// The definition.
    fn defined(a: &[f32], b: &[f32], dim: usize) -> Vec<TwoNearest> {
        let all: Vec<u32> = (0..(b.len() / dim) as u32).collect();
        a.chunks_exact(dim)
            .map(|row| two_nearest_among(row, b, &all))
            .collect()
    }

    /// Rows more or less near to one of a few: like descriptors, much nearer to some than to most.
    fn clustered(rng: &mut Rng, rows: usize, dim: usize, centres: &[f32]) -> Vec<f32> {
        let mut clustered = Vec::new();
        for _ in 0..rows {
            let centre = rng.below((centres.len() / dim) as u32) as usize;
            let width = 0.5 * rng.uniform() as f32;
            let centre = &centres[centre * dim..][..dim];
            clustered.extend(
                centre
                    .iter()
                    .map(|value| value + width * rng.normal() as f32),
            );
        }
        clustered
    }

    /// Rows as mixtures of a few directions, the first of them with most weight, and a little of all others:
    /// like descriptors, whose values hang together.
    fn mixed(rng: &mut Rng, rows: usize, dim: usize, directions: &[f32]) -> Vec<f32> {
        let mut mixed = Vec::new();
        for _ in 0..rows {
            let first = mixed.len();
            mixed.extend((0..dim).map(|_| 0.05 * rng.normal() as f32));
            for (number, direction) in directions.chunks_exact(dim).enumerate() {
                let weight = rng.normal() as f32 / (1.0 + number as f32).sqrt();
                for (value, direction) in mixed[first..].iter_mut().zip(direction) {
                    *value += weight * direction;
                }
            }
        }
        mixed
    }

    /// [`search`] in two steps if `is_large` and the rows allow it.
    fn near(a: &[f32], b: &[f32], dim: usize, is_large: bool) -> Vec<Vec<u32>> {
        if dim > MAX_DIM || !has_avx2_and_fma() {
            return Vec::new();
        }
        // SAFETY: AVX2 and FMA were detected on this processor.
        unsafe { search(a, b, dim, is_large, |_, _| true) }
    }

    /// Compares both ways of searching with the definition; returns for how many rows bytes were enough
    /// in one step and in two.
    fn compare(a: &[f32], b: &[f32], dim: usize) -> [usize; 2] {
        let expected = defined(a, b, dim);
        assert_eq!(two_nearest_floats(a, b, dim), expected, "{dim} values");
        [false, true].map(|is_large| {
            let near = near(a, b, dim, is_large);
            let found = near.iter().zip(a.chunks_exact(dim));
            let found: Vec<TwoNearest> = found
                .map(|(near, row)| two_nearest_among(row, b, near))
                .collect();
            assert_eq!(found, expected[..found.len()], "{dim} values, {is_large}");
            found.len()
        })
    }

    /// Checks rows drawn around 60 places, with all values changed by `change(value, column)`; returns
    /// for how many rows bytes were enough.
    fn check(rows: usize, dim: usize, change: impl Fn(f32, usize) -> f32) -> usize {
        let mut rng = Seed(3).rng();
        let centres: Vec<f32> = (0..60 * dim).map(|_| rng.normal() as f32).collect();
        let [a, b] = [rows, WORTH.div_ceil(dim).max(900)].map(|rows| -> Vec<f32> {
            let values = clustered(&mut rng, rows, dim, &centres);
            changed(&values, dim, &change)
        });
        let [one_step, two_steps] = compare(&a, &b, dim);
        assert_eq!(one_step == 0, two_steps == 0, "{dim} values");
        one_step
    }

    /// The same of mixed rows; returns for how many rows two steps were enough.
    fn check_mixed(rows: usize, dim: usize, change: impl Fn(f32, usize) -> f32) -> usize {
        let mut rng = Seed(4).rng();
        let directions: Vec<f32> = (0..20 * dim).map(|_| rng.normal() as f32).collect();
        let [a, b] = [rows, 1_500].map(|rows| -> Vec<f32> {
            let values = mixed(&mut rng, rows, dim, &directions);
            changed(&values, dim, &change)
        });
        compare(&a, &b, dim)[1]
    }

    fn changed(values: &[f32], dim: usize, change: impl Fn(f32, usize) -> f32) -> Vec<f32> {
        let values = values.iter().zip((0..dim).cycle());
        values
            .map(|(&value, column)| change(value, column))
            .collect()
    }

    #[test]
    fn components_are_enough_for_rows_whose_values_hang_together() {
        let rows = QUERIES + 40;
        for dim in [33, 64, 128, 203] {
            InstructionSet::for_each(|set| {
                let found = check_mixed(rows, dim, |value, _| value);
                assert!(
                    found == rows || !has_avx2_and_fma(),
                    "{found} of {rows} rows of {dim} with {set:?}"
                );
            });
        }
    }

    #[test]
    fn offsets_and_sizes_of_columns_change_no_result_of_components() {
        InstructionSet::for_each(|_| {
            check_mixed(200, 128, |value, column| value + 1e4 * column as f32);
            check_mixed(
                200,
                128,
                |value, column| if column == 7 { 1e5 * value } else { value },
            );
            // Values in other columns than a few are rounded away, or lie at a few places.
            check_mixed(
                200,
                128,
                |value, column| if column < 5 { value } else { 1e-6 * value },
            );
            check_mixed(
                200,
                128,
                |value, column| if column < 5 { value } else { 3.0 },
            );
            check_mixed(200, 128, |value, _| value.round());
            check_mixed(200, 128, |value, _| 1e3 + 1e-3 * value);
            check_mixed(200, 32, |value, _| value);
        });
    }

    #[test]
    fn rows_far_from_all_others_change_no_result_of_components() {
        let mut rng = Seed(8).rng();
        let dim = 96;
        let directions: Vec<f32> = (0..20 * dim).map(|_| rng.normal() as f32).collect();
        let mut b = mixed(&mut rng, 2_500, dim, &directions);
        // Of these rows none is in the sample, so their directions are no components.
        for (row, size) in [(1, 40.0), (3, 1e3), (2_499, 1e6)] {
            b[row * dim + 5] += size;
        }
        let a = b[..300 * dim]
            .iter()
            .map(|value| value + 0.01)
            .collect::<Vec<f32>>();
        for candidates in [&b[..1_500 * dim], &b] {
            InstructionSet::for_each(|_| {
                compare(&a, candidates, dim);
                compare(candidates, &a, dim);
            });
        }
    }

    #[test]
    fn what_is_no_number_is_left_to_the_definition() {
        for other in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            for place in [3, 128 * 1_499 + 127] {
                let mut rng = Seed(9).rng();
                let directions: Vec<f32> = (0..20 * 128).map(|_| rng.normal() as f32).collect();
                let mut b = mixed(&mut rng, 1_500, 128, &directions);
                let a = b[..40 * 128].to_vec();
                b[place] = other;
                assert_eq!(compare(&a, &b, 128), [0; 2], "{other}");
                assert_eq!(compare(&b, &a, 128), [0; 2], "{other}");
            }
        }
        assert_eq!(compare(&[2.5; 40 * 128], &[2.5; 500 * 128], 128), [0; 2]);
    }

    #[test]
    fn all_within_the_bound_are_found_where_two_must_be_apart() {
        let mut rng = Seed(10).rng();
        let dim = 128;
        let directions: Vec<f32> = (0..20 * dim).map(|_| rng.normal() as f32).collect();
        let [a, b] = [100, 1_500].map(|rows| mixed(&mut rng, rows, dim, &directions));
        let apart = |i: u32, j: u32| (i / 500) != (j / 500);
        let distances = |row: &[f32]| -> Vec<f32> {
            let nearest = |index| two_nearest_among(row, &b, &[index]).nearest;
            (0..1_500).map(nearest).collect()
        };
        InstructionSet::for_each(|_| {
            for is_large in [false, true] {
                let near = if has_avx2_and_fma() {
                    // SAFETY: AVX2 and FMA were detected on this processor.
                    unsafe { search(&a, &b, dim, is_large, apart) }
                } else {
                    return;
                };
                assert!(near.len() == 100 || !is_large, "{}", near.len());
                for (row, near) in a.chunks_exact(dim).zip(near) {
                    let distances = distances(row);
                    let least =
                        |places: &[f32]| places.iter().copied().fold(f32::INFINITY, f32::min);
                    let mut of_places: Vec<f32> = distances.chunks(500).map(least).collect();
                    of_places.sort_by(f32::total_cmp);
                    assert!(near.is_sorted());
                    for (index, &distance) in (0..).zip(&distances) {
                        assert!(distance > of_places[1] || near.contains(&index));
                    }
                }
            }
        });
    }

    #[test]
    fn where_components_rule_out_too_little_all_values_are_compared() {
        // Groups differ in what is no component: it is not in the sample, every second row.
        let (dim, groups) = (128, 40);
        let mut rng = Seed(12).rng();
        let directions: Vec<f32> = (0..3 * dim).map(|_| 0.2 * rng.normal() as f32).collect();
        let places: Vec<f32> = (0..groups * dim).map(|_| rng.normal() as f32).collect();
        let [a, b] = [2 * QUERIES, 2_000].map(|rows| -> Vec<f32> {
            let mut values = mixed(&mut rng, rows, dim, &directions);
            let odd = values.chunks_exact_mut(dim).skip(1).step_by(2);
            for (number, row) in odd.enumerate() {
                let place = places.chunks_exact(dim).nth(number % groups);
                for (value, place) in row.iter_mut().zip(place.expect("one of them")) {
                    *value += place;
                }
            }
            values
        });
        compare(&a, &b, dim);
    }

    #[test]
    fn bytes_are_enough_for_rows_like_descriptors() {
        let rows = QUERIES + 40;
        for dim in [63, 64, 128, 200] {
            InstructionSet::for_each(|set| {
                let found = check(rows, dim, |value, _| value);
                assert!(
                    found == rows || !has_avx2_and_fma(),
                    "{found} of {rows} rows of {dim} with {set:?}"
                );
            });
        }
    }

    #[test]
    fn offsets_and_sizes_of_columns_change_no_result() {
        check(200, 65, |value, column| value + 1e4 * column as f32);
        check(
            200,
            65,
            |value, column| if column == 7 { 1e5 * value } else { value },
        );
        check(
            200,
            65,
            |value, column| if column == 7 { value } else { 1e-6 * value },
        );
        check(200, 3, |value, _| (8.0 * value).round());
    }

    #[test]
    fn rows_too_much_alike_are_left_to_the_definition() {
        // A few values far out make the grid too coarse for the others.
        let alike = |value: f32, _| if value > 4.0 { 1e3 * value } else { value };
        assert_eq!(check(QUERIES + 40, 128, alike), 0);
    }

    #[test]
    fn what_bytes_cannot_hold_is_left_to_the_definition() {
        for factor in [0.0, 1e-18, 1e15] {
            assert_eq!(
                check(30, 16, |value, _| factor * value),
                0,
                "times {factor}"
            );
        }
        for other in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let change = |value: f32, column: usize| {
                if column == 3 && value > 2.0 {
                    other
                } else {
                    value
                }
            };
            assert_eq!(check(30, 16, change), 0, "{other}");
        }
        assert_eq!(check(7, MAX_DIM + 1, |value, _| value), 0);
    }
}
