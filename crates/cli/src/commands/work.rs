//! `matchbench work`: one shard of a plan.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use matchbench::protocols;
use matchbench::records::ShardPlan;
use matchbench::run::{Contender, Dataset, Outside, Run, Shard};

use super::job::{AFTER_PAIRS, cache, changes, execute_run, open};
use crate::Ending;
use crate::args::WorkArgs;
use crate::progress::cancel_on_ctrl_c;

pub(crate) fn run(args: &WorkArgs) -> Result<Ending> {
    let home = ShardPlan::folder(&args.plan);
    let plan = ShardPlan::open(&home)?;
    plan.shard(args.shard)?;
    let datasets = datasets(args, &plan)?;
    let folder = (args.out.clone()).unwrap_or_else(|| ShardPlan::shard_folder(&home, args.shard));
    let features = (args.cache.clone()).unwrap_or_else(|| ShardPlan::default_cache(&home));
    let asked = plan.asked();
    let cache = cache(Some(&features), &folder);
    let outside = Outside {
        logs: &folder.join("logs"),
        cache: &cache,
    };
    let changes = changes(&asked.settings)?;
    let protocols = protocols::find_all(&asked.protocols)?;
    let (matchers, estimators) = (&asked.matchers, &asked.estimators);
    let (contenders, absent) = Contender::from_names(
        matchers,
        Vec::new(),
        estimators,
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
        shard: Some(Shard {
            plan: &plan,
            number: args.shard,
        }),
        ..Run::new(&datasets, &contenders, &folder)
    };
    execute_run(&run, &cancel_on_ctrl_c(AFTER_PAIRS)?)
}

/// The datasets of the plan, in its order, where they are on this machine.
fn datasets(args: &WorkArgs, plan: &ShardPlan) -> Result<Vec<Dataset>> {
    let planned = &plan.plan().datasets;
    if args.data.is_empty() {
        let folders: Vec<PathBuf> = planned.iter().map(|dataset| dataset.path.clone()).collect();
        return open(&folders)
            .context("the datasets are not where they were planned; say where with --data");
    }
    let mut given = open(&args.data)?;
    let mut datasets = Vec::new();
    for dataset in planned {
        let index = (given.iter()).position(|given| given.sequence.name == dataset.name);
        let index = index.with_context(|| {
            format!(
                "--data names no dataset called {}, which the plan has",
                dataset.name
            )
        })?;
        datasets.push(given.swap_remove(index));
    }
    ensure!(
        given.is_empty(),
        "--data names {}, which the plan does not have",
        given[0].sequence.name
    );
    Ok(datasets)
}
