//! `--threads`, the same option in every command that has it.

use std::num::NonZeroUsize;

use clap::Args;

/// More threads than any machine of today can use.
const MAX_THREADS: usize = 1024;

/// How many threads a command uses in total.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(crate) struct Threads {
    /// Number of threads; results do not depend on it [default: all cores]
    #[arg(long = "threads", value_name = "N", value_parser = threads)]
    pub number: Option<NonZeroUsize>,
}

fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let number = (text.parse().ok()).filter(|number: &NonZeroUsize| number.get() <= MAX_THREADS);
    number.ok_or_else(|| format!("give a number from 1 to {MAX_THREADS}"))
}
