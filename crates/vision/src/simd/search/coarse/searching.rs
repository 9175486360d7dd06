//! The search among prepared candidates: one tile of queries after the other, one panel of candidates after the
//! other.

use super::candidates::{Candidates, Components};
use super::grid::squared_distance;
use super::keep::{self, Rows};
use super::panels::Bounds;
use super::principal::{self, Projected, mean_of};
use super::tile::{Query, Tile, Wanted};
use super::within::{self, LANES, ROWS};
use crate::simd::prefetch::prefetch;

/// Queries that see a panel one after the other: whole blocks. Their bytes fill a tenth of a second-level
/// cache, and the candidates of each panel are fetched for so many at once; with more of them they have
/// less in common.
pub(super) const QUERIES: usize = 128 * ROWS;

/// Candidates within the bounds that a query may have on average, besides one in [`MEASURED_SHARE`] of all
/// that it has seen: with more of them the definition is as fast.
const MEASURED: usize = 80;

/// The same of candidates that principal components do not rule out: of descriptors of SIFT, half of those
/// of a whole search are among the first few thousand, the nearest.
const LEFT: usize = 400;

/// See [`MEASURED`].
const MEASURED_SHARE: usize = 16;

/// Panels that are compared by all values, all at once: with 4 of them a search for a ratio test among 7,620 descriptors of
/// SIFT takes 5 % longer, among 2,000 a tenth, with 12 of them 4 % (Zen 3). On Intel with AVX-512 any search takes 4 to 8 %
/// longer with 4 of them; with 12 of them one for a ratio test up to 9 % longer, another between 5 % shorter and 2 % longer.
const FIRST: usize = 8;

/// Panels after which candidates are skipped that do not decide on a ratio: the fewer, the more queries need a second
/// search. With 4 of them the search is 3 to 9 % slower.
const PATIENCE: usize = 8;

/// Candidates that were found for a query.
#[derive(Clone, Copy)]
pub(super) enum Found<'a> {
    /// All that may be nearest.
    Near {
        /// In ascending order, and their squared distances.
        near: &'a [(u32, f32)],
        /// Whether these are those of the definition, to the last bit.
        are_exact: bool,
    },
    /// Two whose distances have no ratio as it is wanted.
    Above {
        /// The nearer one.
        index: u32,
        /// Squared distances to both, the nearer one first.
        squared: [f32; 2],
    },
    /// The ratio is as it is wanted, and candidates were skipped that may be among the two nearest.
    Below,
}

impl<'a> Found<'a> {
    fn of(query: &'a mut Query, wanted: Wanted, are_exact: bool) -> Self {
        if let Wanted::Below(ratio) = wanted {
            if let Some((index, squared)) = query.two_above(ratio) {
                return Self::Above { index, squared };
            }
            if query.has_skipped() {
                return Self::Below;
            }
        }
        let near = query.near_enough();
        Self::Near { near, are_exact }
    }
}

/// What `result` makes of the candidates that may be nearest to each row of `a`, the first of `rows`; `None` where bytes
/// did not help.
#[target_feature(enable = "avx2,fma")]
pub(super) fn search<T>(
    rows: [&[f32]; 2],
    candidates: &Candidates,
    wanted: Wanted,
    result: impl FnMut(usize, Found) -> T,
) -> Vec<Option<T>> {
    let dim = candidates.dim;
    let count = rows[0].len() / dim;
    let components = candidates.components.as_ref();
    let projected = components.and_then(|components| components.project(rows[0]));
    let order = match &projected {
        Some(projected) => principal::order(&projected.rows),
        None => (0..count as u32).collect(),
    };
    let search = Search {
        rows,
        dim,
        orders: [&order, &candidates.order],
        wanted,
    };
    let Some(whole) = Bounds::of(&candidates.whole, rows[0], &order) else {
        return (0..count).map(|_| None).collect();
    };
    let step = components.zip(projected);
    let step = step.and_then(|(components, projected)| Step::of(components, projected, &order));
    search.among_all(step.as_ref(), &whole, result)
}

/// The first of two steps: bounds of the principal components.
struct Step<'a> {
    components: &'a Components,
    /// Components of the queries.
    queries: Vec<f32>,
    bounds: Bounds<'a>,
}

impl<'a> Step<'a> {
    fn of(components: &'a Components, queries: Projected, order: &[u32]) -> Option<Self> {
        let mut bounds = Bounds::of(&components.panels, &queries.rows, order)?;
        bounds.allow(queries.rounding + components.rounding, components.stretch());
        Some(Self {
            components,
            queries: queries.rows,
            bounds,
        })
    }

