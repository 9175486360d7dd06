//! Panels of the bytes of candidates, and the bounds that are computed from them and the bytes of queries.

use std::borrow::Cow;

use super::grid::{Bytes, Grid};
use super::within::avx2::{arrange, twice};
use super::within::{LANES, ROWS};
use crate::simd::search::pack;

/// By how much two sums of the same squares in another order may differ, generously.
pub(super) const ROUNDING: f32 = 1e-3;
/// By how much distances may be off where the squares of differences are too small for all their digits.
pub(super) const LEAST: f32 = 1e-18;

/// What 32-bit floating point may lose, generously, of the length of a row or of a distance, in units of the bytes.
const LOST: f32 = 0.01;

/// Rows of at most so many bytes have squared distances that 32-bit floating point holds to the last digit.
pub(super) const MAX_EXACT_DIM: usize = (1 << 24) / (255 * 255);

/// Candidates as bytes, one after the other and in panels.
pub(super) struct Panels {
    grid: Grid,
    /// Whether sums of products may have more than 16 bits.
    is_wide: bool,
    dim: usize,
    bytes: Bytes,
    /// Quads of a row.
    width: usize,
    /// The largest of the errors.
    error: f32,
    /// [Arranged](arrange) where sums fit 16 bits.
    quads: Vec<[i32; LANES]>,
    /// Minus half of the candidates' parts of squared distances, rounded up.
    starts: Vec<[i32; LANES]>,
}

impl Panels {
    /// Candidates in an order; `None` where bytes cannot be made of them.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn of(rows: &[f32], order: &[u32], dim: usize, is_wide: bool) -> Option<Self> {
        let grid = Grid::of(rows, dim, is_wide)?;
        let bytes = grid.candidates(rows, order);
        let width = dim.div_ceil(4);
        let starts: Vec<i32> = bytes.norms.iter().map(|norm| -(norm >> 1)).collect();
        let mut quads = pack(&bytes.quads, width);
        if !is_wide {
            arrange(&mut quads);
        }
        Some(Self {
            is_wide,
            quads,
            starts: pack(&starts, 1),
            error: bytes.error(),
            grid,
            dim,
            bytes,
            width,
        })
    }

    pub(super) fn count(&self) -> usize {
        self.starts.len()
    }

    /// Whether they are as AVX-512 multiplies them: sums of products may have more than 16 bits.
    pub(super) fn is_wide(&self) -> bool {
        self.is_wide
    }

    /// Quads of a row.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Whether bytes are the values of the candidates, and squared distances of such bytes have few digits.
    pub(super) fn are_exact(&self) -> bool {
        self.grid.is_whole && self.dim <= MAX_EXACT_DIM && self.error == 0.0
    }

    /// The bytes of all candidates, one candidate after the other, and their parts of squared distances.
    pub(super) fn candidates(&self) -> (&[i32], &[i32]) {
        (&self.bytes.quads, &self.bytes.norms)
    }

    /// How much memory the candidates take.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> usize {
        let Bytes {
            quads,
            norms,
            errors,
        } = &self.bytes;
        size_of_val(&quads[..])
            + size_of_val(&norms[..])
            + size_of_val(&errors[..])
            + size_of_val(&self.quads[..])
            + size_of_val(&self.starts[..])
    }

    /// A panel and what sums of products start at.
    pub(super) fn panel(&self, number: usize) -> (&[[i32; LANES]], &[i32; LANES]) {
        let width = self.width;
        let panel = &self.quads[number * width..][..width];
        (panel, &self.starts[number])
    }

    /// The bytes of a panel's candidates, one candidate after the other, and their parts of squared distances.
    pub(super) fn candidates_of_panel(&self, number: usize) -> (&[i32], &[i32]) {
        let place = number * LANES;
        let norms = &self.bytes.norms[place..];
        let norms = &norms[..LANES.min(norms.len())];
        let quads = &self.bytes.quads[place * self.width..];
        (&quads[..norms.len() * self.width], norms)
    }
}

