//! The one place where a run uses threads: work is started in order, and its results are handed on in
//! order.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard};

use super::{Cancel, RunError};

/// How many items for each thread may be taken up beyond the first one that is not finished: what is finished waits
/// in memory for that one.
const AHEAD: usize = 8;

/// Does `work` for every item, on all threads of the current pool, and hands the results to `sink` in the order
/// of the items, each as soon as those before it are there.
///
/// Items are taken up one by one from the front (rayon's iterators would start in many places at
/// once), so that what is finished is always nearly a prefix: few results wait ([`AHEAD`]), and a process that
/// is killed loses little. Once `cancel` is set no more items are taken up; those in flight end
/// and their results are handed over.
///
/// # Errors
/// The first error of `work` or `sink`, in the order of the items; nothing after it is handed over.
pub(super) fn each_in_order<I: Sync, T: Send>(
    cancel: &Cancel,
    items: &[I],
    work: impl Fn(&I) -> Result<T, RunError> + Sync,
    sink: impl FnMut(T) -> Result<(), RunError> + Send,
) -> Result<(), RunError> {
    let in_order = Mutex::new(InOrder {
        items: items.len(),
        ahead: AHEAD * rayon::current_num_threads(),
        taken: 0,
        is_full: false,
        next: 0,
        waiting: BTreeMap::new(),
        sink,
        ended: Ok(()),
    });
    // No closure may block here. While a thread waits inside of `work`, rayon may run another of these closures on it,
    // which would then wait for what only this thread can finish. So when too many results wait for an earlier one, all
    // closures return, and the next round begins.
    while lock(&in_order).next_round(cancel) {
        rayon::broadcast(|_| {
            let mut held = lock(&in_order);
            while let Some(index) = held.take(cancel) {
                drop(held);
                let result = work(&items[index]);
                held = lock(&in_order);
                held.arrive(index, result);
            }
        });
    }
    in_order
        .into_inner()
        .expect("no thread panicked while it held the lock")
        .ended
}

fn lock<T, S>(in_order: &Mutex<InOrder<T, S>>) -> MutexGuard<'_, InOrder<T, S>> {
    in_order
        .lock()
        .expect("no thread panicked while it held the lock")
}

/// Where items are taken up, and results wait for those before them.
struct InOrder<T, S> {
    items: usize,
    /// Most items that may be taken up beyond `next`.
    ahead: usize,
    taken: usize,
    /// Whether so many are taken up that this round ends.
    is_full: bool,
    next: usize,
    waiting: BTreeMap<usize, Result<T, RunError>>,
    sink: S,
    ended: Result<(), RunError>,
}

impl<T, S: FnMut(T) -> Result<(), RunError>> InOrder<T, S> {
    /// Begins a round, when all that was taken up has arrived; says whether there is anything left for it.
    fn next_round(&mut self, cancel: &Cancel) -> bool {
        self.is_full = false;
        self.is_left(cancel)
    }

    fn is_left(&self, cancel: &Cancel) -> bool {
        self.taken < self.items && self.ended.is_ok() && !cancel.is_set()
    }

    /// The index of the next item, unless none is to be taken up in this round.
    fn take(&mut self, cancel: &Cancel) -> Option<usize> {
        self.is_full |= self.taken >= self.next + self.ahead;
        if self.is_full || !self.is_left(cancel) {
            return None;
        }
        self.taken += 1;
        Some(self.taken - 1)
    }

