//! The nearest by Euclidean distance, with products of bytes.
//!
//! *How it works.*
//! 1. Values become bytes (see [`Grid`](grid::Grid)). By the triangle inequality the distance of two rows of
//!    bytes differs from the scaled distance of the rows by at most the lengths of what rounding
//!    took from either.
//! 2. With `|a - b|^2 = |a|^2 + |b|^2 - 2 a.b` each instruction multiplies and adds 32 pairs of
//!    bytes, or 64.
//! 3. A candidate is rejected if even the lower bound of its distance exceeds the second smallest distance so
//!    far. For the few others the distance is computed in full, which may lower that second smallest. With AVX-512
//!    bytes are exact where values are whole numbers, as those of SIFT are, and tell the distance themselves.
//! 4. With AVX-512 the second smallest of the first few hundred candidates is found at once, without a look at
//!    single ones, so that few are within the bounds from the start.
//! 5. Large searches look at the first principal components alone first ([`Principal`]), a quarter of
//!    the bytes of SIFT: of 85,000 candidates these leave about one in 160 (ASIFT, castle, AVX-512). Queries that are near to each other see the candidates near to
//!    them first, so small distances are known from the start.
//! 6. The caller compares what is left, mostly the two nearest themselves, by the definition of the
//!    distance; so the results are those of the search by definition.

mod grid;
mod panels;
mod principal;
#[cfg(test)]
mod tests;
mod tile;
mod within;

use self::grid::{MAX_DIM, squared_distance};
use self::panels::{Bounds, Panels};
use self::principal::Principal;
use self::tile::{Apart, Tile};
use self::within::{
    LANES, ROWS, keep, keep_avx512, prefetch, second_sums_avx512, within, within_avx512,
};
use crate::simd::InstructionSet;

/// Queries that see a panel one after the other: whole blocks. Their bytes fill a tenth of a second-level
/// cache, and the candidates of each panel are fetched for so many at once; with more of them they have
/// less in common.
const QUERIES: usize = 128 * ROWS;

/// Candidates within the bounds that a query may have on average, besides one in [`MEASURED_SHARE`] of all
/// that it has seen: with more of them the definition is as fast.
const MEASURED: usize = 80;

/// The same of candidates that principal components do not rule out: of descriptors of SIFT, half of those
/// of a whole search are among the first few thousand, the nearest.
const LEFT: usize = 400;

/// See [`MEASURED`].
const MEASURED_SHARE: usize = 16;

/// Panels whose second smallest distance is found at once: with 2 of them 9,800 x 7,500 descriptors of SIFT take 4 %
/// longer, with 16 of them 2 %.
const FIRST: usize = 8;

/// Values of `b` from which on bytes are worth the work of making them: with fewer, too many of the
/// candidates are measured.
const WORTH: usize = 40_000;

/// Pairs from which on principal components are worth the work of finding them: with AVX2 SIFT's 9,800 x 7,500
/// are faster with them, 5,000 x 5,000 slower.
const PAIRS: usize = 60_000_000;

/// The same with AVX-512: of SIFT's descriptors 7,800 x 7,500 are faster with them, 6,100 x 7,500 slower.
const PAIRS_AVX512: usize = 50_000_000;

/// For the first rows of `a`, as many as bytes help to find, the rows of `b` that may be nearest, in
/// ascending order. Among them are all that are, by the definition, at most as far as the farther of
/// any two that are `apart`: without it of any two, so all that are no farther than the second nearest.
///
/// There are no rows where `b` is small, some value is not finite or of extreme size, rows are very
/// long, or the processor lacks AVX2; and no more of them after rows whose candidates are too much
/// alike.
pub(super) fn near_rows(a: &[f32], b: &[f32], dim: usize, apart: Option<Apart>) -> Vec<Vec<u32>> {
    if !((1..=MAX_DIM).contains(&dim) && b.len() >= WORTH && has_avx2_and_fma()) {
        return Vec::new();
    }
    let worth = if is_wide() { PAIRS_AVX512 } else { PAIRS };
    let is_large = (a.len() / dim) * (b.len() / dim) >= worth;
    // SAFETY: AVX2 and FMA were detected on this processor.
    unsafe { search(a, b, dim, is_large, apart) }
}

