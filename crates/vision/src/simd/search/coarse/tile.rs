//! What is known of some queries while they are searched for.

use super::within::{Pair, ROWS};

/// By how much two sums of the same squares in another order may differ, generously.
pub(super) const ROUNDING: f32 = 1e-3;

/// Some queries.
pub(super) struct Tile {
    /// The place of the first of them in their order.
    pub(super) first: usize,
    pub(super) queries: Vec<Query>,
    /// Of each query, block by block: what [`within`](super::within::within) compares with.
    pub(super) least: Vec<[i32; ROWS]>,
    /// Of each query: what [`keep`](super::within::keep) compares with.
    pub(super) limits: Vec<i32>,
    /// Of each query, block by block: candidates of the last panel that may be within its bound.
    pub(super) within: Vec<[u64; ROWS]>,
    /// The same one by one.
    pub(super) pairs: Vec<Pair>,
}

impl Tile {
    /// Queries of which nothing is known.
    pub(super) fn new(first: usize, count: usize) -> Self {
        let blocks = count.div_ceil(ROWS);
        Self {
            first,
            queries: (0..count).map(|_| Query::new()).collect(),
            least: vec![[i32::MIN; ROWS]; blocks],
            limits: vec![i32::MAX; count],
            within: vec![[0; ROWS]; blocks],
            pairs: Vec::new(),
        }
    }

    /// Lists what is within in `lanes`.
    pub(super) fn list_pairs(&mut self, lanes: u64) {
        self.pairs.clear();
        let within = &self.within.as_flattened()[..self.queries.len()];
        for (query, within) in within.iter().enumerate() {
            let mut within = within & lanes;
            while within != 0 {
                self.pairs
                    .push(Pair::new(query, within.trailing_zeros() as usize));
                within &= within - 1;
            }
        }
    }
}

/// What is known of the nearest of a row of `a`.
pub(super) struct Query {
    /// Index of the nearest measured so far, and its squared distance.
    nearest: (u32, f32),
    /// Of two measured candidates that are apart the squared distance to the farther: the least of those two
    /// of which one was the nearest when the other came. Others may have a smaller one, so it may be too
    /// large, but never too small.
    pub(super) bound: f32,
    /// Measured candidates that were within the bound when they were, and their squared distances.
    near: Vec<(u32, f32)>,
}

impl Query {
    fn new() -> Self {
        Self {
            nearest: (0, f32::INFINITY),
            bound: f32::INFINITY,
            near: Vec::with_capacity(16),
        }
    }

    /// Whether a measured candidate may be within the bound by the definition.
    pub(super) fn admits(&self, distance: f32) -> bool {
        distance <= self.bound * (1.0 + ROUNDING) + f32::MIN_POSITIVE
    }

    /// Takes a candidate and its squared distance.
    pub(super) fn offer(&mut self, index: u32, distance: f32, apart: impl Fn(u32, u32) -> bool) {
        self.near.push((index, distance));
        let (nearest, nearest_distance) = self.nearest;
        if distance < nearest_distance {
            self.nearest = (index, distance);
        }
        let farther = distance.max(nearest_distance);
        if farther < self.bound && apart(nearest, index) {
            self.bound = farther;
        }
    }

    /// The candidates that may be within the bound, in ascending order.
    pub(super) fn near_enough(&self) -> Vec<u32> {
        let near = self.near.iter();
        let near = near.filter(|(_, distance)| self.admits(*distance));
        let mut near: Vec<u32> = near.map(|&(index, _)| index).collect();
        near.sort_unstable();
        near
    }
}
