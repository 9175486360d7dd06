//! A tile of queries during a search: their bounds and the nearest candidates so far.

use super::keep::Pair;
use super::panels::{Bounds, ROUNDING};
use super::within::{LANES, ROWS};

/// Pairs that are listed without a look at how many there are.
const AT_ONCE: usize = 4;

/// Whether two rows of `b` are apart.
pub(super) type Apart<'a> = &'a dyn Fn(u32, u32) -> bool;

/// Some queries.
pub(super) struct Tile {
    /// The place of the first of them in their order.
    pub(super) first: usize,
    pub(super) queries: Vec<Query>,
    /// Of each query, block by block: what [`within`](super::within::within) compares with.
    pub(super) least: Vec<[i32; ROWS]>,
    /// Of each query: what [`keep`](super::keep::keep) compares with.
    pub(super) limits: Vec<i32>,
    /// Of each query, block by block: candidates of the last panel that may be within its bound.
    pub(super) within: Vec<[u64; ROWS]>,
    /// Queries that have any of these.
    some: Vec<u32>,
    /// Room for what is within, one by one.
    pub(super) pairs: Vec<Pair>,
    /// Room for those of them that are kept, and their squared distances in bytes, less the query's part.
    pub(super) kept: Vec<(Pair, i32)>,
}

impl Tile {
    /// Room for so many queries.
    pub(super) fn new(count: usize) -> Self {
        let blocks = count.div_ceil(ROWS);
        Self {
            first: 0,
            queries: (0..count).map(|_| Query::new()).collect(),
            least: vec![[i32::MIN; ROWS]; blocks],
            limits: vec![i32::MAX; count],
            within: vec![[0; ROWS]; blocks],
            some: vec![0; count],
            pairs: vec![Pair::new(0, 0); count * LANES + AT_ONCE],
            kept: vec![(Pair::new(0, 0), 0); count * LANES],
        }
    }

    /// Turns to other queries, of which nothing is known: so many from place `first` on, at most those that there is
    /// room for.
    pub(super) fn turn_to(&mut self, first: usize, count: usize) {
        self.first = first;
        self.queries.truncate(count);
        self.queries.iter_mut().for_each(Query::forget);
        let blocks = count.div_ceil(ROWS);
        self.least.truncate(blocks);
        self.least.fill([i32::MIN; ROWS]);
        self.limits.fill(i32::MAX);
        self.within.truncate(blocks);
    }

    /// Sets what `step` and the bounds of `whole` rows compare a query's candidates with by the bound of the query.
    pub(super) fn set_limits(&mut self, query: usize, step: &Bounds, whole: &Bounds) {
        let (place, bound) = (self.first + query, self.queries[query].bound);
        self.least[query / ROWS][query % ROWS] = step.least(place, bound);
        self.limits[query] = whole.limit(place, bound);
    }

    /// Lists what is within in `lanes`; returns how many pairs there are.
    pub(super) fn list_pairs(&mut self, lanes: u64) -> usize {
        // Without branches whose outcome nobody could predict: first the queries that have any.
        let within = &self.within.as_flattened()[..self.queries.len()];
        let mut some = 0;
        for (query, within) in (0..).zip(within) {
            self.some[some] = query;
            some += usize::from(within & lanes != 0);
        }
        let mut listed = 0;
        for &query in &self.some[..some] {
            let mut within = within[query as usize] & lanes;
            let count = within.count_ones() as usize;
            let mut next = listed;
            loop {
                // Most have fewer.
                for pair in &mut self.pairs[next..][..AT_ONCE] {
                    *pair = Pair::new(query as usize, within.trailing_zeros() as usize % LANES);
                    within &= within.wrapping_sub(1);
                }
                next += AT_ONCE;
                if within == 0 {
                    break;
                }
            }
            listed += count;
        }
        listed
    }
}

/// What is known of the nearest of a row of `a`.
pub(super) struct Query {
    /// Index of the nearest measured so far, and its distance.
    nearest: (u32, f32),
    /// Of two candidates that are apart the distance to the farther, or more: the least of those two
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

    fn forget(&mut self) {
        self.nearest = (0, f32::INFINITY);
        self.bound = f32::INFINITY;
        self.near.clear();
    }

    /// Whether a measured candidate may be within the bound by the definition.
    fn admits(&self, distance: f32) -> bool {
        distance <= self.bound * (1.0 + ROUNDING) + f32::MIN_POSITIVE
    }

    /// Takes a candidate and its squared distance; whether the bound is another now.
    pub(super) fn offer(&mut self, index: u32, squared: f32, apart: Option<Apart>) -> bool {
        let distance = squared.sqrt();
        if !self.admits(distance) {
            return false;
        }
        self.near.push((index, squared));
        let (nearest, nearest_distance) = self.nearest;
        if distance < nearest_distance {
            self.nearest = (index, distance);
        }
        let farther = distance.max(nearest_distance);
        let is_nearer = farther < self.bound && apart.is_none_or(|apart| apart(nearest, index));
        if is_nearer {
            self.bound = farther;
        }
        is_nearer
    }

    /// The candidates that may be within the bound, in ascending order, and their squared distances.
    pub(super) fn near_enough(&mut self) -> &[(u32, f32)] {
        let mut near = std::mem::take(&mut self.near);
        near.retain(|(_, squared)| self.admits(squared.sqrt()));
        near.sort_unstable_by_key(|&(index, _)| index);
        self.near = near;
        &self.near
    }
}