fn has_avx2_and_fma() -> bool {
    InstructionSet::in_use() >= InstructionSet::Avx2
}

/// Whether AVX-512 with products of bytes is in use.
fn is_wide() -> bool {
    InstructionSet::in_use() == InstructionSet::Avx512
}

/// [`near_rows`] without its tests; principal components are tried if the search `is_large`.
#[target_feature(enable = "avx2,fma")]
fn search(a: &[f32], b: &[f32], dim: usize, is_large: bool, apart: Option<Apart>) -> Vec<Vec<u32>> {
    let is_wide = is_wide();
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
    let whole = Step::of(whole);
    let near = match principal.and_then(|principal| Components::of(principal, &orders, is_wide)) {
        Some(components) => search.in_two_steps(&components, &whole),
        None => search.in_one_step(&whole),
    };
    near.into_iter().map_while(|near| near).collect()
}

/// What candidates are compared by in one step.
struct Step {
    bounds: Bounds,
    panels: Panels,
}

impl Step {
    fn of(bounds: Bounds) -> Self {
        let panels = Panels::of(&bounds);
        Self { bounds, panels }
    }
}

/// The first of two steps: bounds of the principal components.
struct Components {
    step: Step,
    principal: Principal,
    /// Of the components of each panel's candidates.
    means: Vec<[f32; principal::COMPONENTS]>,
}

