//! The report of a run: `RUN/report/index.html` and what belongs to it.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use matchbench::report::{RunFacts, write_report};
use matchbench::run::Plan;

use super::eval;

/// Writes the report of the run in `folder` and returns its page.
pub(crate) fn write(folder: &Path) -> Result<PathBuf> {
    let file = folder.join("plan.json");
    let text =
        fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
    let plan: Plan = serde_json::from_str(&text)
        .with_context(|| format!("{} is not the plan of a run", file.display()))?;
    let facts = RunFacts {
        title: "matchbench report".into(),
        facts: vec![
            ("version".into(), format!("matchbench {}", plan.version)),
            ("seed".into(), plan.settings.seed.to_string()),
            (
                "platform".into(),
                format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            ),
        ],
        plan: Some(text),
    };
    let summaries = eval::summaries(folder, None)?;
    Ok(write_report(&folder.join("report"), &summaries, &facts)?)
}
