//! What stays on disk beside records: notes of images and depth, selected matches, inliers. It is there before the records
//! that refer to it, and brought to the disk before them, at most once a second.

use std::sync::Mutex;
use std::time::Instant;

use super::frame::lock;
use super::pair::PairDone;
use super::progress::{MatcherProgress, Replacement};
use super::{RunError, Variant};
use crate::datasets::Frame;
use crate::records::images::ImageNotes;
use crate::records::{KeepMatches, MatchesFile, RunWriter, StoreError, store};

/// What records refer to, which is brought to the disk before them.
pub(super) struct Kept<'a> {
    /// The selected matches, if they are kept.
    matches: Option<MatchesFile>,
    /// The inliers of each estimator, if these are kept.
    inliers: Vec<MatchesFile>,
    frames: &'a [Frame],
    images: &'a Mutex<ImageNotes>,
    depth: ImageNotes,
    synced: Instant,
}

impl<'a> Kept<'a> {
    /// What is kept of one matcher on one dataset.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub(super) fn open(
        keep: KeepMatches,
        progress: &MatcherProgress<'a>,
        folder: &RunWriter,
        images: &'a Mutex<ImageNotes>,
    ) -> Result<Self, RunError> {
        let (dataset, matcher) = (&progress.sequence.name, progress.contender.source.id());
        let folder = folder.folder();
        let matches = (keep == KeepMatches::All).then(|| progress.own_matches(folder));
        let estimators: &[Variant] = match keep {
            KeepMatches::Inliers => &progress.contender.estimators,
            KeepMatches::All | KeepMatches::None => &[],
        };
        let inliers =
            (estimators.iter()).map(|variant| folder.inliers_of(dataset, matcher, &variant.name));
        Ok(Self {
            matches: matches.transpose()?,
            inliers: inliers.collect::<Result<_, _>>()?,
            frames: &progress.sequence.frames,
            images,
            depth: folder.depth_of(dataset)?,
            synced: Instant::now(),
        })
    }

    /// Keeps what records follow from that are written next.
    pub(super) fn keep(&mut self, done: &PairDone) -> Result<(), RunError> {
        for &(frame, hash) in &done.images {
            lock(self.images).note(frame, &self.frames[frame as usize].image, hash)?;
        }
        for &(frame, hash) in &done.depth {
            if let Some(depth) = &self.frames[frame as usize].depth {
                self.depth.note(frame, &depth.path, hash)?;
            }
        }
        // Seldom: once for each image.
        lock(self.images).sync()?;
        self.depth.sync()?;
        for (estimator, key, inliers) in &done.inliers {
            self.inliers[*estimator].append(*key, inliers)?;
        }
        if let Some(file) = &mut self.matches {
            for (key, matches) in &done.matches {
                file.append(*key, matches)?;
            }
        }
        Ok(())
    }

    /// Whether records have been known to the operating system alone for long enough.
    pub(super) fn is_time(&self) -> bool {
        self.synced.elapsed() >= store::UNSYNCED
    }

    /// To be followed by the records.
    pub(super) fn sync(&mut self) -> Result<(), StoreError> {
        self.synced = Instant::now();
        (self.matches.iter_mut().chain(&mut self.inliers)).try_for_each(MatchesFile::sync)
    }
}

/// Records that take the place of earlier ones.
pub(super) struct Retried<'a> {
    pub(super) replacements: Vec<Replacement>,
    pub(super) kept: Kept<'a>,
}

impl Retried<'_> {
    pub(super) fn write(&mut self) -> Result<(), StoreError> {
        self.kept.sync()?;
        (self.replacements.iter_mut()).try_for_each(Replacement::write)
    }
}
