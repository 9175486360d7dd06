//! Merges the folders of all shards into that of one run.
//!
//! Every file is read from its beginning to its end, and written in the same way, in the order of the
//! pairs. Memory holds only the cut, one line, one entry of matches, and a number for each image. Nothing
//! is written before all shards are known to be done, and a file takes its place only when it is complete.
//! So merging again does no harm. Records that the run has repaired since then are never replaced: a file
//! with fewer failures than the shards have is an error.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::super::images::ImageNotes;
use super::super::matches::{self, MAGIC};
use super::super::{
    Counts, DatasetPlan, EstimatorPlan, FolderError, KeepMatches, MatcherPlan, Outcome, RunRecord,
    RunWriter, StoreError, Task, store,
};
use super::entry_file::EntryFile;
use super::folders::{contenders, gather};
use super::record_file::RecordFile;
use super::{PairsHash, ShardError, ShardPlan, Stretches};
use crate::files::WholeFile;

/// Most shards whose files are open at a time: two files each, and systems allow some 256.
const MAX_OPEN: usize = 64;

/// What was merged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Merged {
    /// Tasks, all of them recorded.
    pub tasks: u64,
    /// Those that failed.
    pub failed: u64,
}

/// Merges the shards of a `plan`, whose folder is `home`, into a run in the folder `out`: the same records,
/// matches, notes of images and plan that one machine would have written, but for the times. Shards that
/// were worked elsewhere are looked for in `copies`, each a copy of `home` or the folder of a shard.
///
/// # Errors
/// If a shard is missing, not done, not of this plan, damaged, or there twice with different results;
/// if `out` holds another run, or records that failed in the shards and were repaired since, or cannot be written to.
/// [`ShardError::Unfinished`] if `out` was begun.
pub fn merge(
    plan: &ShardPlan,
    home: &Path,
    copies: &[PathBuf],
    out: &Path,
) -> Result<Merged, ShardError> {
    let folders = gather(plan, home, copies)?;
    let writer = RunWriter::start(out, plan.plan().clone())?;
    let merging = Merging {
        plan,
        folders: &folders,
        out,
    };
    merging.refuse_repaired()?;
    merging
        .all(&writer)
        .map_err(|error| ShardError::Unfinished {
            out: out.into(),
            error: Box::new(error),
        })
}

/// The shards and where they go.
struct Merging<'a> {
    plan: &'a ShardPlan,
    folders: &'a [PathBuf],
    out: &'a Path,
}

/// Whose files are merged.
struct Files<'a> {
    matcher: &'a MatcherPlan,
    estimator: &'a EstimatorPlan,
    /// Whether the estimator is the first of the matcher, beside whose records the matches are read.
    is_first: bool,
}

/// Frames in the order of their first use.
#[derive(Clone, Default)]
struct Frames {
    seen: BTreeSet<u32>,
    order: Vec<u32>,
    /// The shards that have results of the dataset, and so notes of its images.
    shards: BTreeSet<usize>,
}

impl Frames {
    fn see(&mut self, frame: u32) {
        if self.seen.insert(frame) {
            self.order.push(frame);
        }
    }
}

