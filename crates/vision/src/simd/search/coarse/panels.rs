//! Bytes of queries and candidates, and the bounds that follow from them.

use super::grid::{Bytes, Grid};
use super::within::{LANES, ROWS};
use crate::simd::search::pack;

/// By how much two sums of the same squares in another order may differ, generously.
pub(super) const ROUNDING: f32 = 1e-3;

/// Bytes of both sides, and what bounds of distances need to know of them.
pub(super) struct Bounds {
    queries: Bytes,
    candidates: Bytes,
    /// Quads of a row.
    width: usize,
    /// The largest of the candidates' errors.
    error: f32,
    /// Units of a byte in one unit of distances, at most.
    scale: f32,
    /// See [`Self::are_exact`].
    are_exact: bool,
    /// One unit of a byte in units of distances.
    unit: f32,
}

impl Bounds {
    /// Bytes of the rows of queries and of candidates, each in its order; `None` where they cannot be made.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn of(
        rows: [&[f32]; 2],
        orders: &[Vec<u32>; 2],
        dim: usize,
        is_wide: bool,
    ) -> Option<Self> {
        let grid = Grid::of(rows[0], rows[1], dim, is_wide)?;
        let width = dim.div_ceil(4);
        let mut queries = grid.queries(rows[0], &orders[0]);
        // Zeros after the last row up to a whole block.
        let blocks = orders[0].len().div_ceil(ROWS);
        queries.quads.resize(blocks * ROWS * width, 0);
        let candidates = grid.candidates(rows[1], &orders[1]);
        let errors = queries.errors.iter().chain(&candidates.errors);
        Some(Self {
            are_exact: errors.copied().all(|error| error == 0.0),
            error: candidates.errors.iter().copied().fold(0.0, f32::max),
            queries,
            candidates,
            width,
            scale: grid.scale,
            unit: 1.0 / grid.scale,
        })
    }

    /// Allows for distances that were changed before they became bytes: by `rounding`, and to `stretch` times
    /// what they were.
    pub(super) fn allow(&mut self, rounding: f32, stretch: f32) {
        self.error += rounding * self.scale;
        self.scale *= stretch;
    }

    /// The bytes of the query at a place and of those that follow it.
    pub(super) fn queries_from(&self, place: usize) -> &[i32] {
        &self.queries.quads[place * self.width..]
    }

    /// The bytes of a panel's candidates, one candidate after the other, and their parts of squared distances.
    pub(super) fn candidates_of_panel(&self, number: usize) -> (&[i32], &[i32]) {
        let place = number * LANES;
        let norms = &self.candidates.norms[place..];
        let norms = &norms[..LANES.min(norms.len())];
        let quads = &self.candidates.quads[place * self.width..];
        (&quads[..norms.len() * self.width], norms)
    }

    /// Whether bytes lost nothing, so that distances of bytes are those of the rows.
    pub(super) fn are_exact(&self) -> bool {
        self.are_exact
    }

    /// The distance of a query and a candidate whose squared distance in bytes, less the query's part of it, is
    /// `distance`.
    #[inline]
    pub(super) fn distance(&self, query: usize, distance: i32) -> f32 {
        ((distance + self.queries.norms[query]) as f32).sqrt() * self.unit
    }

    /// The largest distance of a query and candidates whose sum of products, less half of their part of the squared
    /// distance, is at least `sum`.
    pub(super) fn largest(&self, query: usize, sum: i32) -> f32 {
        let distance = (self.queries.norms[query] - 2 * sum + 1) as f32;
        (distance.sqrt() + self.queries.errors[query] + self.error) * self.unit
    }

    /// The largest squared distance in bytes, less the query's part of it, of candidates that may be
    /// within a bound.
    pub(super) fn limit(&self, query: usize, bound: f32) -> i32 {
        let bound = bound * self.scale;
        let reach = (bound + self.queries.errors[query] + self.error) * (1.0 + ROUNDING) + 0.01;
        ((reach * reach) as i32).saturating_sub(self.queries.norms[query])
    }

    /// The least sum of products, less half of the candidate's part of the squared distance, of candidates
    /// that may be within a bound. A squared distance is the parts of both less twice the sum; halves are
    /// rounded to the safe side.
    pub(super) fn least(&self, query: usize, bound: f32) -> i32 {
        -(self.limit(query, bound) >> 1)
    }
}

/// The candidates once more, in panels.
pub(super) struct Panels {
    width: usize,
    quads: Vec<[i32; LANES]>,
    /// Minus half of the candidates' parts of squared distances, rounded up.
    starts: Vec<[i32; LANES]>,
}

impl Panels {
    pub(super) fn of(bounds: &Bounds) -> Self {
        let norms = bounds.candidates.norms.iter();
        let starts: Vec<i32> = norms.map(|norm| -(norm >> 1)).collect();
        Self {
            quads: pack(&bounds.candidates.quads, bounds.width),
            starts: pack(&starts, 1),
            width: bounds.width,
        }
    }

    pub(super) fn count(&self) -> usize {
        self.starts.len()
    }

    /// A panel and what sums of products start at.
    pub(super) fn panel(&self, number: usize) -> (&[[i32; LANES]], &[i32; LANES]) {
        let width = self.width;
        let panel = &self.quads[number * width..][..width];
        (panel, &self.starts[number])
    }
}
