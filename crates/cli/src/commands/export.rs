//! `matchbench export`: writes the poses of a run in the layout of the paper's authors, or its matches in the
//! formats of other tools.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::iter;
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use matchbench::config::find;
use matchbench::counted::counted;
use matchbench::datasets::Sequence;
use matchbench::exchange::{Export, Format, check_dataset};
use matchbench::metrics::load_run;
use matchbench::protocols;
use matchbench::records::{DatasetPlan, MatcherPlan, Plan, RunFolder, RunRecord, Task, authors};

use super::eval::warn_of_unrecorded;
use crate::Ending;
use crate::args::ExportArgs;
use crate::output::{say, stdout};
use crate::paths;

/// The format for poses; all others are for matches.
const AUTHORS: &str = "authors";

pub(crate) fn run(args: &ExportArgs) -> Result<Ending> {
    let formats: Vec<&str> = (iter::once(AUTHORS))
        .chain(Format::written().map(|format| format.id))
        .collect();
    find("format to write", &formats, |id| id, &args.format)?;
    let run = RunFolder::open(&args.run)?;
    if run.plan().settings.repetitions.get() > 1 {
        say!("note: only the first repetition of each pair is written");
    }
    warn_of_unrecorded(&run, &load_run(&run, None)?)?;
    if args.format == AUTHORS {
        ensure!(
            args.inliers.is_none(),
            "--inliers: the authors' format holds only poses"
        );
        ensure!(
            args.datasets.is_empty(),
            "--datasets: poses are written without the datasets"
        );
        let records = run.records()?;
        ensure!(
            !records.is_empty(),
            "{} holds no records yet",
            args.run.display()
        );
        let methods =
            |task: &Task| [&task.dataset, &task.matcher, &task.estimator].map(String::clone);
        let methods: BTreeSet<_> = records.iter().map(|record| methods(&record.task)).collect();
        let files = authors::write(&args.out, &records)?;
        tell_of_parts(run.plan());
        if files.len() < methods.len() {
            say!(
                "note: the authors' format holds only poses: written for {} of {}, the others estimate homographies",
                files.len(),
                counted(methods.len(), "method")
            );
        }
        for file in files {
            writeln!(stdout(), "{}", file.display())?;
        }
        return Ok(Ending::Done);
    }
    let format = Format::find(&args.format)?;
    let matchers = with_estimator(&run.plan().matchers, args.inliers.as_deref())?;
    let mut moved = moved(&run.plan().datasets, &args.datasets)?;
    let mut any = false;
    for dataset in &run.plan().datasets {
        let sequence = moved.remove(&*dataset.name).map_or_else(
            || {
                Sequence::open(&dataset.path)
                    .context("if the dataset has moved, say where it is with --datasets")
            },
            Ok,
        )?;
        check_dataset(&run, dataset, &sequence)?;
        for matcher in (matchers.iter()).filter(|matcher| dataset.runs(&matcher.id)) {
            any |= write(args, &run, format, (dataset, &sequence), matcher)?;
        }
    }
    ensure!(any, "{} holds nothing to export", args.run.display());
    Ok(Ending::Done)
}

/// Says of which datasets a run has a part of the pairs: whoever scores its poses by all pairs has the others as wrong.
fn tell_of_parts(plan: &Plan) {
    for dataset in &plan.datasets {
        let run = plan.settings.chosen(dataset.pairs).count();
        if run < dataset.pairs {
            say!(
                "note: {run} of {} of {} were run; in files of results the others count as wrong, unless they are left out \
                 (`matchbench eval --pairs list:FILE`)",
                counted(dataset.pairs, "pair"),
                dataset.name
            );
        }
    }
}

/// The datasets in the folders of these lists, by the names that they have in the plan: by the name of the folder, or by
/// its content if that is another name.
fn moved<'a>(planned: &'a [DatasetPlan], lists: &[PathBuf]) -> Result<BTreeMap<&'a str, Sequence>> {
    let mut found = BTreeMap::new();
    for folder in lists.iter().flat_map(|list| paths::between_commas(list)) {
        let sequence = Sequence::open(&folder).context("--datasets")?;
        let fingerprint = sequence.fingerprint();
        let by_name = planned.iter().find(|dataset| dataset.name == sequence.name);
        let by_content = || {
            planned
                .iter()
                .find(|dataset| dataset.fingerprint == fingerprint)
        };
        let dataset = by_name.or_else(by_content).with_context(|| {
            format!(
                "--datasets names {}, which is no dataset of the run, neither by its name nor by its content",
                folder.display()
            )
        })?;
        ensure!(
            found.insert(&*dataset.name, sequence).is_none(),
            "--datasets names {}, and another folder before it for the dataset {}",
            folder.display(),
            dataset.name
        );
    }
    Ok(found)
}

