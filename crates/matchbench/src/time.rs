//! Measures how long a matcher takes, by the paper's protocol.
//!
//! The first pairs of one dataset are measured, with one thread, no cache and the wall clock. Detection and
//! description are timed once per image, search and selection once per pair. Each measurement is a run in a
//! folder of its own, which is deleted afterwards. A few pairs are run before, to warm up, and again at the
//! end. If the same work then takes another time, or if single times are far from all others, the machine was
//! busy with other work, and a warning says so.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::slice;
use std::thread::available_parallelism;

use matchbench_vision::InstructionSet;
use rayon::ThreadPoolBuilder;

use crate::counted::counted;
use crate::files::TemporaryFolder;
use crate::memory::{self, STACK};
use crate::metrics::{
    Failure, PairResult, Quartiles, ResultSet, ResultsError, StageQuartiles, load_run,
};
use crate::records::{FolderError, KeepMatches, RunFolder, RunSettings, StageTimes};
use crate::run::{Cancel, Contender, Dataset, Run, RunError, Silent};

/// Number of pairs that are run to warm up, and again at the end.
const PROBES: usize = 5;
/// If the time of the same work changes by more than this share, the machine counts as noisy.
const NOISE: f64 = 0.1;

/// How long a matcher took.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// Quartiles of the stages, over the pairs that reached them.
    pub stages: StageQuartiles,
    /// How many pairs broke at a stage: an image that cannot be read, or an error of the matcher.
    pub broken: usize,
    /// Number of all pairs.
    pub pairs: usize,
    /// The most memory that the process used during the measurement, in bytes, if the system tells it (Linux).
    pub peak_memory: Option<f64>,
    /// Signs that the machine was busy with other work, in sentences.
    pub noise: Vec<String>,
}

impl Timing {
    /// That pairs broke, in a sentence; `None` if none did.
    pub fn breakage(&self) -> Option<String> {
        (self.broken > 0).then(|| {
            format!(
                "{} of {} broke; `matchbench run` on this dataset records why",
                self.broken,
                counted(self.pairs, "pair")
            )
        })
    }
}

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TimeError {
    /// The run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Its results.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// Its folder.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The temporary folder.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The system cannot start a thread.
    #[error("cannot start a thread: {0}")]
    Thread(String),
    /// The dataset has no pairs.
    #[error("{0} has no pairs to measure on")]
    NoPairs(String),
}

/// Measures a contender on the first `pairs` of a dataset, in one thread, whatever pool the caller is in.
/// `None` if it was stopped.
///
/// # Errors
/// If a run fails. A pair that fails is not an error.
pub fn time(
    dataset: &Dataset,
    contender: &Contender,
    pairs: usize,
    cancel: &Cancel,
) -> Result<Option<Timing>, TimeError> {
    let one_thread = ThreadPoolBuilder::new().num_threads(1).stack_size(STACK);
    let one_thread = (one_thread.build()).map_err(|error| TimeError::Thread(error.to_string()))?;
    one_thread.install(|| {
        let measure = |pairs| measure(dataset, contender, pairs, cancel);
        let probes = PROBES.min(pairs);
        let Some(_) = measure(probes)? else {
            return Ok(None);
        };
        memory::forget_peak();
        let (Some(probe), Some(all), Some(again)) =
            (measure(probes)?, measure(pairs)?, measure(probes)?)
        else {
            return Ok(None);
        };
        Ok(Some(Timing {
            stages: StageQuartiles::new(&all.pairs),
            broken: (all.pairs.iter())
                .filter(|pair| pair.outcome == Err(Failure::Broken))
                .count(),
            pairs: all.pairs.len(),
            peak_memory: memory::peak().map(|bytes| bytes as f64),
            noise: noise(&probe, &all, &again).collect(),
        }))
    })
}

/// The machine in words: system, processor, instruction set of the kernels, number of cores.
pub fn machine() -> String {
    format!(
        "{} {}, {}{}, {} cores",
        std::env::consts::OS,
        std::env::consts::ARCH,
        processor(),
        instructions(),
        available_parallelism().map_or(1, usize::from)
    )
}

/// One run of the first pairs, without a cache; `None` if it was stopped.
fn measure(
    dataset: &Dataset,
    contender: &Contender,
    pairs: usize,
    cancel: &Cancel,
) -> Result<Option<ResultSet>, TimeError> {
    let folder = TemporaryFolder::new()?;
    let run = Run {
        settings: RunSettings {
            limit: Some(pairs),
            ..RunSettings::default()
        },
        keep_matches: KeepMatches::None,
        ..Run::new(
            slice::from_ref(dataset),
            slice::from_ref(contender),
            folder.path(),
        )
    };
    if !run.execute(&Silent, cancel)?.is_complete() {
        return Ok(None);
    }
    let set = load_run(&RunFolder::open(folder.path())?, None)?
        .into_iter()
        .next();
    set.ok_or_else(|| TimeError::NoPairs(dataset.sequence.name.clone()))
        .map(Some)
}

