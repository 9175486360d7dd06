//! `matchbench convert`: a dataset in the layout of another tool.

use std::io::Write;

use anyhow::Result;
use matchbench::counted::counted;
use matchbench::datasets::{Sequence, export};

use crate::Ending;
use crate::args::ConvertArgs;
use crate::output::{stdout, typed};

pub(crate) fn run(args: &ConvertArgs) -> Result<Ending> {
    let sequence = Sequence::open(&args.dataset)?;
    let root = export(&args.format, &sequence, &args.out)?;
    writeln!(
        stdout(),
        "{}: {}, {}; image names start from {}\nTo import it again: matchbench import {} {} NAME --image-root {}{}",
        args.out.display(),
        counted(sequence.frames.len(), "frame"),
        counted(sequence.pairs.len(), "pair"),
        root.display(),
        args.format,
        typed(&args.out),
        typed(&root),
        match &*args.format {
            "colmap" => format!(" --pairs list:{}", typed(&args.out.join("pairs.txt"))),
            _ => String::new(),
        }
    )?;
    Ok(Ending::Done)
}
