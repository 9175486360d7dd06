//! Where matches come from: a matcher, stage by stage, or something that yields matched points at once.
//!
//! A [`Matcher`](matchbench_vision::matching::Matcher) extracts, searches and selects, and a run keeps what it
//! extracts. Other sources read the images themselves, or need none (a program beside this one, the files of
//! another tool). They have no such stages and implement [`PointSource`]. After the matched points are there,
//! no code depends on which of the two they came from.

use std::fmt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::seed::Seed;
use serde_json::Value;

use super::BuiltMatcher;

/// Most matches of a pair that are accepted from a source from outside: a hundred megabytes.
pub const MAX_MATCHES: usize = 5_000_000;

/// Longest time of a stage that is accepted, in seconds: 116 days. Sums and means of such times are finite.
pub const LONGEST_STAGE: f64 = 1e7;

/// Whether a stage can have taken so long.
///
/// # Errors
/// If not, in words.
pub fn check_seconds(seconds: f64) -> Result<(), String> {
    if (0.0..=LONGEST_STAGE).contains(&seconds) {
        return Ok(());
    }
    Err(format!(
        "{seconds:?} seconds are no time of a stage; 0 to {LONGEST_STAGE} are"
    ))
}

/// How many of these matches (x and y in a, x and y in b) are different, if most of them are copies of others. A few copies
/// are as it should be: a keypoint with two orientations may have two equal matches.
pub fn mostly_copies(matches: impl Iterator<Item = [f32; 4]>) -> Option<usize> {
    // Adding 0 makes one zero of both.
    let bits = |place: [f32; 4]| place.map(|x| (x + 0.0).to_bits());
    let mut places: Vec<[u32; 4]> = matches.map(bits).collect();
    let all = places.len();
    places.sort_unstable();
    places.dedup();
    (2 * places.len() < all).then_some(places.len())
}

/// The source of the matches of a contender.
#[derive(Debug)]
pub enum Source {
    /// Features are extracted, searched and selected.
    Matcher(BuiltMatcher),
    /// Matched points, at once.
    Points(BuiltPointSource),
}

/// A source of matched points ready to be run, and everything that its results depend on.
#[derive(Debug)]
pub struct BuiltPointSource {
    /// Its name in records and in tables.
    pub id: String,
    /// Its version, as it states it.
    pub version: Option<String>,
    /// How it was started, if it is a program, as far as its results depend on that.
    pub command: Option<Vec<String>>,
    /// Every parameter.
    pub params: Value,
    /// What a reader should know about it, in sentences.
    pub notes: Vec<String>,
    /// The source.
    pub source: Box<dyn PointSource>,
}

/// Yields matched points for two image files.
pub trait PointSource: Send + Sync {
    /// The matches of a pair. May be called from many threads at once.
    ///
    /// # Errors
    /// [`SourceError::Pair`] or [`SourceError::Lacking`] if there is no answer for this pair, which then counts as failed.
    /// [`SourceError::Ended`] if there will be no answer for any later pair either; this ends the run.
    fn matches(&self, pair: &ImageFiles<'_>, seed: Seed) -> Result<SourcedMatches, SourceError>;

    /// Whether it gives the same matches of a pair whenever it is asked, as files do. One that need not is not asked again
    /// for what is recorded.
    fn repeats(&self) -> bool {
        false
    }

    /// Whoever asks from now on is a run that is stopped by `cancel`. Then pairs in flight are finished, but those that
    /// wait for their turn and would take long may be answered by [`SourceError::Stopped`].
    fn heed(&self, cancel: &Cancel) {
        let _ = cancel;
    }

    /// Why files of the cache could not be written since this was last asked, a reason for each file: what is in them is
    /// found again when it is needed again.
    fn take_unkept(&self) -> Vec<String> {
        Vec::new()
    }
}

/// What holds a source can be printed, whatever that is.
impl fmt::Debug for dyn PointSource + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dyn PointSource")
    }
}

/// Stops a run: tasks in flight are finished and recorded, no others are begun. Clones share one
/// state; setting it is safe in a signal handler. A [source](PointSource) from outside may ask it too.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Asks the run to stop.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the run was asked to stop.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Two images of a dataset, as files.
#[derive(Clone, Copy, Debug)]
pub struct ImageFiles<'a> {
    /// Name of the dataset.
    pub dataset: &'a str,
    /// Indices of the frames, `a` and `b`.
    pub frames: [u32; 2],
    /// The files of `a` and `b`.
    pub images: [&'a Path; 2],
}

/// Matched points, and what is known about how they were found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourcedMatches {
    /// The matches, in pixels of the images.
    pub points: MatchedPoints,
    /// Numbers of features of `a` and `b`; 0 where they are not known.
    pub features: [u32; 2],
    /// Matches before any selection, if that is known.
    pub putative: Option<u32>,
    /// Seconds of the stages, as the source measured them.
    pub seconds: SourceSeconds,
}

/// Seconds of the stages of a source; `None` if it did not measure them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceSeconds {
    /// Features of both images.
    pub extract: [Option<f64>; 2],
    /// All that comes after the features.
    pub matching: Option<f64>,
    /// All stages together as the host measured them, if the other times are stated by another program.
    pub wall: Option<f64>,
    /// The device on which that program says it computed.
    pub device: Option<String>,
}

/// Why a source has no matches.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SourceError {
    /// Of this pair; another time there may be some.
    #[error("{0}")]
    Pair(String),
    /// Of this pair, ever.
    #[error("{0}")]
    Lacking(String),
    /// Of this pair and of all others.
    #[error("{0}")]
    Ended(String),
    /// Of this pair, which was not begun since the run [is stopped](PointSource::heed).
    #[error("the run was stopped before")]
    Stopped,
}

impl Source {
    /// Its name in records and in tables.
    pub fn id(&self) -> &str {
        match self {
            Self::Matcher(matcher) => &matcher.id,
            Self::Points(source) => &source.id,
        }
    }

    /// The matcher, if it is one.
    pub fn matcher(&self) -> Option<&BuiltMatcher> {
        match self {
            Self::Matcher(matcher) => Some(matcher),
            Self::Points(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_half_must_be_copies_of_others() {
        let of = |copies: usize, all: usize| {
            let copies = (0..=copies).map(|i| [if i % 2 == 0 { 0.0 } else { -0.0 }, 0.0, 1.0, 2.0]);
            mostly_copies(
                copies
                    .chain((1..).map(|i| [i as f32, 0.0, 1.0, 2.0]))
                    .take(all),
            )
        };
        assert_eq!([of(5, 10), of(6, 10), of(9, 10)], [None, Some(4), Some(1)]);
        assert_eq!(of(0, 0), None);
    }
}
