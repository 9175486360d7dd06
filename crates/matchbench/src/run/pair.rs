//! All tasks of a pair: it is matched once for each repetition, every estimator estimates, and everything
//! is recorded.

use std::mem;
use std::sync::Mutex;
use std::time::Duration;

use matchbench_vision::features::Features;
use matchbench_vision::geometry::Camera;
use matchbench_vision::image::GrayImage;
use matchbench_vision::matching::{Correspondences, View};
use matchbench_vision::seed::Seed;

use super::RunError;
use super::depth::{DepthMaps, PairDepth};
use super::frame::{lock, read, size};
use super::guard::Broken;
use super::matching::{search, select};
use super::progress::{MatcherProgress, PairTasks, PendingTask};
use super::repeatability::repeated;
use super::resident::{PairJob, Side};
use super::seeds::pair_seed;
use super::sourcing::sourced;
use super::trial::{Trial, correct_matches};
use crate::datasets::Pair;
use crate::matchers::{BuiltMatcher, BuiltPointSource, ImageFiles};
use crate::records::images::ImageNotes;
use crate::records::matches::MatchesKey;
use crate::records::store::RecordLine;
use crate::records::{
    Counts, KeepMatches, MatchesFile, RunRecord, SelectedMatches, StageTimes, StoreError,
};

/// The stages that are done once per pair.
pub(super) struct PairStages<'a> {
    pub(super) progress: &'a MatcherProgress<'a>,
    /// Root of all random choices.
    pub(super) root: u64,
    /// How long an estimator may draw samples, if not as long as it likes.
    pub(super) time_budget: Option<Duration>,
    /// The images that the records of the run are of.
    pub(super) images: &'a Mutex<ImageNotes>,
    /// Which matches are handed over.
    pub(super) keep: KeepMatches,
    /// The depth of frames.
    pub(super) depth: DepthMaps,
}

/// What is known of a pair.
struct PairTruth<'a> {
    pair: &'a Pair,
    /// What depth says, where there is any.
    depth: Result<Option<PairDepth<'a>>, Broken>,
}

impl PairTruth<'_> {
    /// The depth, where it is there and can be read.
    fn readable_depth(&self) -> Option<&PairDepth<'_>> {
        self.depth.as_ref().ok()?.as_ref()
    }
}

/// What is known of a pair after the search.
struct Searched<'a> {
    a: &'a Features,
    b: &'a Features,
    /// See [`Extracted::pixels`](super::frame::Extracted).
    pixels: [Option<&'a GrayImage>; 2],
    putative: Correspondences,
}

impl<'a> Searched<'a> {
    fn of(
        matcher: &BuiltMatcher,
        job: &PairJob<'a>,
        counts: &mut Counts,
        times: &mut StageTimes,
    ) -> Result<Self, Broken> {
        let (a, b) = features_of(job)?;
        let putative = search(&*matcher.matcher, a, b, counts, times)?;
        Ok(Self {
            a,
            b,
            pixels: [job.a.pixels, job.b.pixels],
            putative,
        })
    }
}

/// What came of a pair.
pub(super) struct PairDone {
    /// The records of the tasks that were due, each with the index of its estimator.
    pub(super) records: Vec<(usize, RunRecord)>,
    /// The same as they stand in files: threads write lines side by side, and append them one after the other.
    pub(super) lines: Vec<RecordLine>,
    /// The selected matches of each repetition that was computed, if all are kept.
    pub(super) matches: Vec<(MatchesKey, SelectedMatches)>,
    /// The inliers of each estimate, with the index of its estimator, if these are kept.
    pub(super) inliers: Vec<(usize, MatchesKey, SelectedMatches)>,
    /// The images that a source read, which are to be noted, and their content.
    pub(super) images: Vec<(u32, blake3::Hash)>,
    /// The depth by which the pair is judged, which is to be noted too.
    pub(super) depth: Vec<(u32, blake3::Hash)>,
    /// Whether a source found other matches than those that records of other estimators follow from.
    pub(super) is_other: bool,
}