impl Components {
    #[target_feature(enable = "avx2,fma")]
    fn of(principal: Principal, orders: &[Vec<u32>; 2], is_wide: bool) -> Option<Self> {
        let rows = [&principal.a[..], &principal.b];
        let mut bounds = Bounds::of(rows, orders, principal::COMPONENTS, is_wide)?;
        bounds.allow(principal.rounding, principal.stretch);
        let panels = orders[1].chunks(LANES);
        Some(Self {
            step: Step::of(bounds),
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
struct Search<'a> {
    rows: [&'a [f32]; 2],
    dim: usize,
    orders: &'a [Vec<u32>; 2],
    apart: Option<Apart<'a>>,
    /// See [`is_wide`].
    is_wide: bool,
}

impl Search<'_> {
    /// The rows that may be nearest to each row of `a`; `None` where bytes did not help.
    #[target_feature(enable = "avx2,fma")]
    fn in_one_step(&self, whole: &Step) -> Vec<Option<Vec<u32>>> {
        let mut near = vec![None; self.orders[0].len()];
        for first in (0..near.len()).step_by(QUERIES) {
            let Some(tile) = self.by_all_values(whole, first) else {
                break;
            };
            self.note(&tile, &mut near);
        }
        near
    }

    /// The same with bounds of the principal components before those of all values.
    #[target_feature(enable = "avx2,fma")]
    fn in_two_steps(&self, components: &Components, whole: &Step) -> Vec<Option<Vec<u32>>> {
        let mut near = vec![None; self.orders[0].len()];
        let (mut tried, mut failed) = (0, 0);
        for first in (0..near.len()).step_by(QUERIES) {
            let mut found = None;
            if 2 * failed <= tried {
                let mut tile = self.tile(first);
                let order = components.panels_near(&self.orders[0][first..][..tile.queries.len()]);
                let step = self.measure(&components.step, whole, LEFT, &order, &mut tile);
                tried += 1;
                failed += usize::from(step.is_none());
                found = step.map(|()| tile);
            }
            if found.is_none() {
                found = self.by_all_values(whole, first);
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
    fn by_all_values(&self, whole: &Step, first: usize) -> Option<Tile> {
        let mut tile = self.tile(first);
        let order: Vec<usize> = (0..whole.panels.count()).collect();
        self.measure(whole, whole, MEASURED, &order, &mut tile)?;
        Some(tile)
    }

    /// Notes what was found for the queries of a tile.
    fn note(&self, tile: &Tile, near: &mut [Option<Vec<u32>>]) {
        for (query, &row) in tile.queries.iter().zip(&self.orders[0][tile.first..]) {
            near[row as usize] = Some(query.near_enough());
        }
    }

    /// Looks at all panels, in an order, for candidates that may be within the bounds of a tile of queries; `None` if
    /// `step` leaves too many, of which `allowed` are no matter. What it leaves is looked at with the bounds of
    /// the `whole` rows.
    #[target_feature(enable = "avx2,fma")]
    fn measure(
        &self,
        step: &Step,
        whole: &Step,
        allowed: usize,
        order: &[usize],
        tile: &mut Tile,
    ) -> Option<()> {
        let is_warm = self.warm_up(step, whole, order, tile);
        let (mut left, mut seen) = (0, 0);
        for &number in order {
            let first = number * LANES;
            let lanes = u64::MAX >> (LANES - LANES.min(self.orders[1].len() - first));
            if seen == 0 && !is_warm {
                // Nothing is known yet: the first few bring bounds for the next few.
                for some in [0xff, 0xff << 8, 0xffff << 16, u64::MAX << 32] {
                    left += self.scan(step, whole, number, lanes & some, tile);
                }
            } else {
                left += self.scan(step, whole, number, lanes, tile);
            }
            if left > tile.queries.len() * (allowed + seen / MEASURED_SHARE) {
                return None;
            }
            seen += LANES;
        }
        Some(())
    }

    /// Sets the bounds of a tile of queries by the first panels of an order; whether that could be done.
    #[target_feature(enable = "avx2,fma")]
    fn warm_up(&self, step: &Step, whole: &Step, order: &[usize], tile: &mut Tile) -> bool {
        if !self.is_wide || self.apart.is_some() {
            return false;
        }
        // Lanes without a candidate would pass for some.
        let full = self.orders[1].len() / LANES;
        let panels = order.iter().filter(|&&number| number < full).take(FIRST);
        let panels: Vec<_> = panels.map(|&number| whole.panels.panel(number)).collect();
        if panels.is_empty() {
            return false;
        }
        let queries = whole.bounds.queries_from(tile.first);
        let mut second = vec![[0; ROWS]; tile.least.len()];
        // SAFETY: what is in use was detected on this processor.
        unsafe { second_sums_avx512(queries, &panels, &mut second) };
        for (number, &sum) in (0..tile.queries.len()).zip(second.as_flattened()) {
            tile.queries[number].bound = whole.bounds.largest(tile.first + number, sum);
            tile.set_limits(number, &step.bounds, &whole.bounds);
        }
        true
    }

    /// Looks at those of `lanes` of a panel that may be within the bounds, and returns how many `step` left.
    #[target_feature(enable = "avx2,fma")]
    fn scan(&self, step: &Step, whole: &Step, number: usize, lanes: u64, tile: &mut Tile) -> usize {
        let (panel, starts) = step.panels.panel(number);
        let quads = step.bounds.queries_from(tile.first);
        let queries = whole.bounds.queries_from(tile.first);
        let (candidates, parts) = whole.bounds.candidates_of_panel(number);
        // On their way while the panel is compared.
        prefetch(candidates);
        if self.is_wide {
            // SAFETY: what is in use was detected on this processor.
            unsafe { within_avx512(quads, &tile.least, panel, starts, &mut tile.within) };
        } else {
            within(quads, &tile.least, panel, starts, &mut tile.within);
        }
        let left = tile.list_pairs(lanes);
        let (pairs, limits) = (&tile.pairs[..left], &tile.limits);
        let kept = if self.is_wide {
            // SAFETY: as before.
            unsafe { keep_avx512(pairs, queries, candidates, parts, limits, &mut tile.kept) }
        } else {
            keep(pairs, queries, candidates, parts, limits, &mut tile.kept)
        };
        if !whole.bounds.are_exact() {
            for (pair, _) in &tile.kept[..kept] {
                prefetch(self.row(1, number * LANES + pair.lane()));
            }
        }
        for kept in 0..kept {
            let (pair, distance) = tile.kept[kept];
            let candidate = number * LANES + pair.lane();
            let place = tile.first + pair.query();
            let distance = if whole.bounds.are_exact() {
                whole.bounds.distance(place, distance)
            } else {
                squared_distance(self.row(0, place), self.row(1, candidate)).sqrt()
            };
            let query = &mut tile.queries[pair.query()];
            if query.offer(self.orders[1][candidate], distance, self.apart) {
                tile.set_limits(pair.query(), &step.bounds, &whole.bounds);
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
