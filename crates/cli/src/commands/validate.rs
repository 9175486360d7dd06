//! `matchbench validate`: prints every problem of a dataset, by file and line, with its remedy. For a valid
//! dataset it prints the fingerprint, by which plans and reports identify it.

use std::io::Write;

use anyhow::Result;
use matchbench::counted::counted;
use matchbench::datasets::{Sequence, Severity, validate};

use crate::Ending;
use crate::args::ValidateArgs;
use crate::output::{plain, say, stdout};

pub(crate) fn run(args: &ValidateArgs) -> Result<Ending> {
    let problems = validate(&args.dataset);
    let mut out = stdout();
    for problem in &problems {
        let label = match problem.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        writeln!(out, "{label}: {}", plain(&problem.error.to_string()))?;
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
