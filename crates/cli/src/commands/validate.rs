//! `matchbench validate`: prints every problem of a dataset, by file and line, with its remedy. For a valid
//! dataset it prints the fingerprint, by which plans and reports identify it.

use std::collections::BTreeMap;
use std::io::Write;

use anyhow::Result;
use matchbench::counted::counted;
use matchbench::datasets::{Problem, Sequence, Severity, validate};

use crate::Ending;
use crate::args::ValidateArgs;
use crate::output::{plain, say, stdout};

/// Problems that are printed of those that say the same of many files or lines.
const OF_A_KIND: usize = 10;

pub(crate) fn run(args: &ValidateArgs) -> Result<Ending> {
    let problems = validate(&args.dataset);
    let mut out = stdout();
    let most = if args.all { usize::MAX } else { OF_A_KIND };
    // Those that differ in numbers alone (of frames, sizes) say the same.
    let mut kinds = BTreeMap::<_, (usize, &Problem)>::new();
    for problem in &problems {
        let without_numbers = problem.error.what.replace(|c: char| c.is_ascii_digit(), "");
        let kind = (problem.severity, without_numbers, &problem.error.remedy);
        let (count, _) = kinds.entry(kind).or_insert((0, problem));
        *count += 1;
        if *count <= most {
            writeln!(out, "{}", plain(&problem.to_string()))?;
        }
    }
    for (count, first) in kinds.into_values().filter(|(count, _)| *count > most) {
        let more = counted(count - most, &format!("more {}", first.severity));
        let what = plain(&first.error.what);
        writeln!(out, "and {more} of the kind: {what} (--all names each)")?;
    }
    let errors = problems
        .iter()
        .filter(|p| p.severity == Severity::Error)
        .count();
    let warnings = problems.len() - errors;
    writeln!(
        out,
        "{}: {}, {}",
        args.dataset.display(),
        counted(errors, "error"),
        counted(warnings, "warning")
    )?;
    if errors > 0 {
        say!("{} cannot be used as it is", args.dataset.display());
        return Ok(Ending::SomeFailed);
    }
    let fingerprint = Sequence::open(&args.dataset)?.fingerprint();
    writeln!(out, "fingerprint {fingerprint}")?;
    Ok(Ending::Done)
}
