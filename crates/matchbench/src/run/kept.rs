//! What stays on disk beside records: notes of images and depth, selected matches, inliers. It is there before the records
//! that refer to it, and brought to the disk before them, at most once a second.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::frame::lock;
use super::pair::PairDone;
use super::progress::{MatcherProgress, Replacement};
use super::{RunError, Variant};
use crate::datasets::Frame;
use crate::records::images::ImageNotes;
use crate::records::{KeepMatches, MatchesFile, RunRecord, RunWriter, StoreError, store};

/// What records refer to, which is brought to the disk before them.
pub(super) struct Kept<'a> {
    /// The selected matches, if they are kept.
    matches: Option<MatchesFile>,
    /// The inliers of each estimator, if these are kept.
    inliers: Vec<MatchesFile>,
    frames: &'a [Frame],
    images: &'a Mutex<ImageNotes>,
    depth: ImageNotes,
    /// When all was brought to the disk.
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

    /// Brings all to the disk, and then the `records` that refer to it.
    pub(super) fn sync(
        &mut self,
        records: impl FnOnce() -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        (self.matches.iter_mut().chain(&mut self.inliers)).try_for_each(MatchesFile::sync)?;
        records()?;
        // Afterwards: a disk that takes long is not asked again at once.
        self.synced = Instant::now();
        Ok(())
    }
}

/// Records that take the place of earlier ones. Each time their whole files are written.
pub(super) struct Retried<'a> {
    replacements: Vec<Replacement<'a>>,
    kept: Kept<'a>,
    /// How long records of this process wait until they are written.
    pause: Duration,
}

impl<'a> Retried<'a> {
    pub(super) fn new(replacements: Vec<Replacement<'a>>, kept: Kept<'a>) -> Self {
        Self {
            replacements,
            kept,
            pause: store::UNSYNCED,
        }
    }

    /// Puts what came of a pair in the place of what failed, and writes it if that was long enough ago; whoever is `told`
    /// learns of each record.
    pub(super) fn put(
        &mut self,
        done: PairDone,
        told: &mut impl FnMut(&RunRecord),
    ) -> Result<(), RunError> {
        self.kept.keep(&done)?;
        for ((estimator, record), line) in done.records.into_iter().zip(done.lines) {
            told(&record);
            self.replacements[estimator].put(&record.task, line);
        }
        if self.kept.synced.elapsed() >= self.pause {
            self.write()?;
        }
        Ok(())
    }

    pub(super) fn write(&mut self) -> Result<(), StoreError> {
        let (start, replacements) = (Instant::now(), &mut self.replacements);
        (self.kept).sync(|| replacements.iter_mut().try_for_each(Replacement::write))?;
        // Tests do not wait for it.
        if cfg!(not(test)) {
            self.pause = pause_after(start.elapsed(), store::UNSYNCED);
        }
        Ok(())
    }
}

/// How long records wait if the last writing took so long, and at `least`: all writing together takes at most a tenth of
/// the time, however long the files are.
fn pause_after(writing: Duration, least: Duration) -> Duration {
    least.max(9 * writing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writing_files_anew_takes_a_tenth_of_the_time_at_most() {
        let least = Duration::from_secs(1);
        let pause = |milliseconds| pause_after(Duration::from_millis(milliseconds), least);
        assert_eq!([0, 50, 111].map(pause), [least; 3]);
        assert_eq!(pause(2000), Duration::from_secs(18));
    }
}
