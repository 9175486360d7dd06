//! `matchbench paper`: reproduces the paper's tables and figures, from the data as their authors publish them.

use std::io::Write;

use anyhow::{Context, Result};
use matchbench::paper::{Paper, PaperError, times, where_to_find};
use matchbench::records::RunFolder;
use matchbench::report::{ReportOptions, paper_of_run};

use super::job::{AFTER_PAIRS, changes, execute_until, tell_news};
use crate::Ending;
use crate::args::PaperArgs;
use crate::output::{say, stdout};
use crate::stop::Stop;

pub(crate) fn run(args: &PaperArgs) -> Result<Ending> {
    let mut out = stdout();
    let (Some(data), Some(folder)) = (&args.data, &args.out) else {
        write!(out, "{}", where_to_find())?;
        return Ok(Ending::Done);
    };
    let paper = Paper {
        data: data.clone(),
        out: folder.clone(),
        sequences: args.sequences.clone(),
        quick: args.quick,
        set: changes(&args.set)?,
    };
    let (study, left_out) = paper.study(&tell_news)?;
    for sequence in &left_out {
        say!("{} is left out: {}", sequence.sequence, sequence.reason);
    }
    if study.datasets.is_empty() {
        return Err(PaperError::NoData(data.clone()).into());
    }
    let is_broken = left_out.iter().any(|sequence| sequence.is_broken);
    let stop = Stop::on_ctrl_c(AFTER_PAIRS)?;
    let (ending, prepared) = execute_until(&study, &stop)?;
    if ending == Ending::Stopped {
        return Ok(ending);
    }
    let file = paper.folder().join("times.json");
    let told = |news: &str| say!("{news}");
    let Some(times) = times(&prepared, &file, paper.timed_pairs(), stop.begin(), &told)? else {
        return Ok(Ending::Stopped);
    };
    let options = ReportOptions {
        cache: study.cache.as_deref(),
        ..ReportOptions::default()
    };
    let run = RunFolder::open(&prepared.folder).context("the run was just done")?;
    let reported = paper_of_run(&run, &options, &times, &paper.folder())?;
    for note in &reported.notes {
        say!("note: {note}");
    }
    let ending = match ending {
        Ending::Done if is_broken => Ending::SomeFailed,
        ending => ending,
    };
    ending.after(writeln!(out, "{}", reported.page.display()))
}
