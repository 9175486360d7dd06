//! `matchbench merge`: merges all shards of a plan into one run.

use std::io::Write;

use anyhow::Result;
use matchbench::counted::counted;
use matchbench::records::ShardPlan;
use matchbench::records::shards::merge;
use matchbench::run::refuse_dataset;

use super::job::tell_reasons;
use crate::Ending;
use crate::args::MergeArgs;
use crate::output::{say, stdout, typed};

pub(crate) fn run(args: &MergeArgs) -> Result<Ending> {
    let home = ShardPlan::folder(&args.plan);
    let plan = ShardPlan::open(&home)?;
    refuse_dataset(&args.out)?;
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
