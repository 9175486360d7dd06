//! `matchbench work`: runs one shard of a plan.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use matchbench::datasets::Unpaired;
use matchbench::protocols;
use matchbench::records::{RunFolder, ShardPlan};
use matchbench::run::{Cancel, Contender, Dataset, Outside, Run, Shard};
use matchbench::study::{MatchesFrom, sources_as_planned};

use super::job::{AFTER_PAIRS, cache, changes, execute_run};
use super::matches::named_files;
use crate::Ending;
use crate::args::WorkArgs;
use crate::stop::Stop;

pub(crate) fn run(args: &WorkArgs) -> Result<Ending> {
    let stop = Stop::on_ctrl_c(AFTER_PAIRS)?;
    let home = ShardPlan::folder(&args.plan);
    let plan = ShardPlan::open(&home)?;
    plan.shard(args.shard)?;
    let shard = Shard {
        plan: &plan,
        number: args.shard,
    };
    let datasets = datasets(args, shard)?;
    let folder = match &args.out {
        Some(folder) => folder.clone(),
        None => ShardPlan::default_shard(&home, args.shard)
            .context("--out names another place for the shard")?,
    };
    let features = match &args.cache {
        Some(cache) => cache.clone(),
        None => {
            ShardPlan::default_cache(&home).context("--cache names another place for features")?
        }
    };
    let asked = plan.asked();
    let sources = sources_as_planned(&matches(args, &plan)?, &datasets, plan.plan())
        .context("matches from files are not as planned; say where they are with --matches")?;
    let cache = cache(Some(&features), &folder);
    let outside = Outside {
        logs: &RunFolder::logs_at(&folder),
        cache: &cache,
        // Nothing is half done yet: the first Ctrl-C ends the process.
        cancel: &Cancel::default(),
    };
    let changes = changes(&asked.settings)?;
    let protocols = protocols::find_all(&asked.protocols)?;
    let (contenders, absent) = Contender::from_names(
        &asked.matchers,
        sources,
        &asked.estimators,
        &protocols,
        &changes,
        Some(&outside),
    )?;
    if let Some(error) = absent.into_iter().next() {
        return Err(error).context("a shard needs every matcher of its plan");
    }
    let run = Run {
        settings: plan.plan().settings,
        tuned: plan.tuned(),
        cache,
        keep_matches: plan.keep_matches(),
        retry_failed: args.retry_failed,
        shard: Some(shard),
        ..Run::new(&datasets, &contenders, &folder)
    };
    execute_run(&run, &stop)
}

/// The datasets of the plan, in its order, at their places on this machine, with the pairs of the shard.
fn datasets(args: &WorkArgs, shard: Shard<'_>) -> Result<Vec<Dataset>> {
    let planned = &shard.plan.plan().datasets;
    let open = |folders: &[PathBuf]| -> Result<Vec<Unpaired>> {
        let opened = folders.iter().map(|folder| Unpaired::open(folder));
        Ok(opened.collect::<Result<_, _>>()?)
    };
    let mut unpaired = Vec::new();
    if args.data.is_empty() {
        let folders: Vec<PathBuf> = planned.iter().map(|dataset| dataset.path.clone()).collect();
        unpaired = open(&folders)
            .context("the datasets are not where they were planned; say where with --data")?;
    } else {
        let mut given = open(&args.data)?;
        for dataset in planned {
            let index = given.iter().position(|given| given.name() == dataset.name);
            let index = index.with_context(|| {
                format!(
                    "--data names no dataset called {}, which the plan has",
                    dataset.name
                )
            })?;
            unpaired.push(given.swap_remove(index));
        }
        ensure!(
            given.is_empty(),
            "--data names {}, which the plan does not have",
            given[0].name()
        );
    }
    let parts = unpaired.into_iter().map(|dataset| shard.part(dataset));
    Ok(parts.collect::<Result<_, _>>()?)
}

/// The planned matches from files, at their places on this machine.
fn matches(args: &WorkArgs, plan: &ShardPlan) -> Result<Vec<MatchesFrom>> {
    let mut planned = plan.asked().matches.clone();
    for moved in &args.matches {
        let (name, files) = named_files(moved)?;
        let from = planned.iter_mut().find(|from| from.name == name);
        let from =
            from.with_context(|| format!("--matches names {name}, which the plan does not have"))?;
        from.files = files;
    }
    Ok(planned)
}
