//! `matchbench time`: how long matchers take, by the paper's protocol.
//!
//! The first pairs of one dataset, one thread, no cache, wall clock: detection and description once
//! for an image, search and selection once for a pair. Each matcher runs in a folder of its own
//! that is thrown away; a few pairs are run before, to warm up, and again at the end: if the same
//! work then takes another time, or single times are far from all others, the machine was not quiet,
//! and a warning says so.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::thread::available_parallelism;

use anyhow::{Context, Result};
use matchbench::metrics::{PairResult, ResultSet, Spread, StageSpreads, load};
use matchbench::records::StageTimes;
use matchbench::run::{Cancel, Contender, Dataset, Settings};

use super::run::{Job, open};
use crate::Ending;
use crate::args::TimeArgs;
use crate::contenders::contenders;
use crate::progress::cancel_on_ctrl_c;

/// Pairs that are run to warm up, and again at the end.
const PROBES: usize = 5;
/// The same work may take this much more or less time before the machine counts as noisy.
const NOISE: f64 = 0.1;

pub(crate) fn run(args: &TimeArgs) -> Result<Ending> {
    let datasets = open(&[&args.dataset])?;
    let contenders = contenders(&args.matchers, &[], &args.set)?;
    let cancel = cancel_on_ctrl_c("stopping")?;
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "matchbench {}, {} {}, {}{}, {} cores; 1 thread, no cache; first {} pairs of {}",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH,
        processor(),
        instructions(),
        available_parallelism().map_or(1, usize::from),
        args.pairs.min(datasets[0].sequence.pairs.len()),
        datasets[0].sequence.name
    )?;
    writeln!(
        out,
        "median (quartiles) in milliseconds; detection per image, the rest per pair; \
         memory is the most that the process had meanwhile\n"
    )?;
    let heads = ["detection", "search", "selection", "pose"].map(|head| format!("{head:>24}"));
    writeln!(
        out,
        "{:<14} {:>8}  {}  {:>9}",
        "matcher",
        "features",
        heads.join("  "),
        "memory"
    )?;
    let mut warnings = Vec::new();
    for contender in contenders {
        let one = [contender];
        let id = &one[0].matcher.id;
        let measure = |pairs| measure(&datasets, &one, pairs, &cancel);
        let Some(_) = measure(PROBES)? else {
            return Ok(Ending::Stopped);
        };
        forget_peak_memory();
        let (Some(probe), Some(all), Some(again)) =
            (measure(PROBES)?, measure(args.pairs)?, measure(PROBES)?)
        else {
            return Ok(Ending::Stopped);
        };
        let stages = StageSpreads::new(&all.pairs);
        let times = [
            stages.extract,
            stages.search,
            stages.select,
            stages.estimate,
        ];
        writeln!(
            out,
            "{id:<14} {:>8}  {}  {:>9}",
            stages
                .features
                .map_or_else(|| "–".into(), |s| format!("{:.0}", s.median)),
            times.map(|time| format!("{:>24}", shown(time))).join("  "),
            peak_memory()
        )?;
        warnings.extend(noise(&probe, &all, &again).map(|warning| format!("{id}: {warning}")));
    }
    for warning in &warnings {
        eprintln!("warning: {warning}");
    }
    if !warnings.is_empty() {
        eprintln!("the machine was not quiet; measure again without other programs");
    }
    Ok(Ending::Done)
}

/// One run of the first pairs, from nothing; `None` if it was stopped.
fn measure(
    datasets: &[Dataset],
    contenders: &[Contender],
    pairs: usize,
    cancel: &Cancel,
) -> Result<Option<ResultSet>> {
    let folder = tempfile::tempdir()?;
    let job = Job {
        datasets,
        contenders,
        settings: Settings {
            limit: Some(pairs),
            ..Settings::default()
        },
        folder: folder.path(),
        cache: None,
        threads: Some(1),
        keep_matches: false,
    };
    if !job.execute_quietly(cancel)? {
        return Ok(None);
    }
    let set = load(folder.path(), None)?.into_iter().next();
    set.context("the run left no records").map(Some)
}

fn shown(spread: Option<Spread>) -> String {
    spread.map_or_else(
        || "–".into(),
        |Spread {
             lower,
             median,
             upper,
         }| {
            format!(
                "{:.2} ({:.2}–{:.2})",
                median * 1e3,
                lower * 1e3,
                upper * 1e3
            )
        },
    )
}

/// What speaks against the measurement `all`, which stands between two others of a few pairs.
fn noise(
    before: &ResultSet,
    all: &ResultSet,
    after: &ResultSet,
) -> impl Iterator<Item = String> + use<> {
    let drift = drift(&before.pairs, &after.pairs).filter(|ratio| (ratio - 1.0).abs() > NOISE);
    let drift = drift.map(|ratio| {
        format!(
            "the same {PROBES} pairs took {ratio:.2} times as long after the measurement as before"
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
    // The pose is left out: a hopeless pair truly takes a hundred times as long as an easy one.
    let stages = [
        stage(
            "detection",
            &[|times| times.extract_a, |times| times.extract_b],
        ),
        stage("search", &[|times| times.search]),
    ];
    drift.into_iter().chain(stages.into_iter().flatten())
}

/// How many values lie above the median by more than ten times the usual distance from it (its
/// median, scaled to a standard deviation: Iglewicz and Hoaglin, 1993; the limit is hyperfine's).
fn outliers(values: &[f64]) -> usize {
    const LIMIT: f64 = 14.826;
    let middle = |values: Vec<f64>| Spread::of(values).map_or(0.0, |spread| spread.median);
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
    Spread::of(ratios).map(|spread| spread.median)
}

/// The processor's name, where the system tells it.
fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    field(&text, "model name").unwrap_or_else(|| "unknown processor".into())
}

/// What the kernels make use of, where there is a choice.
fn instructions() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        return " with AVX2 and FMA";
    }
    ""
}

/// From here on [`peak_memory`] counts anew, where the system can do that (Linux).
fn forget_peak_memory() {
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// The most memory that this process has had, where the system tells it.
fn peak_memory() -> String {
    let text = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kibibytes = field(&text, "VmHWM")
        .and_then(|field| field.split_whitespace().next()?.parse::<f64>().ok());
    kibibytes.map_or_else(|| "–".into(), |kib| format!("{:.0} MB", kib * 1.024e-3))
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
            let mut pair = PairResult::failed(a, a + 1, matchbench::metrics::Failure::NoSupport);
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
        // Equal times: a tenth of a millisecond more is nothing.
        assert_eq!(outliers(&[0.1, 0.1, 0.1, 0.1001]), 0);
        assert_eq!(outliers(&[]), 0);
    }
}
