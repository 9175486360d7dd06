//! Runs as several commands execute them: with a progress bar, and stopped by Ctrl-C.

use std::mem;
use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use matchbench::cache::FeatureCache;
use matchbench::config::{Changes, ConfigError, UnknownName};
use matchbench::counted::counted;
use matchbench::external::Manifest;
use matchbench::matchers;
use matchbench::records::{RunFolder, kept_otherwise, stranger_in};
use matchbench::run::{Cancel, Dataset, Run, RunSummary};
use matchbench::study::{News, Prepared, Study, StudyDataset};

use super::matches::{asked, describe};
use crate::Ending;
use crate::args::{ChoiceArgs, MatchesArgs};
use crate::output::say;
use crate::progress::Progress;
use crate::stop::Stop;

/// Printed when Ctrl-C stops a run.
pub(crate) const AFTER_PAIRS: &str = "stopping after the pairs in flight; again to stop at once";

/// Runs what is left of a study, until it is complete or stopped, and prints how it ended. Returns that, and
/// the folder of its run.
pub(crate) fn execute(study: &Study) -> Result<(Ending, PathBuf)> {
    let (ending, prepared) = execute_until(study, &Stop::on_ctrl_c(AFTER_PAIRS)?)?;
    Ok((ending, prepared.folder))
}

/// The same if Ctrl-C is handled already; returns what was run.
pub(crate) fn execute_until(study: &Study, stop: &Stop) -> Result<(Ending, Prepared)> {
    let prepared = study.prepare(&tell_news)?;
    for error in &prepared.absent {
        say!("error: {error}");
    }
    if let Some(stranger) = stranger_in(&prepared.folder) {
        say!(
            "note: {} is not of a run; this one is written beside it (plan.json, records ...). For a folder of its own stop \
             it and give another --out",
            stranger.display()
        );
    }
    let ran = execute_run(&prepared.run(), stop);
    let ran = ran.map_err(|error| match prepared.absent.first() {
        // A plan that misses a matcher, for example.
        Some(absent) => error.context(format!("after a matcher did not start ({absent})")),
        None => error,
    });
    let ending = match ran? {
        Ending::Done if !prepared.absent.is_empty() => Ending::SomeFailed,
        ending => ending,
    };
    Ok((ending, prepared))
}

/// Runs what is left of a run, until it is complete or stopped, and prints how it ended.
pub(crate) fn execute_run(run: &Run<'_>, stop: &Stop) -> Result<Ending> {
    let cancel = stop.begin();
    let bar = Progress::new();
    let summary = run.execute(&bar, cancel);
    stop.end();
    bar.finish();
    let ending = tell(&summary?, run.folder, cancel);
    for kept in kept_otherwise(run.folder, run.keep_matches) {
        say!(
            "note: {} was kept by an earlier start; this one has another --keep-matches, so it has added nothing there, and \
             deleted nothing: delete it if you do not need it",
            kept.display()
        );
    }
    Ok(ending)
}

/// Prints the events while a study is prepared.
pub(crate) fn tell_news(news: News<'_>) {
    match news {
        News::Imported(folder, report) => {
            let images = counted(report.frames, "image");
            let pairs = counted(report.pairs, "pair");
            say!("{}: {images}, {pairs}", folder.display());
            for note in &report.notes {
                say!("  note: {note}");
            }
        }
        News::Problem(problem) => say!(
            "warning: {}; `matchbench validate` says more",
            problem.error
        ),
        News::Matches(name, source) => describe(name, source),
    }
}

/// Opens dataset folders.
pub(crate) fn open(folders: &[impl AsRef<Path>]) -> Result<Vec<Dataset>> {
    let datasets = folders.iter().map(|folder| Dataset::open(folder.as_ref()));
    Ok(datasets.collect::<Result<_, _>>()?)
}

/// The study in a run file, if `datasets` is one; else that of these datasets.
pub(crate) fn named(datasets: &[PathBuf]) -> Result<Study> {
    if let [file] = datasets
        && Study::is_file(file)
    {
        return Ok(Study::read(file)?);
    }
    ensure!(
        !datasets.iter().any(|path| Study::is_file(path)),
        "a run file stands alone; name datasets in it, or leave it out"
    );
    Ok(Study {
        datasets: datasets.iter().map(StudyDataset::at).collect(),
        ..Study::default()
    })
}