    /// All panels, those whose means are near to the mean of some queries first.
    #[target_feature(enable = "avx2,fma")]
    fn panels_near(&self, queries: &[u32]) -> Vec<usize> {
        let mean = mean_of(&self.queries, queries);
        let distances: Vec<f32> = (self.components.means.iter())
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
    orders: [&'a [u32]; 2],
    wanted: Wanted<'a>,
}

impl Search<'_> {
    /// What `result` makes of the rows that may be nearest to each row of `a`: by the principal components in the first
    /// of two `step`s, where there are any and they help, and by all values. `None` where bytes did not help.
    #[target_feature(enable = "avx2,fma")]
    fn among_all<T>(
        &self,
        step: Option<&Step>,
        whole: &Bounds,
        mut result: impl FnMut(usize, Found) -> T,
    ) -> Vec<Option<T>> {
        let count = self.orders[0].len();
        let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
        let mut tile = Tile::new(QUERIES.min(count));
        let panels: Vec<usize> = (0..whole.panels.count()).collect();
        let (mut tried, mut failed) = (0, 0);
        for first in (0..count).step_by(QUERIES) {
            let queries = &self.orders[0][first..count.min(first + QUERIES)];
            let mut is_found = false;
            if let Some(step) = step.filter(|_| 2 * failed <= tried) {
                tile.turn_to(first, queries.len());
                let order = step.panels_near(queries);
                is_found = self.measure(&step.bounds, whole, LEFT, &order, &mut tile);
                tried += 1;
                failed += usize::from(!is_found);
            }
            if !is_found {
                tile.turn_to(first, queries.len());
                is_found = self.measure(whole, whole, MEASURED, &panels, &mut tile);
            }
            if !is_found {
                break;
            }
            for (query, &row) in tile.queries.iter_mut().zip(queries) {
                let found = Found::of(query, self.wanted, whole.are_exact());
                results[row as usize] = Some(result(row as usize, found));
            }
        }
        results
    }

    /// Looks at all panels, in an order, for candidates that may be within the bounds of a tile of queries; whether
    /// `step` leaves few enough, of which `allowed` are no matter. What it leaves is looked at with the bounds of
    /// the `whole` rows.
    #[target_feature(enable = "avx2,fma")]
    fn measure(
        &self,
        step: &Bounds,
        whole: &Bounds,
        allowed: usize,
        order: &[usize],
        tile: &mut Tile,
    ) -> bool {
        let first_panels = self.first_panels(order);
        let found = tile.find_first(&first_panels, step, whole);
        let factors = step.factors(tile.first, tile.least.len());
        let (mut left, mut seen) = (0, 0);
        for &number in order {
            if seen == PATIENCE * LANES
                && let Wanted::Below(ratio) = self.wanted
            {
                tile.skip(ratio, step, whole);
            }
            let first = number * LANES;
            let lanes = u64::MAX >> (LANES - LANES.min(self.orders[1].len() - first));
            if let Some(place) = first_panels.iter().position(|&first| first == number) {
                tile.within.copy_from_slice(&found[place]);
                left += self.look(step, whole, number, lanes, tile);
            } else if seen == 0 {
                // Nothing is known yet: the first few bring bounds for the next few.
                for some in [0xff, 0xff << 8, 0xffff << 16, u64::MAX << 32] {
                    left += self.scan(step, &factors, whole, number, lanes & some, tile);
                }
            } else {
                left += self.scan(step, &factors, whole, number, lanes, tile);
            }
            if left > tile.queries.len() * (allowed + seen / MEASURED_SHARE) {
                return false;
            }
            seen += LANES;
        }
        true
    }

    /// The first panels of an order, as many as are compared by all values at once; none where that is no help.
    fn first_panels(&self, order: &[usize]) -> Vec<usize> {
        if matches!(self.wanted, Wanted::Near(Some(_))) {
            return Vec::new();
        }
        // Lanes without a candidate would pass for some.
        let full = self.orders[1].len() / LANES;
        let full = order.iter().copied().filter(|&number| number < full);
        full.take(FIRST).collect()
    }

    /// Looks at those of `lanes` of a panel that may be within the bounds, and returns how many `step` left, for whose
    /// panels the `factors` of the tile are.
    #[target_feature(enable = "avx2,fma")]
    fn scan(
        &self,
        step: &Bounds,
        factors: &[i32],
        whole: &Bounds,
        number: usize,
        lanes: u64,
        tile: &mut Tile,
    ) -> usize {
        let (panel, starts) = step.panels.panel(number);
        // On their way while the panel is compared.
        prefetch(whole.panels.candidates_of_panel(number).0);
        if step.panels.is_wide() {
            // SAFETY: what is in use was detected on this processor.
            unsafe {
                within::avx512::within(factors, &tile.least, panel, starts, &mut tile.within);
            };
        } else {
            within::avx2::within(factors, &tile.least, panel, starts, &mut tile.within);
        }
        self.look(step, whole, number, lanes, tile)
    }

    /// Looks at those of `lanes` of a panel that were found to be within the bounds, and returns how many there are.
    #[target_feature(enable = "avx2,fma")]
    fn look(
        &self,
        step: &Bounds,
        whole: &Bounds,
        number: usize,
        lanes: u64,
        tile: &mut Tile,
    ) -> usize {
        let (candidates, parts) = whole.panels.candidates_of_panel(number);
        let left = tile.list_pairs(lanes);
        let pairs = &tile.pairs[..left];
        let rows = Rows {
            queries: whole.queries_from(tile.first),
            limits: &tile.limits,
            candidates,
            parts,
        };
        let kept = if whole.panels.is_wide() {
            // SAFETY: what is in use was detected on this processor.
            unsafe { keep::avx512::keep(pairs, rows, &mut tile.kept) }
        } else {
            keep::avx2::keep(pairs, rows, &mut tile.kept)
        };
        if !whole.are_exact() {
            for (pair, _) in &tile.kept[..kept] {
                prefetch(self.row(1, number * LANES + pair.lane()));
            }
        }
        for kept in 0..kept {
            let (pair, distance) = tile.kept[kept];
            let candidate = number * LANES + pair.lane();
            let place = tile.first + pair.query();
            let squared = if whole.are_exact() {
                whole.squared_distance(place, distance)
            } else {
                squared_distance(self.row(0, place), self.row(1, candidate))
            };
            let query = &mut tile.queries[pair.query()];
            if query.offer(self.orders[1][candidate], squared, self.wanted) {
                tile.set_limits(pair.query(), step, whole);
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
