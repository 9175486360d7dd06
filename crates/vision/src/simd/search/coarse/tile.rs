//! A tile of queries during a search: their bounds and the nearest candidates so far.

use super::keep::Pair;
use super::panels::{Bounds, LEAST, ROUNDING};
use super::within::{self, LANES, ROWS};

/// Pairs that are listed without a look at how many there are.
const AT_ONCE: usize = 4;

/// Whether two rows of `b` are apart.
pub(super) type Apart<'a> = &'a dyn Fn(u32, u32) -> bool;

/// What is asked of a search.
#[derive(Clone, Copy)]
pub(super) enum Wanted<'a> {
    /// All candidates that may be as near as the farther of any two that are apart; without it of any two.
    Near(Option<Apart<'a>>),
    /// The same without it, where the distance to the nearest is below this ratio of that to the second nearest;
    /// elsewhere any two candidates whose distances have no such ratio.
    Below(f32),
}

/// Some queries.
pub(super) struct Tile {
    /// The place of the first of them in their order.
    pub(super) first: usize,
    pub(super) queries: Vec<Query>,
    /// Of each query, block by block: what [`within`](super::within) compares with.
    pub(super) least: Vec<[i32; ROWS]>,
    /// Of each query: what [`keep`](super::keep) compares with.
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

    /// Sets the bounds of the queries by the first panels, and finds those of their candidates that may be within.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn find_first(
        &mut self,
        first_panels: &[usize],
        step: &Bounds,
        whole: &Bounds,
    ) -> Vec<Vec<[u64; ROWS]>> {
        let mut found = vec![vec![[0; ROWS]; self.least.len()]; first_panels.len()];
        let panels = first_panels.iter();
        let panels: Vec<_> = panels.map(|&number| whole.panels.panel(number)).collect();
        if panels.is_empty() {
            return found;
        }
        let (first, count) = (self.first, self.queries.len());
        let factors = whole.factors(first, self.least.len());
        let least = |query: usize, second: i32| {
            // The last block may have rows without a query.
            if query >= count {
                return i32::MAX;
            }
            let bound = whole.largest(first + query, second);
            self.queries[query].bound = bound;
            self.set_limits(query, step, whole);
            whole.least(first + query, bound)
        };
        if whole.panels.is_wide() {
            // SAFETY: what is in use was detected on this processor.
            unsafe { within::avx512::within_first(&factors, &panels, least, &mut found) };
        } else {
            within::avx2::within_first(&factors, &panels, least, &mut found);
        }
        found
    }

    /// [Skips](Query::skip) what does not decide on a `ratio` from here on.
    pub(super) fn skip(&mut self, ratio: f32, step: &Bounds, whole: &Bounds) {
        for query in 0..self.queries.len() {
            if self.queries[query].skip(ratio) {
                self.set_limits(query, step, whole);
            }
        }
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
    /// Distance to the second nearest measured so far.
    second: f32,
    /// Whether candidates were skipped that may be among the two nearest.
    has_skipped: bool,
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
            second: f32::INFINITY,
            has_skipped: false,
            bound: f32::INFINITY,
            near: Vec::with_capacity(16),
        }
    }

    fn forget(&mut self) {
        self.nearest = (0, f32::INFINITY);
        self.second = f32::INFINITY;
        self.has_skipped = false;
        self.bound = f32::INFINITY;
        self.near.clear();
    }

    /// Whether candidates were skipped that may be among the two nearest.
    pub(super) fn has_skipped(&self) -> bool {
        self.has_skipped
    }

    /// Whether a measured candidate may be within the bound by the definition.
    fn admits(&self, distance: f32) -> bool {
        distance <= self.bound * (1.0 + ROUNDING) + LEAST
    }

    /// Takes a candidate and its squared distance; whether the bound is another now.
    pub(super) fn offer(&mut self, index: u32, squared: f32, wanted: Wanted) -> bool {
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
        self.second = self.second.min(farther);
        if let Wanted::Below(ratio) = wanted
            && self.has_skipped
        {
            return self.skip(ratio);
        }
        let is_nearer = match wanted {
            Wanted::Near(Some(apart)) => farther < self.bound && apart(nearest, index),
            Wanted::Near(None) | Wanted::Below(_) => farther < self.bound,
        };
        if is_nearer {
            self.bound = farther;
        }
        is_nearer
    }

    /// Whether the measured candidates tell that the distance to the nearest is not below this `ratio` of that to the
    /// second nearest.
    fn fails(&self, ratio: f32) -> bool {
        self.second < f32::INFINITY
            && self.nearest.1 >= ratio * (1.0 + ROUNDING) * self.second + LEAST
    }

    /// From here on only candidates count that decide on whether the distance to the nearest is below a `ratio` of that
    /// to the second nearest; whether the bound is another now.
    ///
    /// *Correctness*: let n be the nearest and s the second nearest of all candidates, and `|n| < ratio |s|`. As long as
    /// n was not measured, the nearest measured one is not nearer than s, so n is within `ratio` times its distance. Once
    /// n was measured, s is not within `1 / ratio` times the distance of n, nor is any other candidate.
    pub(super) fn skip(&mut self, ratio: f32) -> bool {
        let before = self.bound;
        let nearest = self.nearest.1;
        if self.fails(ratio) {
            self.has_skipped = true;
            self.bound = nearest * ratio * (1.0 + ROUNDING);
        } else if self.has_skipped {
            self.bound = nearest / ratio * (1.0 + ROUNDING);
        }
        self.bound != before
    }

    /// Two candidates, if their distances tell that the nearest is not below this `ratio` of the second nearest: which is
    /// nearer, and both squared distances.
    pub(super) fn two_above(&self, ratio: f32) -> Option<(u32, [f32; 2])> {
        let (index, nearest) = self.nearest;
        let both = [nearest, self.second].map(|distance| distance * distance);
        self.fails(ratio).then_some((index, both))
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
