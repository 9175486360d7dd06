//! `matchbench demo`: quick matchers on the built-in scenes, and a report within a minute.

use std::env;
use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use matchbench::datasets::rendered;
use matchbench::report::ReportOptions;
use matchbench::study::{Study, StudyDataset};

use super::job::execute;
use super::{eval, report};
use crate::Ending;
use crate::args::DemoArgs;
use crate::output::stdout;

pub(crate) fn run(args: &DemoArgs) -> Result<Ending> {
    // Before minutes are spent on images.
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot make the folder {}", args.out.display()))?;
    let (ending, _) = execute(&Study {
        datasets: scenes()?.into_iter().map(StudyDataset::at).collect(),
        matchers: args.matchers.clone(),
        out: Some(args.out.clone()),
        ..Study::default()
    })?;
    if ending == Ending::Stopped {
        return Ok(ending);
    }
    let printed = eval::print(&args.out);
    // Also where the table found no reader: a closed pipe, a full disk.
    let page = report::write(&args.out, &ReportOptions::default())?;
    printed?;
    let page = std::path::absolute(page)?;
    let mut out = stdout();
    writeln!(
        out,
        "\nThese scenes are rendered: a test of the tool, no substitute for your own images."
    )?;
    writeln!(out, "Next: matchbench import --help")?;
    writeln!(out, "Open {}", page.display())?;
    Ok(ending)
}

/// The folders of the built-in scenes, rendered if this is the first time.
fn scenes() -> Result<Vec<PathBuf>> {
    let cache = cache_folder().join("scenes");
    let bar = ProgressBar::new(0);
    let style = "rendering the built-in scenes  {bar:30} {pos}/{len} images  {eta} left";
    bar.set_style(ProgressStyle::with_template(style).expect("the template is a constant"));
    let folders = rendered::ensure(&cache, &|progress: rendered::Progress| {
        bar.set_length(progress.total.into());
        bar.set_position(progress.done.into());
    })
    .context("set MATCHBENCH_CACHE to a folder that can be written to");
    bar.finish_and_clear();
    folders
}

/// Where things are kept between runs: `MATCHBENCH_CACHE`, else the user's cache folder.
fn cache_folder() -> PathBuf {
    let variable = |name| {
        env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    variable("MATCHBENCH_CACHE")
        .or_else(|| variable("XDG_CACHE_HOME").map(|folder| folder.join("matchbench")))
        .or_else(|| variable("HOME").map(|home| home.join(".cache/matchbench")))
        .or_else(|| variable("LOCALAPPDATA").map(|folder| folder.join("matchbench/cache")))
        .unwrap_or_else(|| env::temp_dir().join("matchbench"))
}
