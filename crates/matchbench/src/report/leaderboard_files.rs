//! The leaderboard as a folder: `index.html`, `leaderboard.csv` and `leaderboard.json`.

use std::io;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::csv::{self, Cell};
use super::html::leaderboard_page;
use super::leaderboard::{Group, Leaderboard, Refused, Row, Source};
use super::pages::Pages;

/// Writes the page and its tables, and returns the path of the page. Files of an earlier leaderboard are
/// replaced, each in one step; other files stay.
///
/// # Errors
/// If a file or folder cannot be written, or if the folder has a page that is not a leaderboard.
pub fn write_leaderboard(folder: &Path, board: &Leaderboard) -> io::Result<PathBuf> {
    let out = Pages::new(folder)?;
    for (name, text) in [
        ("leaderboard.csv", table(board)),
        ("leaderboard.json", values(board)),
        ("index.html", leaderboard_page(board)),
    ] {
        out.write(Path::new(name), text.as_bytes())?;
    }
    out.remove_earlier()?;
    Ok(folder.join("index.html"))
}

/// One line per row with all scores; the columns are those of `scores.csv`.
fn table(board: &Leaderboard) -> String {
    let row = |group: &Group, row: &Row| {
        let Source {
            entry,
            file,
            blake3,
            version,
            checked,
            commands,
            note: _,
        } = &row.source;
        let name = |head: &str, text: &str| (head.to_owned(), Cell::Name(text.to_owned()));
        let count = |head: &str, count: usize| (head.to_owned(), Cell::Count(count));
        let mut cells = vec![
            count("rank", row.rank),
            name("fingerprint", &group.fingerprint),
            count("listed_pairs", group.pairs[1]),
            name("entry", entry),
            name("file", file),
            name("blake3", blake3),
            name("version", version),
            name("errors_checked", if *checked { "yes" } else { "no" }),
            name("commands", &commands.join("; ")),
        ];
        cells.extend(csv::row(&row.summary));
        cells
    };
    let rows =
        (board.groups.iter()).flat_map(|group| group.rows.iter().map(move |it| row(group, it)));
    csv::table(rows.collect())
}

fn values(board: &Leaderboard) -> String {
    let row = |row: &Row| {
        let source = &row.source;
        json!({
            "rank": row.rank, "entry": source.entry, "file": source.file, "blake3": source.blake3,
            "version": source.version, "errors_checked": source.checked, "commands": source.commands,
            "note": source.note, "scores": row.summary,
        })
    };
    let group = |group: &Group| {
        json!({
            "dataset": group.dataset, "fingerprint": group.fingerprint, "protocol": group.protocol,
            "pairs": group.pairs[0], "listed_pairs": group.pairs[1],
            "others_of_this_name": group.namesakes,
            "rows": group.rows.iter().map(row).collect::<Value>(),
        })
    };
    let refused = |Refused { place, reason }: &Refused| json!({"place": place, "reason": reason});
    let all = json!({
        "groups": board.groups.iter().map(group).collect::<Value>(),
        "refused": board.refused.iter().map(refused).collect::<Value>(),
    });
    format!("{all:#}\n")
}
