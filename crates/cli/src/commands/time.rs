//! `matchbench time`: how long matchers take, by the paper's protocol.
//!
//! The first pairs of one dataset, one thread, no cache, wall clock: detection and description once
//! for an image, search and selection once for a pair. Each matcher runs in a folder of its own
//! that is thrown away; a few pairs are run before, to warm up, and again at the end: if the same
//! work then takes another time, the machine was not quiet, and a warning says so.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::thread::available_parallelism;

use anyhow::{Context, Result};
use matchbench::metrics::{PairResult, ResultSet, Spread, StageSpreads, load};
use matchbench::run::{Contender, Dataset, Settings};

use super::run::{Job, open};
use crate::Ending;
use crate::args::TimeArgs;
use crate::contenders::contenders;

/// Pairs that are run to warm up, and again at the end.
const PROBES: usize = 5;
/// The same work may take this much more or less time before the machine counts as noisy.
const NOISE: f64 = 0.1;

pub(crate) fn run(args: &TimeArgs) -> Result<Ending> {
    let datasets = open(&[&args.dataset])?;
    let contenders = contenders(&args.matchers, &[], &args.set)?;
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "matchbench {}, {} {}, {}, {} cores; 1 thread, no cache; first {} pairs of {}",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH,
        processor(),
        available_parallelism().map_or(1, usize::from),
        args.pairs.min(datasets[0].sequence.pairs.len()),
        datasets[0].sequence.name
    )?;
    writeln!(
        out,
        "median (quartiles) in milliseconds; detection per image, the rest per pair\n"
    )?;
    writeln!(
        out,
        "{:<14} {:>8}  {:>24}  {:>24}  {:>24}  {:>24}",
        "matcher", "features", "detection", "search", "selection", "pose"
    )?;
    let mut noisy = Vec::new();
    for contender in contenders {
        let one = [contender];
        let id = one[0].matcher.id.clone();
        measure(&datasets, &one, PROBES)?;
        let probe = measure(&datasets, &one, PROBES)?;
        let all = measure(&datasets, &one, args.pairs)?;
        let again = measure(&datasets, &one, PROBES)?;
        let stages = StageSpreads::new(&all.pairs);
        writeln!(
            out,
            "{id:<14} {:>8}  {:>24}  {:>24}  {:>24}  {:>24}",
            stages
                .features
                .map_or_else(|| "–".into(), |s| format!("{:.0}", s.median)),
            shown(stages.extract),
            shown(stages.search),
            shown(stages.select),
            shown(stages.estimate)
        )?;
        if let Some(ratio) = drift(&probe.pairs, &again.pairs).filter(|r| (r - 1.0).abs() > NOISE) {
            noisy.push((id, ratio));
        }
    }
    writeln!(out, "\npeak memory of this process: {}", peak_memory())?;
    for (id, ratio) in &noisy {
        eprintln!(
            "warning: {id}: the same {PROBES} pairs took {ratio:.2} times as long after the \
             measurement as before; the machine was not quiet, measure again without other programs"
        );
    }
    Ok(Ending::Done)
}

/// One run of the first pairs, from nothing.
fn measure(datasets: &[Dataset], contenders: &[Contender], pairs: usize) -> Result<ResultSet> {
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
    job.execute_quietly()?;
    let set = load(folder.path(), None)?.into_iter().next();
    set.context("the run left no records")
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

/// The most memory that this process has had, where the system tells it.
fn peak_memory() -> String {
    let text = fs::read_to_string("/proc/self/status").unwrap_or_default();
    field(&text, "VmHWM").unwrap_or_else(|| "not known on this system".into())
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
}
