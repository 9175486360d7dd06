//! `matchbench completions`: prints the completion script for a shell to standard output.

use std::io::Write;

use anyhow::Result;
use clap::CommandFactory;

use crate::Ending;
use crate::args::{Cli, CompletionsArgs};

pub(crate) fn run(args: &CompletionsArgs) -> Result<Ending> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "matchbench", &mut script);
    std::io::stdout().write_all(&script)?;
    Ok(Ending::Done)
}
