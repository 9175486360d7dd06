//! `matchbench merge`: merges all shards of a plan into one run.

use std::io::Write;

use anyhow::{Result, ensure};
use matchbench::counted::counted;
use matchbench::datasets::is_dataset;
use matchbench::records::shards::merge;
use matchbench::records::{RunFolder, ShardPlan};

use super::job::tell_reasons;
use crate::Ending;
use crate::args::MergeArgs;
use crate::output::{say, stdout, typed};

pub(crate) fn run(args: &MergeArgs) -> Result<Ending> {
    let home = ShardPlan::folder(&args.plan);
    let plan = ShardPlan::open(&home)?;
    ensure!(
        !is_dataset(&args.out) || RunFolder::is_at(&args.out),
        "{} is a dataset, and a run needs a folder of its own; choose another",
        args.out.display()
    );
    let merged = merge(&plan, &home, &args.copies, &args.out)?;
    say!(
        "{} of {}; records in {}",
        counted(merged.tasks, "task"),
        counted(plan.shards(), "shard"),
        args.out.display()
    );
    let printed = writeln!(stdout(), "Next: matchbench eval {}", typed(&args.out));
    let mut ending = Ending::Done;
    if merged.failed > 0 {
        say!(
            "{} FAILED, counted as wrong",
            counted(merged.failed, "task")
        );
        tell_reasons(&args.out);
        ending = Ending::SomeFailed;
    }
    ending.after(printed)
}
