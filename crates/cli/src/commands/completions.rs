//! `matchbench completions`: prints the completion script for a shell to standard output.

use std::path::Path;

use anyhow::Result;
use clap::CommandFactory;

use crate::Ending;
use crate::args::{Cli, CompletionsArgs};
use crate::output::write_result;

pub(crate) fn run(args: &CompletionsArgs) -> Result<Ending> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "matchbench", &mut script);
    write_result(Path::new("-"), &script)?;
    Ok(Ending::Done)
}
