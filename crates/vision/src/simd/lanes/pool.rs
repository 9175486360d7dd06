//! Tasks that wait until eight of them are taken up together.

use super::{LANES, Lanes, Mask};

/// Tasks of `N` numbers each: first the numbers 0 of all of them, then the numbers 1. There is room for eight fewer than
/// `ROOM`; what comes when it is full is dropped.
pub struct Pool<const N: usize, const ROOM: usize> {
    numbers: [[f64; ROOM]; N],
    count: usize,
}

impl<const N: usize, const ROOM: usize> Pool<N, ROOM> {
    const LIMIT: usize = ROOM - LANES;

    #[inline(always)]
    pub fn new() -> Self {
        Self {
            numbers: [[0.0; ROOM]; N],
            count: 0,
        }
    }

    #[inline(always)]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Appends those of eight tasks where the mask says yes.
    #[inline(always)]
    pub fn push<V: Lanes>(&mut self, mask: V::Mask, tasks: &[V; N]) {
        for (numbers, task) in self.numbers.iter_mut().zip(tasks) {
            let to = numbers[self.count..].first_chunk_mut();
            task.pack(mask, to.expect("room for eight more"));
        }
        self.count = Self::LIMIT.min(self.count + mask.count());
    }

    /// The tasks from `first` on, and which lanes have one.
    #[inline(always)]
    pub fn eight<V: Lanes>(&self, first: usize) -> ([V; N], V::Mask) {
        let mut tasks = [V::zero(); N];
        for (task, numbers) in tasks.iter_mut().zip(&self.numbers) {
            let eight = numbers[first..].first_chunk();
            *task = V::new(*eight.expect("room for eight more"));
        }
        (tasks, V::Mask::first((self.count - first).min(LANES)))
    }

    #[cfg(test)]
    pub fn one(&self, i: usize) -> [f64; N] {
        self.numbers.each_ref().map(|numbers| numbers[i])
    }

    /// Removes the last tasks, at most eight, as [`Self::eight`] gives them.
    #[inline(always)]
    pub fn pop<V: Lanes>(&mut self) -> ([V; N], V::Mask) {
        let first = self.count.saturating_sub(LANES);
        let last = self.eight(first);
        self.count = first;
        last
    }
}