/// How far candidates are from queries at least, and at most.
pub(super) struct Bounds<'a> {
    pub(super) panels: &'a Panels,
    queries: Bytes,
    /// The largest of the candidates' errors.
    error: f32,
    /// Units of a byte in one unit of distances, at most.
    scale: f32,
    /// One unit of a byte in units of distances.
    unit: f32,
    /// See [`Self::are_exact`].
    are_exact: bool,
}

impl<'a> Bounds<'a> {
    /// Bounds of the distances of queries, in an order; `None` where bytes cannot be made of these.
    pub(super) fn of(panels: &'a Panels, rows: &[f32], order: &[u32]) -> Option<Self> {
        let mut queries = panels.grid.queries(rows, order)?;
        // Zeros after the last row up to a whole block.
        let blocks = order.len().div_ceil(ROWS);
        queries.quads.resize(blocks * ROWS * panels.width, 0);
        let scale = panels.grid.scale;
        Some(Self {
            are_exact: panels.are_exact()
                && queries.error() == 0.0
                && panels.grid.is_whole_for(rows),
            error: panels.error,
            scale,
            unit: 1.0 / scale,
            queries,
            panels,
        })
    }

    /// Allows for distances that were changed before they became bytes: by `rounding`, and to `stretch` times
    /// what they were.
    pub(super) fn allow(&mut self, rounding: f32, stretch: f32) {
        self.error += rounding * self.scale;
        self.scale *= stretch;
    }

    /// How many queries there are.
    pub(super) fn count(&self) -> usize {
        self.queries.norms.len()
    }

    /// The bytes of the query at a place and of those that follow it.
    pub(super) fn queries_from(&self, place: usize) -> &[i32] {
        &self.queries.quads[place * self.panels.width..]
    }

    /// What panels are multiplied with for so many blocks of queries, from a place on: their words where sums fit 16 bits,
    /// else their bytes.
    pub(super) fn factors(&self, place: usize, blocks: usize) -> Cow<'_, [i32]> {
        let quads = &self.queries_from(place)[..blocks * ROWS * self.panels.width];
        if self.panels.is_wide {
            Cow::Borrowed(quads)
        } else {
            Cow::Owned(twice(quads))
        }
    }

    /// Whether bytes lost nothing and squared distances of bytes are those of the rows, by the definition to the
    /// last bit: all are whole numbers, and so is every sum on the way.
    pub(super) fn are_exact(&self) -> bool {
        self.are_exact
    }

    /// The squared distance of the bytes of a query and a candidate, of which `distance` is what is not the query's part.
    #[inline]
    pub(super) fn squared_distance(&self, query: usize, distance: i32) -> f32 {
        (distance + self.queries.norms[query]) as f32
    }

    /// The largest distance of a query and candidates whose sum of products, less half of their part of the squared
    /// distance, is at least `sum`.
    pub(super) fn largest(&self, query: usize, sum: i32) -> f32 {
        let distance = (self.queries.norms[query] - 2 * sum + 1) as f32;
        (distance.sqrt() + self.queries.errors[query] + self.error + LOST) * self.unit
    }

    /// The largest squared distance in bytes, less the query's part of it, of candidates that may be
    /// within a bound.
    pub(super) fn limit(&self, query: usize, bound: f32) -> i32 {
        let bound = bound * self.scale;
        let reach = (bound + self.queries.errors[query] + self.error) * (1.0 + ROUNDING) + LOST;
        ((reach * reach) as i32).saturating_sub(self.queries.norms[query])
    }

    /// The least sum of products, less half of the candidate's part of the squared distance, of candidates
    /// that may be within a bound. A squared distance is the parts of both less twice the sum; halves are
    /// rounded to the safe side.
    pub(super) fn least(&self, query: usize, bound: f32) -> i32 {
        -(self.limit(query, bound) >> 1)
    }
}