impl Merging<'_> {
    /// Refuses to replace records that did not fail by those of shards where they did.
    fn refuse_repaired(&self) -> Result<(), ShardError> {
        let plan = self.plan.plan();
        for dataset in &plan.datasets {
            for (matcher, estimator) in contenders(plan) {
                let path = |folder: &Path| store::path(folder, &dataset.name, matcher, estimator);
                let here = succeeded(path(self.out))?;
                if here == 0 {
                    continue;
                }
                let mut in_shards = 0;
                for folder in self.folders {
                    in_shards += succeeded(path(folder))?;
                }
                if here > in_shards {
                    return Err(ShardError::Repaired {
                        path: path(self.out),
                        repaired: here - in_shards,
                    });
                }
            }
        }
        Ok(())
    }

    /// All files of the run besides its plan.
    fn all(&self, writer: &RunWriter) -> Result<Merged, ShardError> {
        if !self.plan.tuned().is_empty() {
            writer.note_tuned(self.plan.tuned())?;
        }
        let plan = self.plan.plan();
        let mut merged = Merged::default();
        let mut frames = vec![Frames::default(); plan.datasets.len()];
        for matcher in &plan.matchers {
            for (index, estimator) in matcher.estimators.iter().enumerate() {
                let files = Files {
                    matcher,
                    estimator,
                    is_first: index == 0,
                };
                let done = self.records(&files, &mut frames)?;
                merged.tasks += done.tasks;
                merged.failed += done.failed;
            }
        }
        for (dataset, frames) in plan.datasets.iter().zip(&frames) {
            self.images(writer, dataset, frames)?;
        }
        Ok(merged)
    }

    /// The records of a matcher with an estimator on all datasets, and what was kept of their matches.
    fn records(&self, files: &Files<'_>, frames: &mut [Frames]) -> Result<Merged, ShardError> {
        let mut merged = Merged::default();
        let mut hashes = vec![PairsHash::default(); self.folders.len()];
        let datasets = &self.plan.plan().datasets;
        for (index, (dataset, stretches)) in
            datasets.iter().zip(&self.plan.cut().datasets).enumerate()
        {
            let mut sink = Sink {
                hashes: &mut hashes,
                frames: &mut frames[index],
                dataset: index,
            };
            let done = self.dataset(files, dataset, stretches, &mut sink)?;
            merged.tasks += done.tasks;
            merged.failed += done.failed;
        }
        for (shard, (hash, part)) in hashes.iter().zip(&self.plan.cut().parts).enumerate() {
            if hash.text() != part.hash {
                return Err(self.broken(shard, "its records are of other pairs"));
            }
        }
        Ok(merged)
    }

    /// The records of a method on a dataset, and their matches.
    fn dataset(
        &self,
        files: &Files<'_>,
        dataset: &DatasetPlan,
        stretches: &Stretches,
        sink: &mut Sink<'_>,
    ) -> Result<Merged, ShardError> {
        let (matcher, estimator) = (&files.matcher.id, &files.estimator.id);
        let record_path = |folder: &Path| store::path(folder, &dataset.name, matcher, estimator);
        let entry_path = |folder: &Path| match self.plan.keep_matches() {
            KeepMatches::All => matches::path(folder, &dataset.name, matcher),
            _ => matches::inliers_path(folder, &dataset.name, matcher, estimator),
        };
        let has_entries = match self.plan.keep_matches() {
            KeepMatches::All => files.is_first,
            KeepMatches::Inliers => true,
            KeepMatches::None => false,
        };
        let mut shards = Shards::new(self.folders.iter().map(|folder| Shard {
            records: RecordFile::new(record_path(folder)),
            entries: has_entries.then(|| EntryFile::new(entry_path(folder))),
        }));
        let mut out = Outputs {
            records: Output::new(record_path(self.out), b""),
            entries: Output::new(entry_path(self.out), &MAGIC),
        };
        let mut merged = Merged::default();
        for stretch in stretches.iter() {
            let index = stretch.shard as usize - 1;
            let shard = shards.open(index);
            for _ in 0..stretch.pairs {
                let done = self.pair(files, dataset, index, shard, &mut out, sink)?;
                merged.tasks += done.tasks;
                merged.failed += done.failed;
            }
        }
        for (index, shard) in shards.all.iter_mut().enumerate() {
            if let Some(entries) = &mut shard.entries
                && entries.has_more()?
            {
                return Err(self.broken(index, "it has matches of pairs without a record"));
            }
            shard.close();
        }
        out.records.finish()?;
        out.entries.finish()?;
        Ok(merged)
    }

    /// The records of the next pair of the `shard` with this index, and their matches.
    fn pair(
        &self,
        files: &Files<'_>,
        dataset: &DatasetPlan,
        index: usize,
        shard: &mut Shard,
        out: &mut Outputs,
        sink: &mut Sink<'_>,
    ) -> Result<Merged, ShardError> {
        let mut merged = Merged::default();
        let mut pair = None;
        // With an extractor, frames are noted when extracted; a source of matches notes the frames of each pair that it
        // answered.
        let mut is_noted = files.matcher.extraction.is_some();
        for repetition in 0..self.plan.plan().settings.repetitions.get() {
            let Some((line, record)) = shard.records.next()? else {
                return Err(self.broken(index, "a record went away while it was merged"));
            };
            let (a, b) = *pair.get_or_insert((record.task.a, record.task.b));
            let task = Task {
                dataset: dataset.name.clone(),
                matcher: files.matcher.id.clone(),
                estimator: files.estimator.id.clone(),
                a,
                b,
                repetition,
            };
            if record.task != task {
                return Err(self.broken(index, "a record is of another task"));
            }
            out.records.write(line)?;
            merged.tasks += 1;
            merged.failed += u64::from(record.outcome.has_failed());
            is_noted |= !record.outcome.has_failed() || record.counts.selected > 0;
            if !record.outcome.has_failed() {
                sink.frames.shards.insert(index);
            }
            if let Some(file) = &mut shard.entries
                && let Some(entry) = self.entry(index, files.matcher, file, &record)?
            {
                // An entry proves that the source answered, even with no matches.
                is_noted = true;
                out.entries.write(&entry)?;
            }
        }
        if let Some((a, b)) = pair {
            sink.see(index, a, b, is_noted);
        }
        Ok(merged)
    }

    /// The entry of the matches that belong to a record of a matcher, if it has any.
    fn entry(
        &self,
        shard: usize,
        matcher: &MatcherPlan,
        file: &mut EntryFile,
        record: &RunRecord,
    ) -> Result<Option<Vec<u8>>, ShardError> {
        let must_be = match (self.plan.keep_matches(), &record.outcome) {
            // Without a selection there are none.
            (KeepMatches::All, Outcome::Failed { .. }) => false,
            (KeepMatches::All, _) => true,
            (_, Outcome::Failed { .. }) => false,
            (_, outcome) if outcome.is_estimate() => true,
            _ => return Ok(None),
        };
        // What broke after the selection has some: an estimator, the depth, the size of an image. A matcher from
        // outside may have found no matches then, and need not tell how many features there were. What has none may
        // have some nevertheless, if the shard was killed after it had tried again and before that was recorded.
        let may_be_selected = record.counts != Counts::default() || matcher.extraction.is_none();
        let are_all = self.plan.keep_matches() == KeepMatches::All;
        let is_likely = must_be || (are_all && may_be_selected);
        let Task {
            a, b, repetition, ..
        } = record.task;
        match file.take((a, b, repetition), is_likely)? {
            None if must_be && are_all && matcher.extraction.is_some() => Err(ShardError::Lost {
                number: number(shard),
                folder: self.folders[shard].clone(),
                frames: [a, b],
            }),
            None if must_be => {
                Err(self.broken(shard, &format!("it has lost the matches of {a} {b}")))
            }
            entry => Ok(entry),
        }
    }

    /// The notes of the images of a dataset, in the order of their first use, and of their depth.
    fn images(
        &self,
        writer: &RunWriter,
        dataset: &DatasetPlan,
        frames: &Frames,
    ) -> Result<(), ShardError> {
        for &shard in &frames.shards {
            if !ImageNotes::open(&self.folders[shard], &dataset.name)?.is_there() {
                let reason = format!(
                    "it has lost the notes of the images of {0} (images/{0}.txt), by which all shards are known to have \
                     worked with the same",
                    dataset.name
                );
                return Err(self.broken(shard, &reason));
            }
        }
        let images = self.same_in_all(dataset, "image", ImageNotes::open)?;
        let depth = self.same_in_all(dataset, "depth", ImageNotes::open_depth)?;
        let folder = writer.folder();
        for (noted, mut notes) in [
            (images, folder.images_of(&dataset.name)?),
            (depth, folder.depth_of(&dataset.name)?),
        ] {
            for frame in &frames.order {
                if let Some((shard, hash)) = noted.get(frame) {
                    notes.note(*frame, &self.folders[*shard], *hash)?;
                }
            }
        }
        Ok(())
    }

    /// What shards have noted of each frame, and the first of them; all must have noted the same.
    fn same_in_all(
        &self,
        dataset: &DatasetPlan,
        what: &'static str,
        open: fn(&Path, &str) -> Result<ImageNotes, FolderError>,
    ) -> Result<BTreeMap<u32, (usize, blake3::Hash)>, ShardError> {
        let mut hashes = BTreeMap::new();
        for (shard, folder) in self.folders.iter().enumerate() {
            for (&frame, &hash) in open(folder, &dataset.name)?.known() {
                let (first, known) = *hashes.entry(frame).or_insert((shard, hash));
                if known != hash {
                    return Err(ShardError::OtherImage {
                        what,
                        dataset: dataset.name.clone(),
                        frame,
                        folders: [self.folders[first].clone(), folder.clone()],
                    });
                }
            }
        }
        Ok(hashes)
    }

    fn broken(&self, shard: usize, reason: &str) -> ShardError {
        ShardError::Broken {
            number: number(shard),
            folder: self.folders[shard].clone(),
            reason: reason.into(),
        }
    }
}