/// Signs of noise in the measurement `all`, which was made between two others of a few pairs.
fn noise(
    before: &ResultSet,
    all: &ResultSet,
    after: &ResultSet,
) -> impl Iterator<Item = String> + use<> {
    let drift = drift(&before.pairs, &after.pairs).filter(|ratio| (ratio - 1.0).abs() > NOISE);
    let drift = drift.map(|ratio| {
        format!(
            "the same {} took {ratio:.2} times as long after the measurement as before",
            counted(before.pairs.len(), "pair")
        )
    });
    let stage = |name: &str, get: &[fn(&StageTimes) -> Option<f64>]| {
        let times = all
            .pairs
            .iter()
            .flat_map(|pair| get.iter().filter_map(|get| get(&pair.times)));
        let times: Vec<f64> = times.collect();
        let count = outliers(&times);
        (count > 0).then(|| {
            format!(
                "{count} of {} times of the {name} are far outliers",
                times.len()
            )
        })
    };
    // The pose is left out: a pair with hardly any right matches really takes a hundred times as long as an
    // easy one.
    let stages = [
        stage(
            "detection",
            &[|times| times.extract_a, |times| times.extract_b],
        ),
        stage("search", &[|times| times.search]),
    ];
    drift.into_iter().chain(stages.into_iter().flatten())
}

/// How many values, in seconds, are far above the median: those whose modified Z-score (Iglewicz and Hoaglin, 1993),
/// the distance in standard deviations as the median distance tells them, is above the limit of hyperfine. A median
/// distance below 0.1 ms counts as that.
fn outliers(values: &[f64]) -> usize {
    const LIMIT: f64 = 14.826;
    let middle = |values: Vec<f64>| Quartiles::of(values).map_or(0.0, |spread| spread.median);
    let median = middle(values.to_vec());
    let usual = middle(values.iter().map(|value| (value - median).abs()).collect());
    (values.iter())
        .filter(|&&value| 0.6745 * (value - median) > LIMIT * usual.max(1e-4))
        .count()
}

/// How much longer the same pairs took the second time: the median of the ratios.
fn drift(before: &[PairResult], after: &[PairResult]) -> Option<f64> {
    let total = |pair: &PairResult| {
        let times = pair.times;
        [
            times.extract_a,
            times.extract_b,
            times.search,
            times.select,
            times.estimate,
        ]
        .into_iter()
        .flatten()
        .sum::<f64>()
    };
    let before: BTreeMap<_, _> = before.iter().map(|p| ((p.a, p.b), total(p))).collect();
    let ratios = (after.iter())
        .filter_map(|p| Some(total(p) / before.get(&(p.a, p.b))?))
        .filter(|ratio| ratio.is_finite());
    Quartiles::of(ratios).map(|spread| spread.median)
}

/// The name of the processor, if the system tells it.
fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    field(&text, "model name").unwrap_or_else(|| "unknown processor".into())
}

/// The instruction set that the kernels use, if there is a choice.
fn instructions() -> &'static str {
    match InstructionSet::in_use() {
        InstructionSet::Portable => "",
        InstructionSet::Avx2 => " with AVX2 and FMA",
        InstructionSet::Avx512 => " with AVX-512",
        InstructionSet::Amx => " with AVX-512 and AMX",
    }
}

fn field(text: &str, name: &str) -> Option<String> {
    let mut lines = text.lines().filter_map(|line| line.split_once(':'));
    lines
        .find(|(key, _)| key.trim() == name)
        .map(|(_, value)| value.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_is_the_median_ratio_of_the_same_pairs() {
        let timed = |a: u32, seconds: f64| {
            let mut pair = PairResult::failed(a, a + 1, Failure::NoSupport);
            pair.times.search = Some(seconds);
            pair
        };
        let before = [timed(0, 1.0), timed(1, 2.0), timed(2, 1.0)];
        let after = [timed(2, 9.0), timed(1, 3.0), timed(0, 1.2), timed(7, 1.0)];
        assert_eq!(drift(&before, &after), Some(1.5));
        assert_eq!(drift(&before, &[]), None);
    }

    #[test]
    fn outliers_are_far_from_what_is_usual() {
        let usual: Vec<f64> = (0..20).map(|i| 0.1 + 0.001 * f64::from(i % 5)).collect();
        assert_eq!(outliers(&usual), 0);
        assert_eq!(outliers(&[&usual[..], &[0.9, 1.5]].concat()), 2);
        // Times are nearly equal: a tenth of a millisecond more is no outlier.
        assert_eq!(outliers(&[0.1, 0.1, 0.1, 0.1001]), 0);
        assert_eq!(outliers(&[]), 0);
    }
}