/// Replaces what `study` has by what is given as arguments.
pub(crate) fn replace(
    study: &mut Study,
    matchers: &[String],
    choices: &ChoiceArgs,
    files: &MatchesArgs,
) -> Result<()> {
    if !matchers.is_empty() {
        study.matchers = matchers.to_vec();
        for dataset in &mut study.datasets {
            dataset.matchers = None;
        }
    }
    choose(study, choices)?;
    let matches = asked(files)?;
    let is_replaced = |name: &str| matches.iter().any(|from| from.name == name);
    study.matches.retain(|from| !is_replaced(&from.name));
    study.matches.extend(matches);
    Ok(())
}

/// Replaces settings of `study` by those that are given as arguments.
fn choose(study: &mut Study, choices: &ChoiceArgs) -> Result<()> {
    if !choices.estimator.is_empty() {
        study.estimators.clone_from(&choices.estimator);
    }
    if !choices.protocol.is_empty() {
        study.protocols.clone_from(&choices.protocol);
    }
    study.limit = choices.limit.or(study.limit);
    study.seed = choices.seed.unwrap_or(study.seed);
    study.repeat = choices.repeat.or(study.repeat);
    study.time_budget = choices.time_budget.or(study.time_budget);
    study.set = mem::take(&mut study.set).with(changes(&choices.set)?);
    study.tuned.extend(choices.tuned.iter().cloned());
    study.keep_matches = choices.kept().unwrap_or(study.keep_matches);
    Ok(())
}

/// The changes of parameters by `--set`.
pub(crate) fn changes(settings: &[String]) -> Result<Changes, ConfigError> {
    Changes::parse(settings)
}

/// Refuses an unknown name of a matcher, before anything is opened.
pub(crate) fn check_names(names: &[String]) -> Result<(), UnknownName> {
    let native = |name: &&String| *name != "all" && !Manifest::is_path(name);
    (names.iter().filter(native)).try_for_each(|name| matchers::find(name).map(drop))
}

/// The feature cache that was asked for, or that of a run in this folder.
pub(crate) fn cache(asked: Option<&Path>, folder: &Path) -> FeatureCache {
    let default = || RunFolder::default_cache_at(folder);
    FeatureCache::new(asked.map_or_else(default, Path::to_path_buf))
}

/// Reasons of failures that are printed.
const REASONS: usize = 5;

/// Letters of a reason that are printed.
const REASON_LETTERS: usize = 300;

/// Prints the most frequent reasons why tasks of the run in this folder broke.
pub(super) fn tell_reasons(folder: &Path) {
    // How the run ended is known without them.
    let broken = RunFolder::open(folder)
        .ok()
        .and_then(|run| run.broken().ok());
    let mut broken = broken.unwrap_or_default();
    let others = broken.split_off(REASONS.min(broken.len())).len();
    for mut broken in broken {
        broken.reason = broken.reason.chars().take(REASON_LETTERS).collect();
        say!("  {broken}");
    }
    if others > 0 {
        say!(
            "  and {} (\"kind\":\"failed\" in records)",
            counted(others, "other reason")
        );
    }
}

/// Prints how a run ended, which the user may have stopped.
pub(crate) fn tell(summary: &RunSummary, folder: &Path, cancel: &Cancel) -> Ending {
    if summary.unkept > 0 {
        let files = counted(summary.unkept, "file");
        say!("not kept in the cache of features: {files}");
    }
    if summary.ended > 0 && !cancel.is_set() {
        let done = summary.before + summary.now;
        say!(
            "{done} of {} done; the same command tries the rest again",
            counted(summary.total, "task")
        );
        return Ending::Unfinished;
    }
    if !summary.is_complete() {
        let done = summary.before + summary.now;
        let lost = match summary.lost {
            0 => String::new(),
            lost => format!(
                ", before the lost matches of {} were made again",
                counted(lost, "pair")
            ),
        };
        say!(
            "stopped after {done} of {}{lost}; the same command goes on from there",
            counted(summary.total, "task")
        );
        return Ending::Stopped;
    }
    let before = match summary.before {
        0 => String::new(),
        before => format!(", {before} of them earlier"),
    };
    say!(
        "{} done{before}; records in {}",
        counted(summary.total, "task"),
        folder.display()
    );
    if summary.failed > 0 {
        say!(
            "{} FAILED, counted as wrong. What was a file or a program outside is tried again at the next start, the \
             rest with --retry-failed",
            counted(summary.failed, "task")
        );
        tell_reasons(folder);
        return Ending::SomeFailed;
    }
    Ending::Done
}