/// The matchers that were run with this estimator, if one is given; prints which are left out.
fn with_estimator<'a>(
    matchers: &'a [MatcherPlan],
    estimator: Option<&str>,
) -> Result<Vec<&'a MatcherPlan>> {
    let Some(estimator) = estimator else {
        return Ok(matchers.iter().collect());
    };
    let (with, without): (Vec<&MatcherPlan>, Vec<&MatcherPlan>) = (matchers.iter())
        .partition(|matcher| matcher.estimators.iter().any(|known| known.id == estimator));
    ensure!(
        !with.is_empty(),
        "no matcher was run with the estimator `{estimator}`"
    );
    for matcher in without {
        say!(
            "note: `{}` was not run with the estimator `{estimator}` and is left out",
            matcher.id
        );
    }
    Ok(with)
}

/// Writes the matches of one matcher on one dataset; `false` if there are none to be written, which is told.
fn write(
    args: &ExportArgs,
    run: &RunFolder,
    format: &Format,
    (dataset, sequence): (&DatasetPlan, &Sequence),
    matcher: &MatcherPlan,
) -> Result<bool> {
    let matches = run.matches_of(&dataset.name, &matcher.id)?;
    let estimator = match &args.inliers {
        None => matcher.estimators.first(),
        Some(id) => matcher.estimators.iter().find(|known| known.id == *id),
    };
    let Some(estimator) = estimator else {
        bail!("`{}` was run without an estimator", matcher.id);
    };
    let mut records = run.records_of(&dataset.name, &matcher.id, &estimator.id)?;
    records.retain(|record| record.task.repetition == 0);
    let left_out = |why: &str| {
        let (matcher, dataset) = (&matcher.id, &dataset.name);
        say!("note: `{matcher}` on `{dataset}` is left out: {why}");
        Ok(false)
    };
    if records.is_empty() {
        return left_out("nothing is recorded yet");
    }
    if args.inliers.is_some() && !records.iter().any(|record| record.outcome.is_estimate()) {
        return left_out("no pair has a pose or homography");
    }
    let protocol = protocols::of_estimator(&estimator.id);
    let export_of = |matches: &_| {
        Export::of_run(sequence, matches, &records, &|cameras, sizes, points| {
            protocol.seen(cameras, sizes, points)
        })
    };
    let mut export = export_of(&matches)?;
    let mut are_inliers = false;
    if args.inliers.is_some() && export.pairs.is_empty() {
        let inliers = run.inliers_of(&dataset.name, &matcher.id, &estimator.id)?;
        export = export_of(&inliers)?;
        are_inliers = true;
    }
    if export.pairs.is_empty() && records.iter().all(|record| record.outcome.has_failed()) {
        return left_out("all pairs failed");
    }
    ensure!(
        !export.pairs.is_empty(),
        "{} holds no matches of `{}` on `{}`; run it with --keep-matches all",
        args.run.display(),
        matcher.id,
        dataset.name
    );
    if !are_inliers {
        let is_missing = |record: &&RunRecord| {
            let Task { a, b, .. } = record.task;
            !record.outcome.has_failed() && !matches.contains((a, b, 0))
        };
        let missing = records.iter().filter(is_missing).count();
        if missing > 0 {
            let missing = counted(missing, "pair");
            say!(
                "warning: the matches of `{}` for {missing} of `{}` are gone and are left out; the command that \
                 made the run makes them again",
                matcher.id,
                dataset.name
            );
        }
    }
    let mut folder = matcher.id.clone();
    if args.inliers.is_some() {
        if !are_inliers {
            export = export.inliers_alone();
        }
        folder = format!("{folder}+{}", estimator.id);
    }
    let folder = args.out.join(folder).join(&dataset.name);
    let files = format.write(&folder, &export)?;
    if format.names_images() {
        let root = export.image_root();
        say!(
            "note: image names of `{}` start from {}",
            dataset.name,
            root.display()
        );
    }
    match &files[..] {
        [] => bail!("there is no match to be written"),
        files if files.len() > 4 => {
            let (count, folder) = (counted(files.len(), "file"), folder.display());
            writeln!(stdout(), "{folder} ({count})")?;
        }
        files => {
            for file in files {
                writeln!(stdout(), "{}", file.display())?;
            }
        }
    }
    Ok(true)
}
