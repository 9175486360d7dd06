//! A run as it is asked for on the command line: with a progress bar, stopped by Ctrl-C.

use std::path::Path;

use anyhow::{Result, ensure};
use matchbench::cache::FeatureCache;
use matchbench::config::{Changes, ConfigError, UnknownName};
use matchbench::external::Manifest;
use matchbench::matchers::{self, BuiltPointSource};
use matchbench::records::{RunFolder, Settings, Tuned};
use matchbench::run::{Contender, Dataset, Outside, Run, RunSummary};

use crate::Ending;
use crate::output::say;
use crate::progress::{Bar, cancel_on_ctrl_c};

/// Said when Ctrl-C stops a run.
pub(crate) const AFTER_PAIRS: &str = "stopping after the pairs in flight; again to stop at once";

/// What is run, and where.
pub(crate) struct Job<'a> {
    pub(crate) datasets: &'a [Dataset],
    pub(crate) contenders: &'a [Contender],
    pub(crate) settings: Settings,
    pub(crate) tuned: &'a [Tuned],
    pub(crate) folder: &'a Path,
    pub(crate) cache: Option<&'a Path>,
    pub(crate) keep_matches: bool,
    pub(crate) retry_failed: bool,
}

impl Job<'_> {
    /// Does what is left, until it is done or stopped, and says how it ended.
    pub(crate) fn execute(&self) -> Result<Ending> {
        let run = Run {
            settings: self.settings,
            tuned: self.tuned,
            cache: cache(self.cache, self.folder),
            keep_matches: self.keep_matches,
            retry_failed: self.retry_failed,
            ..Run::new(self.datasets, self.contenders, self.folder)
        };
        let cancel = cancel_on_ctrl_c(AFTER_PAIRS)?;
        let bar = Bar::new();
        let summary = run.execute(&bar, &cancel);
        bar.finish();
        Ok(tell(&summary?, self.folder))
    }
}

/// Opens dataset folders.
pub(crate) fn open(folders: &[impl AsRef<Path>]) -> Result<Vec<Dataset>> {
    let datasets = folders.iter().map(|folder| Dataset::open(folder.as_ref()));
    Ok(datasets.collect::<Result<_, _>>()?)
}

/// What `--set` changes.
pub(crate) fn changes(settings: &[String]) -> Result<Changes, ConfigError> {
    Changes::parse(settings)
}

/// Refuses the name of a matcher that there is not, before anything is opened.
pub(crate) fn check_names(names: &[String]) -> Result<(), UnknownName> {
    let native = |name: &&String| *name != "all" && !Manifest::is_path(name);
    (names.iter().filter(native)).try_for_each(|name| matchers::find(name).map(drop))
}

/// The feature cache that is asked for, or that of a run in this folder.
pub(crate) fn cache(asked: Option<&Path>, folder: &Path) -> FeatureCache {
    let default = || RunFolder::default_cache_at(folder);
    FeatureCache::new(asked.map_or_else(default, Path::to_path_buf))
}

/// The contenders of these names, manifests of matchers from outside among them, for a run in `folder`;
/// and whether all could be started.
pub(crate) fn contenders(
    names: &[String],
    sources: Vec<BuiltPointSource>,
    estimators: &[String],
    changes: &Changes,
    folder: &Path,
    cache: &FeatureCache,
) -> Result<(Vec<Contender>, bool)> {
    let outside = Outside {
        logs: &folder.join("logs"),
        cache,
    };
    let (contenders, absent) =
        Contender::from_names(names, sources, estimators, changes, Some(&outside))?;
    for error in &absent {
        say!("error: {error}");
    }
    ensure!(!contenders.is_empty(), "no matcher could be started");
    Ok((contenders, absent.is_empty()))
}

/// Says how a run ended.
pub(crate) fn tell(summary: &RunSummary, folder: &Path) -> Ending {
    if summary.ended > 0 {
        let done = summary.before + summary.now;
        say!(
            "{done} of {} tasks done; the same command tries the rest again",
            summary.total
        );
        return Ending::SomeFailed;
    }
    if !summary.is_complete() {
        let done = summary.before + summary.now;
        say!(
            "stopped after {done} of {} tasks; the same command goes on from there",
            summary.total
        );
        return Ending::Stopped;
    }
    let before = match summary.before {
        0 => String::new(),
        before => format!(", {before} of them earlier"),
    };
    say!(
        "{} tasks done{before}; records in {}",
        summary.total,
        folder.display()
    );
    if summary.failed > 0 {
        say!(
            "{} tasks FAILED and count as wrong; their records say why (\"kind\":\"failed\"). What was \
             a file or a program outside is tried again at the next start, the rest with --retry-failed",
            summary.failed
        );
        return Ending::SomeFailed;
    }
    Ending::Done
}