impl PairDone {
    /// Nothing yet of so many tasks of a pair.
    fn of(truth: &PairTruth<'_>, tasks: usize) -> Self {
        let frames = [truth.pair.a, truth.pair.b];
        let depth = truth.readable_depth().map(PairDepth::hashes);
        Self {
            records: Vec::with_capacity(tasks),
            lines: Vec::new(),
            matches: Vec::new(),
            inliers: Vec::new(),
            images: Vec::new(),
            depth: (depth.into_iter())
                .flat_map(|hashes| frames.into_iter().zip(hashes))
                .collect(),
            is_other: false,
        }
    }

    /// The same, with the line of each record.
    pub(super) fn with_lines(mut self) -> Self {
        let records = self.records.iter();
        self.lines = records.map(|(_, record)| RecordLine::of(record)).collect();
        self
    }
}

impl PairStages<'_> {
    /// Does all tasks that are due of a pair of images whose features are known.
    ///
    /// The search is done once, and so is the selection unless it [uses its seed](Matcher::uses_seed); then each
    /// repetition selects anew. All estimators get the same selected matches. Where these are `stored`, nothing is
    /// searched.
    ///
    /// # Errors
    /// If what is stored cannot be read.
    pub(super) fn run(
        &self,
        matcher: &BuiltMatcher,
        job: &PairJob<'_>,
        stored: &MatchesFile,
    ) -> Result<PairDone, RunError> {
        let mut counts = Counts::default();
        let mut times = StageTimes {
            extract_a: job.a.seconds,
            extract_b: job.b.seconds,
            ..StageTimes::default()
        };
        let features = features_of(job);
        let searched = match features {
            Ok(_) if is_stored(stored, job.pair, job.due) => None,
            _ => Some(Searched::of(matcher, job, &mut counts, &mut times)),
        };
        let found = match &searched {
            Some(Err(_)) => None,
            Some(Ok(_)) | None => features.ok(),
        };
        let truth = self.truth(job.pair);
        let repeated = (job.pair.homography().zip(found))
            .and_then(|(homography, (a, b))| repeated(homography, a, b));
        let repeated_by_depth =
            (truth.readable_depth().zip(found)).map(|(depth, (a, b))| depth.repeated(a, b));
        let mut done = PairDone::of(&truth, job.due.len());
        let uses_seed = matcher.matcher.uses_seed();
        let last = job.due.last().map(|due| due.repetition);
        let mut shared = None;
        for due in by_repetition(job.due) {
            let repetition = due[0].repetition;
            let selected = match (&searched, shared.take()) {
                (None, _) => {
                    let matches = stored.read((job.pair.a, job.pair.b, repetition))?;
                    let matches = matches.expect("they are stored");
                    counts = matches.counts;
                    Ok(matches)
                }
                (Some(_), Some(selected)) => selected,
                (Some(searched), None) => {
                    (searched.as_ref().map_err(Clone::clone)).and_then(|searched| {
                        let seed = self.seed(job.pair, repetition);
                        self.select(matcher, job.pair, searched, seed, &mut counts, &mut times)
                    })
                }
            };
            shared = (!uses_seed && last != Some(repetition)).then(|| selected.clone());
            // Whoever comes next finds these results ready, and so without a time.
            let times = mem::take(&mut times);
            let first = done.records.len();
            self.estimate_all(&truth, due, &selected, counts, times, &mut done);
            for (_, record) in &mut done.records[first..] {
                record.repeated = repeated;
                if let Some(by_depth) = &mut record.by_depth {
                    by_depth.repeated = repeated_by_depth;
                }
            }
            self.keep(job.pair, repetition, selected, &mut done);
        }
        Ok(done)
    }

    /// Whether the truth of a pair says something of keypoints: which of them both images show.
    pub(super) fn judges_keypoints(&self, pair: &Pair) -> bool {
        let has_depth = |frame: u32| {
            self.progress.sequence.frames[frame as usize]
                .depth
                .is_some()
        };
        pair.homography().is_some()
            || (pair.pose().is_some() && has_depth(pair.a) && has_depth(pair.b))
    }

    /// Does all tasks that are due of a pair of images that a `source` matches. It is not asked for matches that
    /// are `stored`: asked again, it may give others than those that other estimators got. Where these are not there any
    /// more, it is noted if their numbers are others.
    ///
    /// # Errors
    /// If the source ended, an image that it reads is another than the run has worked with, or what is stored
    /// cannot be read.
    pub(super) fn source(
        &self,
        source: &BuiltPointSource,
        tasks: &PairTasks<'_>,
        stored: &MatchesFile,
    ) -> Result<PairDone, RunError> {
        if is_stored(stored, tasks.pair, &tasks.due) {
            return Ok(self.estimate(tasks, stored)?);
        }
        let (sequence, pair) = (self.progress.sequence, tasks.pair);
        let image = |frame: u32| &*sequence.frames[frame as usize].image;
        let files = ImageFiles {
            dataset: &sequence.name,
            frames: [pair.a, pair.b],
            images: [image(pair.a), image(pair.b)],
        };
        let hashes = self.hashes(pair)?;
        let truth = self.truth(pair);
        let mut done = PairDone::of(&truth, tasks.due.len());
        for due in by_repetition(&tasks.due) {
            let repetition = due[0].repetition;
            if let Some(matches) = stored.read((pair.a, pair.b, repetition))? {
                let (counts, times) = (matches.counts, StageTimes::default());
                self.estimate_all(&truth, due, &Ok(matches), counts, times, &mut done);
                continue;
            }
            let seed = self.seed(pair, repetition);
            let (mut counts, mut times) = (Counts::default(), StageTimes::default());
            let (first, mut device) = (done.records.len(), None);
            let selected = sourced(source, &files, seed, &mut counts, &mut times, &mut device)?;
            self.estimate_all(&truth, due, &selected, counts, times, &mut done);
            // Beside the times of the same record.
            done.records[first].1.device = device;
            if selected.is_ok() {
                done.images.clone_from(&hashes);
                let key = (pair.a, pair.b, repetition);
                done.is_other |= self.progress.is_other(key, counts);
            }
            self.keep(pair, repetition, selected, &mut done);
        }
        Ok(done)
    }

    /// The content of the images of a pair that a source reads, where it has not been looked at yet;
    /// what cannot be read here is left to the source to complain of.
    fn hashes(&self, pair: &Pair) -> Result<Vec<(u32, blake3::Hash)>, RunError> {
        let mut hashes = Vec::new();
        for frame in [pair.a, pair.b] {
            let path = &self.progress.sequence.frames[frame as usize].image;
            if !lock(self.images).is_noted(frame)
                && let Ok(file) = read(path)
            {
                hashes.push((frame, blake3::hash(&file)));
            }
        }
        Ok(hashes)
    }

    /// Does all tasks that are due of a pair whose selected matches are `stored`.
    ///
    /// # Errors
    /// If they cannot be read.
    pub(super) fn estimate(
        &self,
        tasks: &PairTasks<'_>,
        stored: &MatchesFile,
    ) -> Result<PairDone, StoreError> {
        let truth = self.truth(tasks.pair);
        let mut done = PairDone::of(&truth, tasks.due.len());
        for due in by_repetition(&tasks.due) {
            let matches = stored.read((tasks.pair.a, tasks.pair.b, due[0].repetition))?;
            let matches = matches.expect("the caller saw that they are there");
            let (counts, times) = (matches.counts, StageTimes::default());
            self.estimate_all(&truth, due, &Ok(matches), counts, times, &mut done);
        }
        Ok(done)
    }

    /// The records of one repetition; the first of them has the `times` of the stages before.
    fn estimate_all(
        &self,
        truth: &PairTruth<'_>,
        due: &[PendingTask],
        selected: &Result<SelectedMatches, Broken>,
        counts: Counts,
        mut times: StageTimes,
        done: &mut PairDone,
    ) {
        let pair = truth.pair;
        // A truth that cannot be read would be missed in some scores, and nobody would see it.
        let selected = truth.depth.as_ref().and(selected.as_ref());
        let correct = (pair.homography())
            .zip(selected.ok())
            .map(|(homography, selected)| correct_matches(homography, &selected.points));
        let by_depth = (truth.readable_depth().zip(selected.ok()))
            .map(|(depth, selected)| depth.judge(&selected.points));
        let trial = Trial {
            cameras: [self.camera(pair.a), self.camera(pair.b)],
            truth: &pair.truth,
            size: &|side| size(&self.progress.sequence.frames[[pair.a, pair.b][side] as usize]),
            seed: self.seed(pair, due[0].repetition),
            time_budget: self.time_budget,
        };
        for due in due {
            let variant = &self.progress.contender.estimators[due.estimator];
            let outcome = (selected.map_err(Clone::clone)).and_then(|selected| {
                let judged = trial.evaluate(&selected.points, variant, &mut times)?;
                if self.keep == KeepMatches::Inliers && judged.outcome.is_estimate() {
                    let key = (pair.a, pair.b, due.repetition);
                    let inliers = selected.of_indices(&judged.inliers);
                    done.inliers.push((due.estimator, key, inliers));
                }
                Ok::<_, Broken>(judged.outcome)
            });
            let record = RunRecord {
                task: self.progress.task(pair, &variant.name, due.repetition),
                counts,
                correct,
                repeated: None,
                by_depth,
                outcome: outcome.unwrap_or_else(Broken::outcome),
                times: mem::take(&mut times),
                device: None,
            };
            done.records.push((due.estimator, record));
        }
    }

    /// Keeps the matches of a repetition that was computed.
    fn keep(
        &self,
        pair: &Pair,
        repetition: u32,
        selected: Result<SelectedMatches, Broken>,
        done: &mut PairDone,
    ) {
        if let (KeepMatches::All, Ok(matches)) = (self.keep, selected) {
            done.matches.push(((pair.a, pair.b, repetition), matches));
        }
    }

    fn truth<'p>(&'p self, pair: &'p Pair) -> PairTruth<'p> {
        let depth = self.depth.of_pair(self.progress.sequence, pair);
        PairTruth { pair, depth }
    }

    fn seed(&self, pair: &Pair, repetition: u32) -> Seed {
        let (dataset, matcher) = (
            &self.progress.sequence.name,
            self.progress.contender.source.id(),
        );
        pair_seed(self.root, dataset, matcher, (pair.a, pair.b), repetition)
    }

    fn camera(&self, frame: u32) -> &Camera {
        &self.progress.sequence.frames[frame as usize].camera
    }

    fn select(
        &self,
        matcher: &BuiltMatcher,
        pair: &Pair,
        searched: &Searched<'_>,
        seed: Seed,
        counts: &mut Counts,
        times: &mut StageTimes,
    ) -> Result<SelectedMatches, Broken> {
        let [image_a, image_b] = searched.pixels;
        let a = View {
            features: searched.a,
            image: image_a,
            camera: Some(self.camera(pair.a)),
        };
        let b = View {
            features: searched.b,
            image: image_b,
            camera: Some(self.camera(pair.b)),
        };
        let putative = searched.putative.clone();
        let selected = select(&*matcher.matcher, a, b, putative, seed, counts, times)?;
        Ok(selected)
    }
}

/// The features of both images.
fn features_of<'j>(job: &PairJob<'j>) -> Result<(&'j Features, &'j Features), Broken> {
    let features = |side: Side<'j>| side.features.map_err(Clone::clone);
    Ok((features(job.a)?, features(job.b)?))
}

/// Whether the selected matches of all tasks that are due of a pair are `stored`.
pub(super) fn is_stored(stored: &MatchesFile, pair: &Pair, due: &[PendingTask]) -> bool {
    let mut repetitions = due.iter().map(|due| due.repetition);
    repetitions.all(|repetition| stored.contains((pair.a, pair.b, repetition)))
}

/// The tasks of a pair, those of one repetition together.
fn by_repetition(due: &[PendingTask]) -> impl Iterator<Item = &[PendingTask]> {
    due.chunk_by(|x, y| x.repetition == y.repetition)
}
