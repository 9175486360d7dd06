//! `matchbench demo`: runs quick matchers on the built-in scenes and writes a report, within a minute. Poses
//! are one run; homographies, on the scenes that are planes, are a run of their own.

use std::env;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use matchbench::datasets::{DatasetError, Sequence, rendered};
use matchbench::files::temporary_files;
use matchbench::report::ReportOptions;
use matchbench::study::{Study, StudyDataset};

use super::job::{AFTER_PAIRS, execute_until};
use super::{eval, report};
use crate::Ending;
use crate::args::DemoArgs;
use crate::output::stdout;
use crate::stop::Stop;

pub(crate) fn run(args: &DemoArgs) -> Result<Ending> {
    // Checked before minutes are spent on images.
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot make the folder {}", args.out.display()))?;
    let (plane, others): (Vec<_>, Vec<_>) =
        scenes()?.into_iter().partition(|(_, is_plane)| *is_plane);
    let study = |scenes: Vec<(PathBuf, bool)>, estimators: &[&str], out: PathBuf| Study {
        datasets: (scenes.into_iter())
            .map(|(folder, _)| StudyDataset::at(folder))
            .collect(),
        matchers: args.matchers.clone(),
        estimators: estimators.iter().map(ToString::to_string).collect(),
        out: Some(out),
        ..Study::default()
    };
    let homographies = args.out.join("homographies");
    let studies = [
        study(others, &[], args.out.clone()),
        study(plane, &["ransac-h", "best-h"], homographies.clone()),
    ];
    let stop = Stop::on_ctrl_c(AFTER_PAIRS)?;
    let mut ending = Ending::Done;
    for study in &studies {
        match execute_until(study, &stop)?.0 {
            Ending::Stopped => return Ok(Ending::Stopped),
            Ending::Done => {}
            failed @ (Ending::SomeFailed | Ending::Unfinished) => ending = failed,
        }
    }
    let printed = eval::print(&args.out).and_then(|()| {
        writeln!(stdout(), "\nPlane scenes, by homographies:\n")?;
        eval::print(&homographies)
    });
    // Written even if the table could not be printed: a closed pipe, a full disk.
    let write = |run| report::write(run, &ReportOptions::default());
    let pages = [write(&args.out)?, write(&homographies)?];
    ending.after(printed.and_then(|()| tell(&pages)))
}

/// Prints where the pages are, and what to do next.
fn tell(pages: &[PathBuf; 2]) -> Result<()> {
    let mut out = stdout();
    writeln!(
        out,
        "\nThese scenes are rendered: a test of the tool, no substitute for your own images."
    )?;
    writeln!(out, "Next: matchbench import --help")?;
    for (page, what) in pages.iter().zip(["", " (homographies)"]) {
        writeln!(out, "Open {}{what}", std::path::absolute(page)?.display())?;
    }
    Ok(())
}

/// The folders of the built-in scenes, and whether each scene is a plane. Scenes are rendered the first time.
fn scenes() -> Result<Vec<(PathBuf, bool)>> {
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
    let folders = folders?;
    folders.iter().try_for_each(|folder| check(folder))?;
    let plane = (rendered::scenes().iter()).map(|scene| scene.homography(0, 1).is_some());
    Ok(folders.into_iter().zip(plane).collect())
}

/// Whether the dataset in a folder of the cache can be opened. Nobody wrote it by hand, so there is nothing to correct.
fn check(folder: &Path) -> Result<(), DatasetError> {
    let damaged = |error| DatasetError {
        remedy: format!(
            "the cache is damaged: delete the folder {}, and the scene is rendered again",
            folder.display()
        ),
        ..error
    };
    Sequence::open(folder).map(drop).map_err(damaged)
}

/// The folder for data that are kept between runs: `MATCHBENCH_CACHE`, else the cache folder of the user.
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
        .unwrap_or_else(|| temporary_files().join("matchbench"))
}