    fn arrive(&mut self, index: usize, result: Result<T, RunError>) {
        self.waiting.insert(index, result);
        while self.ended.is_ok()
            && let Some(result) = self.waiting.remove(&self.next)
        {
            self.next += 1;
            self.ended = result.and_then(&mut self.sink);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::thread;
    use std::time::Duration;

    use rayon::prelude::*;
    use rayon::{ThreadPool, ThreadPoolBuilder};

    use super::*;

    fn pool(threads: usize) -> ThreadPool {
        (ThreadPoolBuilder::new().num_threads(threads))
            .build()
            .unwrap()
    }

    /// Later items are done sooner, but none at once.
    fn hurried(item: usize) -> usize {
        thread::sleep(Duration::from_millis(11 - item.min(10) as u64));
        item
    }

    #[test]
    fn results_leave_in_the_order_of_the_items() {
        let items: Vec<usize> = (0..40).collect();
        let mut left = Vec::new();
        let sink = |item| {
            left.push(item);
            Ok(())
        };
        let work = |&item: &usize| Ok(hurried(item));
        pool(4)
            .install(|| each_in_order(&Cancel::default(), &items, work, sink))
            .unwrap();
        assert_eq!(left, items);
    }

    #[test]
    fn after_an_error_nothing_is_handed_over() {
        let items: Vec<usize> = (0..40).collect();
        for failing_sink in [false, true] {
            let mut left = Vec::new();
            let broken = || RunError::Contradiction("broken".into());
            let work = |&item: &usize| match hurried(item) {
                5 if !failing_sink => Err(broken()),
                item => Ok(item),
            };
            let sink = |item| {
                if item == 5 {
                    return Err(broken());
                }
                left.push(item);
                Ok(())
            };
            let ended = pool(4).install(|| each_in_order(&Cancel::default(), &items, work, sink));
            assert_eq!(ended.unwrap_err().to_string(), "broken");
            assert_eq!(left, [0, 1, 2, 3, 4]);
        }
    }

    #[test]
    fn cancelling_hands_over_all_that_was_taken_up() {
        let items: Vec<usize> = (0..1000).collect();
        let (cancel, taken) = (Cancel::default(), AtomicUsize::new(0));
        let mut left = Vec::new();
        let work = |&item: &usize| {
            taken.fetch_add(1, Ordering::Relaxed);
            if item == 7 {
                cancel.set();
            }
            Ok(hurried(item))
        };
        let sink = |item| {
            left.push(item);
            Ok(())
        };
        pool(3)
            .install(|| each_in_order(&cancel, &items, work, sink))
            .unwrap();
        assert_eq!(left, items[..taken.into_inner()]);
        assert!(left.len() >= 8 && left.len() < items.len());
    }

    #[test]
    fn few_results_wait_for_one_that_takes_long() {
        let items: Vec<usize> = (0..1000).collect();
        let (slow_is_done, most) = (AtomicBool::new(false), AtomicUsize::new(0));
        let mut left = Vec::new();
        let work = |&item: &usize| {
            if item == 100 {
                thread::sleep(Duration::from_millis(100));
                slow_is_done.store(true, Ordering::Relaxed);
            } else if !slow_is_done.load(Ordering::Relaxed) {
                most.fetch_max(item, Ordering::Relaxed);
            }
            Ok(item)
        };
        let sink = |item| {
            left.push(item);
            Ok(())
        };
        pool(3)
            .install(|| each_in_order(&Cancel::default(), &items, work, sink))
            .unwrap();
        assert_eq!(left, items);
        let most = most.into_inner();
        assert!(most < 100 + 3 * AHEAD, "{most}");
    }

    #[test]
    fn work_that_uses_the_same_threads_ends() {
        let items: Vec<u64> = (0..300).collect();
        let work = |&item: &u64| {
            if item.is_multiple_of(50) {
                thread::sleep(Duration::from_millis(5));
            }
            Ok((0..64).into_par_iter().map(|i: u64| i * item).sum::<u64>())
        };
        pool(4).install(|| {
            // Two at a time, as nobody should.
            let all = || {
                let mut sum = 0;
                let sink = |part| {
                    sum += part;
                    Ok(())
                };
                each_in_order(&Cancel::default(), &items, work, sink).unwrap();
                sum
            };
            let (one, other) = rayon::join(all, all);
            let expected = 300 * 299 / 2 * 64 * 63 / 2;
            assert_eq!((one, other), (expected, expected));
        });
    }
}
