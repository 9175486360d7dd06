//! `matchbench man`: writes the manual pages, one for the program and one for each command.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use clap::CommandFactory;
use clap_mangen::Man;

use crate::Ending;
use crate::args::{Cli, ManArgs};
use crate::output::write_result;

pub(crate) fn run(args: &ManArgs) -> Result<Ending> {
    match &args.out {
        None => {
            let mut page = Vec::new();
            Man::new(Cli::command()).render(&mut page)?;
            write_result(Path::new("-"), &page)?;
        }
        Some(folder) => fs::create_dir_all(folder)
            .and_then(|()| clap_mangen::generate_to(Cli::command(), folder))
            .with_context(|| format!("{}: cannot be written", folder.display()))?,
    }
    Ok(Ending::Done)
}
