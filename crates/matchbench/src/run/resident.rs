//! The features in memory, and the pixels where a matcher uses them: those of the pairs that are being done, and as many
//! others as fit into a budget of bytes.

use std::collections::{BTreeMap, BTreeSet};

use matchbench_vision::features::Features;
use matchbench_vision::image::GrayImage;

use super::frame::Extracted;
use super::guard::Broken;
use super::progress::{PairTasks, PendingTask};
use crate::datasets::Pair;

/// Most frames that are extracted before the pairs that need them are done, or so many for each thread: many enough
/// to keep all threads busy, few enough that records keep coming.
const NEW_FRAMES: usize = 64;
const NEW_FRAMES_OF_A_THREAD: usize = 8;
/// What the features of a frame are taken to need before the first is known (60,000 of SIFT, and what searches keep).
const ASSUMED: usize = 56 << 20;

/// Features by frame, within a budget of bytes.
pub(super) struct Resident {
    budget: usize,
    threads: usize,
    /// The most that a frame has needed so far.
    largest: Option<usize>,
    windows: u64,
    slots: BTreeMap<u32, Slot>,
}

struct Slot {
    extracted: Extracted,
    bytes: usize,
    /// The last window that needed it.
    used: u64,
}

/// A pair, ready to be done.
pub(super) struct PairJob<'a> {
    pub(super) pair: &'a Pair,
    pub(super) due: &'a [PendingTask],
    pub(super) a: Side<'a>,
    pub(super) b: Side<'a>,
}

/// One of the two images of a pair.
#[derive(Clone, Copy)]
pub(super) struct Side<'a> {
    pub(super) features: Result<&'a Features, &'a Broken>,
    /// See [`Extracted::pixels`].
    pub(super) pixels: Option<&'a GrayImage>,
    /// How long the extraction took, in the first pair after it.
    pub(super) seconds: Option<f64>,
}

impl Resident {
    /// No features yet, and later about `budget` bytes of them, which so many threads extract.
    pub(super) fn new(budget: usize, threads: usize) -> Self {
        Self {
            budget,
            threads,
            largest: None,
            windows: 0,
            slots: BTreeMap::new(),
        }
    }

