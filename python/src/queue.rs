//! A queue before something that only a few threads may do at once, in the order in which they lined up.

use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use matchbench::run::Cancel;

/// Lets at most so many threads in at once.
pub(crate) struct Queue {
    /// The most that may be inside at once.
    most: usize,
    state: Mutex<State>,
    /// Told when somebody went in, or left.
    moved: Condvar,
}

#[derive(Default)]
struct State {
    /// The number of the next one who lines up.
    next: u64,
    /// Who waits; the first of them came first.
    waiting: VecDeque<u64>,
    /// How many are inside.
    inside: usize,
}

/// A place in a queue, and inside, once it was its turn. Dropping it leaves.
pub(crate) struct Place<'a> {
    queue: &'a Queue,
    number: u64,
    is_inside: bool,
}

impl Queue {
    /// A queue that lets `most` in at once.
    pub(crate) fn new(most: NonZeroUsize) -> Self {
        Self {
            most: most.get(),
            state: Mutex::default(),
            moved: Condvar::new(),
        }
    }

    /// The place behind all who wait.
    pub(crate) fn line_up(&self) -> Place<'_> {
        let mut state = self.state();
        let number = state.next;
        state.next += 1;
        state.waiting.push_back(number);
        Place {
            queue: self,
            number,
            is_inside: false,
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place<'_> {
    /// Waits for its turn; says whether it came before `cancel` was set. Whoever calls this must not hold the
    /// interpreter, since those inside need it.
    pub(crate) fn enter(&mut self, cancel: &Cancel) -> bool {
        let mut state = self.queue.state();
        // Nobody is told when `cancel` is set. The run waits for those inside anyway, and they tell when they leave.
        while !cancel.is_set() {
            if state.inside < self.queue.most && state.waiting.front() == Some(&self.number) {
                state.waiting.pop_front();
                state.inside += 1;
                self.is_inside = true;
                self.queue.moved.notify_all();
                return true;
            }
            let moved = self.queue.moved.wait(state);
            state = moved.unwrap_or_else(PoisonError::into_inner);
        }
        false
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        let mut state = self.queue.state();
        if self.is_inside {
            state.inside -= 1;
        } else {
            state.waiting.retain(|&number| number != self.number);
        }
        self.queue.moved.notify_all();
    }
}
