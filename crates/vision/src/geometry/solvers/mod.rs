//! Minimal solvers: each takes the least number of matches that determine a model, and returns every model that
//! they allow.
//!
//! A solver is a function from points at depth 1 (see [`Camera::normalize`]) to [`Solutions`]. This is a list
//! of fixed capacity, which needs no allocation, since sample consensus calls a solver thousands of times.
//!
//! [`Camera::normalize`]: crate::geometry::Camera::normalize

mod five_point;
mod homography;
mod null_space;
mod roots;
mod seven_point;

use std::ops::{Deref, DerefMut};

pub use five_point::{FivePoints, SAMPLES_AT_ONCE, five_point, five_point_of_each};
pub use homography::homography;
pub use roots::real_roots;
pub use seven_point::seven_point;

/// At most `N` solutions, in the order in which they were found.
#[derive(Clone, Copy, Debug)]
pub struct Solutions<T, const N: usize> {
    items: [T; N],
    len: usize,
}

impl<T: Copy + Default, const N: usize> Solutions<T, N> {
    /// No solution.
    pub fn none() -> Self {
        Self {
            items: [T::default(); N],
            len: 0,
        }
    }

    /// Removes all of them.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Keeps only those for which `keep` is true, in their order.
    pub fn retain(&mut self, mut keep: impl FnMut(&T) -> bool) {
        let mut kept = 0;
        for i in 0..self.len {
            if keep(&self.items[i]) {
                self.items[kept] = self.items[i];
                kept += 1;
            }
        }
        self.len = kept;
    }

    /// Adds a solution.
    ///
    /// # Panics
    /// If there are `N` already.
    pub fn push(&mut self, solution: T) {
        self.items[self.len] = solution;
        self.len += 1;
    }
}

impl<T, const N: usize> Deref for Solutions<T, N> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.items[..self.len]
    }
}

impl<T, const N: usize> DerefMut for Solutions<T, N> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.items[..self.len]
    }
}
