//! `matchbench join`: joins runs into one.

use std::io::Write;

use anyhow::Result;
use matchbench::counted::counted;
use matchbench::records::{Joined, join};
use matchbench::report::check_target;

use super::job::tell_reasons;
use crate::Ending;
use crate::args::JoinArgs;
use crate::output::{say, stdout, typed};

pub(crate) fn run(args: &JoinArgs) -> Result<Ending> {
    // Neither inside of a run or a dataset, nor where a dataset is; that a run is there is told by the call.
    check_target(&args.out)?;
    check_target(&args.out.join("dataset.toml"))?;
    let Joined {
        planned,
        recorded,
        failed,
    } = join(&args.runs, &args.out)?;
    let runs = counted(args.runs.len(), "run");
    say!(
        "{} of {runs}; records in {}",
        counted(recorded, "task"),
        args.out.display()
    );
    if recorded < planned {
        say!(
            "{} of {} are missing: the joined run has each matcher with all of its estimators on all of its datasets. Its report \
             names them, and the command that goes on with it",
            planned - recorded,
            counted(planned, "planned task")
        );
    }
    let printed = writeln!(stdout(), "Next: matchbench eval {}", typed(&args.out));
    let mut ending = Ending::Done;
    if failed > 0 {
        say!("{} FAILED, counted as wrong", counted(failed, "task"));
        tell_reasons(&args.out);
        ending = Ending::SomeFailed;
    }
    ending.after(printed)
}
