//! `matchbench convert`: a dataset in the layout of another tool.

use std::io::Write;

use anyhow::Result;
use matchbench::counted::counted;
use matchbench::datasets::{Export, Sequence, export};

use crate::Ending;
use crate::args::ConvertArgs;
use crate::output::{stdout, typed};

pub(crate) fn run(args: &ConvertArgs) -> Result<Ending> {
    let sequence = Sequence::open(&args.dataset)?;
    let layout = Export::find(&args.format)?;
    let root = export(layout.id, &sequence, &args.out)?;
    let mut out = stdout();
    writeln!(
        out,
        "{}: {}, {}; image names start from {}\nTo import it again: matchbench import {} {} NAME --image-root {}{}",
        args.out.display(),
        counted(layout.frames(&sequence), "frame"),
        counted(sequence.pairs.len(), "pair"),
        root.display(),
        args.format,
        typed(&args.out),
        typed(&root),
        layout.pairs.map_or_else(String::new, |file| format!(
            " --pairs list:{}",
            typed(&args.out.join(file))
        ))
    )?;
    let lost = layout.leaves_out(&sequence);
    if !lost.is_empty() {
        writeln!(
            out,
            "Left out, since the layout has no place for it: {}",
            lost.join(", ")
        )?;
    }
    Ok(Ending::Done)
}
