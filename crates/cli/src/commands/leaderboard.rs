//! `matchbench leaderboard`: ranks the runs and results below a folder on one page.

use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use matchbench::counted::counted;
use matchbench::metrics::{Angle, Model};
use matchbench::report::{Leaderboard, Refused, leaderboard, names_or_count, write_leaderboard};

use crate::Ending;
use crate::args::LeaderboardArgs;
use crate::output::{is_standard_output, say, stdout};

pub(crate) fn run(args: &LeaderboardArgs) -> Result<Ending> {
    ensure!(
        !is_standard_output(&args.out),
        "--out takes a folder: a leaderboard is a page and its tables"
    );
    let board = leaderboard(&args.entries, args.datasets.as_deref())
        .with_context(|| format!("cannot list {}", args.entries.display()))?;
    for Refused { place, reason } in &board.refused {
        // Most reasons begin with the name of the file, or of one below the folder.
        let names_it = |rest: &str| rest.starts_with([':', '/']);
        if reason.strip_prefix(&**place).is_some_and(names_it) {
            say!("refused: {reason}");
        } else {
            say!("refused: {place}: {reason}");
        }
    }
    let rows: usize = board.groups.iter().map(|group| group.rows.len()).sum();
    ensure!(
        rows > 0,
        "{} holds no results that can be ranked: neither runs nor <sequence>/<matcher>.txt with their truth",
        args.entries.display()
    );
    let page = write_leaderboard(&args.out, &board)?;
    let ending = if board.refused.is_empty() {
        Ending::Done
    } else {
        Ending::SomeFailed
    };
    ending.after(print(&board, &page))
}

/// Prints who is first in each group.
fn print(board: &Leaderboard, page: &Path) -> Result<()> {
    let mut out = stdout();
    for group in &board.groups {
        let firsts = group.rows.iter().filter(|row| row.rank == 1);
        let firsts: Vec<&str> = firsts.map(|row| &*row.label).collect();
        let auc = group.rows[0].summary.auc_of(Angle::Pose).value;
        let verb = match firsts.len() {
            1 => "is the first",
            _ => "share the first place",
        };
        writeln!(
            out,
            "{}{}, {}, {}, {}: {} {verb}, AUC {}",
            group.dataset,
            match group.model {
                Model::Pose => "",
                Model::Homography => ", homographies",
            },
            counted(group.pairs[0], "pair"),
            group.protocol,
            counted(group.rows.len(), "method"),
            names_or_count(&firsts, group.rows.len()),
            auc.map_or_else(|| "unknown".to_owned(), |auc| format!("{auc:.3}"))
        )?;
    }
    writeln!(out, "{}", page.display())?;
    Ok(())
}
