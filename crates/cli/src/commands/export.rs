//! `matchbench export`: a run in the layout of the paper's authors.

use std::io::Write;

use anyhow::{Result, ensure};
use matchbench::records::{RunFolder, authors};

use crate::Ending;
use crate::args::ExportArgs;

pub(crate) fn run(args: &ExportArgs) -> Result<Ending> {
    let records = RunFolder::open(&args.run)?.records()?;
    ensure!(
        !records.is_empty(),
        "{} holds no records yet",
        args.run.display()
    );
    for file in authors::write(&args.out, &records)? {
        writeln!(std::io::stdout(), "{}", file.display())?;
    }
    Ok(Ending::Done)
}
