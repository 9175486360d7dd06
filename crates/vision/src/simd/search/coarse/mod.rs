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
//!    the bytes of SIFT: of 85,000 candidates these leave about one in 160, of which the bytes of all values
//!    leave one in thirteen (ASIFT, castle, AVX-512). Queries that are near to each other see the candidates near to
//!    them first, so small distances are known from the start.
//! 5. The caller compares what is left, mostly the two nearest themselves, by the definition of the
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

/// Pairs from which on principal components are worth the work of finding them: with AVX2 SIFT's 9,800 x 7,500
/// are faster with them, 5,000 x 5,000 slower.
const PAIRS: usize = 60_000_000;

/// The same with AVX-512, where products of all values cost less: of SIFT's descriptors 15,900 x 15,300 are
/// faster with them, 9,800 x 7,800 slower, of ASIFT's 14,000 x 14,000 and 10,000 x 10,000.
const PAIRS_AVX512: usize = 200_000_000;

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
fn search(
    a: &[f32],
    b: &[f32],
    dim: usize,
    is_large: bool,
    apart: impl Fn(u32, u32) -> bool,
) -> Vec<Vec<u32>> {
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
    /// See [`is_wide`].
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
        if let Some(then) = then {
            // On their way while components are compared.
            prefetch(then.candidates_of_panel(number).0);
        }
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
            let (candidates, parts) = then.candidates_of_panel(number);
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