    /// As long as nothing is known of the size of features: the first frames of these `pairs`, as many for each thread
    /// as fit, and at least one.
    pub(super) fn first_frames(&self, pairs: &[PairTasks<'_>]) -> Vec<u32> {
        if self.largest.is_some() {
            return Vec::new();
        }
        let room = self.budget / ASSUMED;
        // The extraction itself takes more memory of each thread than what comes of it.
        let count = (room - room % self.threads).max(self.threads);
        let (mut frames, mut seen) = (Vec::new(), BTreeSet::new());
        for frame in pairs.iter().flat_map(|tasks| [tasks.pair.a, tasks.pair.b]) {
            if frames.len() == count {
                break;
            }
            if seen.insert(frame) {
                frames.push(frame);
            }
        }
        frames
    }

    /// How many of the next `pairs` can be done at once: at least one, and so many that their
    /// features fit into the budget.
    pub(super) fn window(&self, pairs: &[PairTasks<'_>]) -> usize {
        let room = self.budget / self.largest.unwrap_or(ASSUMED).max(1);
        let most_new = NEW_FRAMES.max(NEW_FRAMES_OF_A_THREAD * self.threads);
        let (mut frames, mut new) = (BTreeSet::new(), 0);
        let fits = |tasks: &&PairTasks<'_>| {
            for frame in [tasks.pair.a, tasks.pair.b] {
                if frames.insert(frame) && !self.slots.contains_key(&frame) {
                    new += 1;
                }
            }
            frames.len() <= room && new <= most_new
        };
        pairs
            .iter()
            .take_while(fits)
            .count()
            .max(1)
            .min(pairs.len())
    }

    /// Drops what stands in the way of this `window`, the longest unused first, and returns the frames
    /// that it lacks, in the order in which it needs them.
    pub(super) fn make_room(&mut self, window: &[PairTasks<'_>]) -> Vec<u32> {
        self.windows += 1;
        let (mut missing, mut seen) = (Vec::new(), BTreeSet::new());
        for frame in window.iter().flat_map(|tasks| [tasks.pair.a, tasks.pair.b]) {
            match self.slots.get_mut(&frame) {
                Some(slot) => slot.used = self.windows,
                None if seen.insert(frame) => missing.push(frame),
                None => {}
            }
        }
        let needed = missing.len() * self.largest.unwrap_or(ASSUMED);
        let mut held: usize = self.slots.values().map(|slot| slot.bytes).sum();
        let mut unused: Vec<(u64, u32)> = (self.slots.iter())
            .filter(|(_, slot)| slot.used < self.windows)
            .map(|(&frame, slot)| (slot.used, frame))
            .collect();
        unused.sort_unstable();
        for (_, frame) in unused {
            if held + needed <= self.budget {
                break;
            }
            held -= self.slots.remove(&frame).map_or(0, |slot| slot.bytes);
        }
        missing
    }

    pub(super) fn insert(&mut self, frame: u32, extracted: Extracted) {
        let pixels = (extracted.pixels.as_ref()).map_or(0, |image| image.size().area());
        let bytes = extracted.features.as_ref().map_or(0, Features::memory) + pixels;
        self.largest = self.largest.max(Some(bytes));
        let slot = Slot {
            extracted,
            bytes,
            used: self.windows,
        };
        self.slots.insert(frame, slot);
    }

    /// The pairs of a `window` with their features, all of which must be there. The time of an
    /// extraction goes to the first pair that uses it, and to no other.
    pub(super) fn jobs<'a>(&'a mut self, window: &'a [PairTasks<'a>]) -> Vec<PairJob<'a>> {
        let mut take = |frame| {
            let slot = self.slots.get_mut(&frame);
            slot.expect("the features of this window were extracted")
                .extracted
                .seconds
                .take()
        };
        let seconds: Vec<_> = (window.iter())
            .map(|tasks| (take(tasks.pair.a), take(tasks.pair.b)))
            .collect();
        let side = |frame, seconds| {
            let extracted = &self.slots[frame].extracted;
            Side {
                features: extracted.features.as_ref(),
                pixels: extracted.pixels.as_ref(),
                seconds,
            }
        };
        (window.iter().zip(seconds))
            .map(|(tasks, (seconds_a, seconds_b))| PairJob {
                pair: tasks.pair,
                due: &tasks.due,
                a: side(&tasks.pair.a, seconds_a),
                b: side(&tasks.pair.b, seconds_b),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use matchbench_vision::features::{Descriptors, FloatRows, Keypoint};
    use matchbench_vision::image::Size;
    use nalgebra::{Isometry3, Point2};

    use super::*;

    const FEATURE: usize = 4 + size_of::<Keypoint>();

    /// Features of `count` times [`FEATURE`] bytes.
    fn extracted(count: usize) -> Extracted {
        let keypoint = Keypoint {
            at: Point2::origin(),
            size: 1.0,
            angle: None,
            response: 0.0,
            octave: 0,
        };
        let rows = FloatRows::from_vec(1, vec![0.0; count]);
        let features = Features::new(
            Size::new(9, 9),
            vec![keypoint; count],
            Descriptors::Float(rows),
        );
        Extracted {
            features: Ok(features),
            pixels: None,
            seconds: Some(0.5),
            unkept: Vec::new(),
            hash: None,
        }
    }

    fn pairs(pairs: &[(u32, u32)]) -> Vec<Pair> {
        let b_from_a = Isometry3::identity();
        (pairs.iter())
            .map(|&(a, b)| Pair::with_pose(a, b, b_from_a))
            .collect()
    }

    fn without_tasks(pairs: &[Pair]) -> Vec<PairTasks<'_>> {
        (pairs.iter())
            .map(|pair| PairTasks {
                pair,
                due: Vec::new(),
            })
            .collect()
    }

    /// Goes through all pairs; returns the frames of each window and the most bytes that were held.
    fn walk(pairs: &[Pair], count: usize, budget: usize) -> (Vec<Vec<u32>>, usize) {
        let (pairs, mut resident) = (without_tasks(pairs), Resident::new(budget, 2));
        let (mut loads, mut most, mut rest) = (Vec::new(), 0, &pairs[..]);
        while !rest.is_empty() {
            let (window, later) = rest.split_at(resident.window(rest));
            let missing = resident.make_room(window);
            for &frame in &missing {
                resident.insert(frame, extracted(count));
            }
            assert_eq!(resident.jobs(window).len(), window.len());
            most = most.max(resident.slots.values().map(|slot| slot.bytes).sum());
            loads.push(missing);
            rest = later;
        }
        (loads, most)
    }

    #[test]
    fn what_fits_is_loaded_once() {
        let all: Vec<(u32, u32)> = (0..30)
            .flat_map(|a| (a + 1..30).map(move |b| (a, b)))
            .collect();
        let (loads, _) = walk(&pairs(&all), 10, 64 << 20);
        let loads: Vec<u32> = loads.concat();
        assert_eq!(loads, (0..30).collect::<Vec<_>>());
    }

    #[test]
    fn the_budget_holds_once_the_size_is_known() {
        let chain: Vec<(u32, u32)> = (0..200).map(|a| (a, a + 1)).collect();
        let budget = 5 * 10 * FEATURE;
        let (loads, most) = walk(&pairs(&chain), 10, budget);
        assert!(most <= budget, "{most} of {budget}");
        assert_eq!(loads.concat().len(), 201, "each frame is loaded once");
    }

    #[test]
    fn pixels_are_part_of_what_a_frame_needs() {
        let mut resident = Resident::new(64 << 20, 2);
        let pixels = Some(GrayImage::filled(Size::new(9, 9), 7));
        resident.insert(
            3,
            Extracted {
                pixels,
                ..extracted(10)
            },
        );
        assert_eq!(resident.largest, Some(10 * FEATURE + 81));
        let pairs = pairs(&[(3, 3)]);
        let pairs = without_tasks(&pairs);
        let jobs = resident.jobs(&pairs);
        assert_eq!(jobs[0].a.pixels.map(|image| image.at(8, 8)), Some(7));
    }

    #[test]
    fn a_budget_too_small_for_two_frames_still_does_pair_by_pair() {
        let (loads, most) = walk(&pairs(&[(0, 1), (0, 2), (1, 2)]), 10, 1);
        assert_eq!(loads, [vec![0, 1], vec![2], vec![1]]);
        assert_eq!(most, 2 * 10 * FEATURE);
    }

    #[test]
    fn a_window_is_never_longer_than_what_is_left() {
        let pairs = pairs(&[(0, 0), (0, 0)]);
        let resident = Resident::new(64 << 20, 2);
        assert_eq!(resident.window(&without_tasks(&pairs)), 2);
        assert_eq!(resident.window(&[]), 0);
    }

    #[test]
    fn the_first_frames_are_as_many_for_each_thread_as_fit() {
        let pairs = pairs(&[(4, 1), (4, 2), (1, 2), (2, 7), (7, 8), (4, 3)]);
        let pairs = without_tasks(&pairs);
        let first = |budget, threads| Resident::new(budget, threads).first_frames(&pairs);
        assert_eq!(first(5 * ASSUMED, 2), [4, 1, 2, 7]);
        assert_eq!(first(5 * ASSUMED, 1), [4, 1, 2, 7, 8]);
        assert_eq!(first(1, 3), [4, 1, 2], "one of each thread");
        assert_eq!(
            first(9 * ASSUMED, 3),
            [4, 1, 2, 7, 8, 3],
            "no more than there are"
        );
        let mut known = Resident::new(5 * ASSUMED, 2);
        known.insert(4, extracted(1));
        assert!(known.first_frames(&pairs).is_empty());
    }

    #[test]
    fn the_time_of_an_extraction_goes_to_the_first_pair() {
        let pairs = pairs(&[(0, 1), (0, 2)]);
        let (pairs, mut resident) = (without_tasks(&pairs), Resident::new(64 << 20, 2));
        for frame in resident.make_room(&pairs) {
            resident.insert(frame, extracted(1));
        }
        let times: Vec<_> = (resident.jobs(&pairs).iter())
            .map(|job| (job.a.seconds, job.b.seconds))
            .collect();
        assert_eq!(times, [(Some(0.5), Some(0.5)), (None, Some(0.5))]);
    }
}
