//! `matchbench check`: tries out a matcher from outside.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use matchbench::datasets::Sequence;
use matchbench::external::{self, Log, Verdict};
use matchbench::files::temporary_files;
use matchbench::run::manifest;

use crate::Ending;
use crate::args::CheckArgs;
use crate::commands::job::changes;
use crate::output::stdout;
use crate::stop::end_on_ctrl_c;

pub(crate) fn run(args: &CheckArgs) -> Result<Ending> {
    let changes = changes(&args.set)?;
    let manifest = manifest(&args.manifest, &changes)?;
    if let Some(id) = changes.ids().find(|id| *id != manifest.name) {
        bail!("--set {id}: this manifest is called `{}`", manifest.name);
    }
    let dataset = (args.dataset.as_deref()).map(Sequence::open).transpose()?;
    let log = new_log(&manifest.name)?;
    end_on_ctrl_c()?;
    let mut out = stdout();
    let mut worst = Verdict::Good;
    let mut printed = Ok(());
    external::check(
        manifest,
        Log::open(&log)?,
        dataset.as_ref(),
        &mut |finding| {
            let word = match finding.verdict {
                Verdict::Good => "good     ",
                Verdict::Doubtful => "doubtful ",
                Verdict::Wrong => "WRONG    ",
            };
            worst = worst.max(finding.verdict);
            let line = writeln!(out, "{word} {}", finding.text);
            printed = std::mem::replace(&mut printed, Ok(())).and(line);
        },
    )?;
    let printed = printed.and_then(|()| writeln!(out, "what it printed is in {}", log.display()));
    let ending = match worst {
        Verdict::Wrong => Ending::SomeFailed,
        Verdict::Good | Verdict::Doubtful => Ending::Done,
    };
    ending.after(printed)
}

/// A new file for the output of the matcher. In a folder that everybody may write to, an existing file may
/// belong to another user, or be a link to somebody's file.
fn new_log(matcher: &str) -> Result<PathBuf> {
    let prefix = format!("matchbench-check-{matcher}-");
    let folder = temporary_files();
    // A log is not opened in a folder that is a link; this link is the user's own.
    let file = fs::canonicalize(&folder).and_then(|folder| {
        let mut file = tempfile::Builder::new();
        file.prefix(&prefix).suffix(".log").tempfile_in(folder)
    });
    let file = file.with_context(|| format!("cannot make a log in {}", folder.display()))?;
    Ok(file.keep()?.1)
}