/// The number of the shard with this index.
fn number(shard: usize) -> u32 {
    u32::try_from(shard + 1).unwrap_or(u32::MAX)
}

/// How many records of a file did not fail; none if it is not there.
fn succeeded(path: PathBuf) -> Result<u64, StoreError> {
    let mut file = RecordFile::new(path);
    let mut number = 0;
    while let Some((_, record)) = file.next()? {
        number += u64::from(!record.outcome.has_failed());
    }
    Ok(number)
}

/// What is written of a method on a dataset.
struct Outputs {
    records: Output,
    entries: Output,
}

/// Who is told of every pair.
struct Sink<'a> {
    hashes: &'a mut [PairsHash],
    frames: &'a mut Frames,
    dataset: usize,
}

impl Sink<'_> {
    fn see(&mut self, shard: usize, a: u32, b: u32, is_noted: bool) {
        self.hashes[shard].add(self.dataset, a, b);
        if is_noted {
            self.frames.see(a);
            self.frames.see(b);
        }
    }
}

/// What is read of a shard.
struct Shard {
    records: RecordFile,
    entries: Option<EntryFile>,
}

impl Shard {
    fn close(&mut self) {
        self.records.close();
        if let Some(entries) = &mut self.entries {
            entries.close();
        }
    }
}

