//! `matchbench merge`: all shards of a plan become one run.

use std::io::Write;

use anyhow::Result;
use matchbench::records::ShardPlan;
use matchbench::records::shards::merge;

use crate::Ending;
use crate::args::MergeArgs;
use crate::output::{say, stdout};

pub(crate) fn run(args: &MergeArgs) -> Result<Ending> {
    let home = ShardPlan::folder(&args.plan);
    let plan = ShardPlan::open(&home)?;
    let merged = merge(&plan, &home, &args.copies, &args.out)?;
    say!(
        "{} tasks of {} shards; records in {}",
        merged.tasks,
        plan.shards(),
        args.out.display()
    );
    writeln!(stdout(), "Next: matchbench eval {}", args.out.display())?;
    if merged.failed > 0 {
        say!(
            "{} tasks FAILED and count as wrong; their records say why (\"kind\":\"failed\")",
            merged.failed
        );
        return Ok(Ending::SomeFailed);
    }
    Ok(Ending::Done)
}
