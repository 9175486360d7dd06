//! `matchbench convert`: a dataset in the layout of another tool.

use std::io::Write;

use anyhow::Result;
use matchbench::datasets::{Sequence, export};

use crate::Ending;
use crate::args::ConvertArgs;
use crate::output::stdout;

pub(crate) fn run(args: &ConvertArgs) -> Result<Ending> {
    let sequence = Sequence::open(&args.dataset)?;
    let root = export(&args.format, &sequence, &args.out)?;
    writeln!(
        stdout(),
        "{}: {} frames, {} pairs; image names start from {}",
        args.out.display(),
        sequence.frames.len(),
        sequence.pairs.len(),
        root.display()
    )?;
    Ok(Ending::Done)
}