/// All shards, few of which have their files open.
struct Shards {
    all: Vec<Shard>,
    open: VecDeque<usize>,
}

impl Shards {
    fn new(all: impl Iterator<Item = Shard>) -> Self {
        Self {
            all: all.collect(),
            open: VecDeque::new(),
        }
    }

    /// A shard that may have its files open; the one that was opened first is closed for it.
    fn open(&mut self, index: usize) -> &mut Shard {
        if !self.open.contains(&index) {
            if self.open.len() == MAX_OPEN
                && let Some(first) = self.open.pop_front()
            {
                self.all[first].close();
            }
            self.open.push_back(index);
        }
        &mut self.all[index]
    }
}

/// A file that begins with the first bytes that are written, and is not there without any.
struct Output {
    path: PathBuf,
    head: &'static [u8],
    file: Option<WholeFile>,
}

impl Output {
    fn new(path: PathBuf, head: &'static [u8]) -> Self {
        Self {
            path,
            head,
            file: None,
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), StoreError> {
        let unwritable = StoreError::io("write", &self.path);
        let file = match &mut self.file {
            Some(file) => file,
            none => {
                let file = none.insert(WholeFile::create(&self.path).map_err(unwritable)?);
                file.write_all(self.head).map_err(unwritable)?;
                file
            }
        };
        file.write_all(bytes).map_err(unwritable)
    }

    fn finish(self) -> Result<(), StoreError> {
        let unwritable = StoreError::io("write", &self.path);
        self.file
            .map_or(Ok(()), WholeFile::finish)
            .map_err(unwritable)
    }
}
