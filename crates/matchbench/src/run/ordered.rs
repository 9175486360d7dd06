//! The one place where a run uses threads: work is started in order, and its results are handed on in
//! order.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::{Cancel, RunError};

/// Does `work` for every item, on all threads of the current pool, and hands the results to `sink` in the order
/// of the items, each as soon as those before it are there.
///
/// Items are taken up one by one from the front (rayon's iterators would start in many places at
/// once), so that what is finished is always nearly a prefix: few results wait, and a process that
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
    let taken = AtomicUsize::new(0);
    let broken = AtomicBool::new(false);
    let exit = Mutex::new(Exit {
        next: 0,
        waiting: BTreeMap::new(),
        sink,
        ended: Ok(()),
    });
    rayon::broadcast(|_| {
        while !cancel.is_set() && !broken.load(Ordering::Relaxed) {
            let index = taken.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else { break };
            let result = work(item);
            let mut exit = exit.lock().expect("no thread panicked at the exit");
            exit.arrive(index, result);
            broken.store(exit.ended.is_err(), Ordering::Relaxed);
        }
    });
    exit.into_inner()
        .expect("no thread panicked at the exit")
        .ended
}

/// Where results wait for those before them.
struct Exit<T, S> {
    next: usize,
    waiting: BTreeMap<usize, Result<T, RunError>>,
    sink: S,
    ended: Result<(), RunError>,
}

impl<T, S: FnMut(T) -> Result<(), RunError>> Exit<T, S> {
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
    use std::thread;
    use std::time::Duration;

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
}
