//! `matchbench convert`: a dataset in the layout of another tool.

use std::io::Write;

use anyhow::Result;
use matchbench::counted::counted;
use matchbench::datasets::{EXPORTS, Sequence, export, not_exported};

use crate::Ending;
use crate::args::ConvertArgs;
use crate::output::{stdout, typed};

pub(crate) fn run(args: &ConvertArgs) -> Result<Ending> {
    let sequence = Sequence::open(&args.dataset)?;
    let root = export(&args.format, &sequence, &args.out)?;
    let layout = EXPORTS.iter().find(|layout| layout.id == args.format);
    let pairs = layout.and_then(|layout| layout.pairs);
    let mut out = stdout();
    writeln!(
        out,
        "{}: {}, {}; image names start from {}\nTo import it again: matchbench import {} {} NAME --image-root {}{}",
        args.out.display(),
        counted(sequence.frames.len(), "frame"),
        counted(sequence.pairs.len(), "pair"),
        root.display(),
        args.format,
        typed(&args.out),
        typed(&root),
        pairs.map_or_else(String::new, |file| format!(
            " --pairs list:{}",
            typed(&args.out.join(file))
        ))
    )?;
    let lost = not_exported(&sequence);
    if !lost.is_empty() {
        writeln!(
            out,
            "Left out, since the layout has no place for it: {}",
            lost.join(", ")
        )?;
    }
    Ok(Ending::Done)
}
