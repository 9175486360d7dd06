//! The leaderboard as a folder: `index.html`, `leaderboard.csv` and `leaderboard.json`.

use std::io;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::csv::{self, Cell};
use super::html::leaderboard_page;
use super::leaderboard::{Errors, Group, Leaderboard, Refused, Row, Source};
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
            errors,
            commands,
            note: _,
        } = &row.source;
        let checked = *errors == Errors::Checked;
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
            name("errors_checked", if checked { "yes" } else { "no" }),
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
            "version": source.version, "errors_checked": source.errors == Errors::Checked, "commands": source.commands,
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::leaderboard;
    use super::*;

    #[test]
    fn a_truth_that_is_handed_in_checks_nothing() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |path: &str| {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().expect("below")).expect("writable");
            path
        };
        let pose = "1 0 0 1 0 1 0 0 0 0 1 0";
        let truth = format!("0 1 {pose}\n");
        fs::write(
            at("entries/files/wall/sift.txt"),
            format!("0 1 90 {pose}\n"),
        )
        .expect("ours");
        fs::write(at("entries/files/wall/groundtruth.txt"), &truth).expect("ours");
        fs::write(at("others/street/pairs.txt"), &truth).expect("ours");
        fs::write(at("data/wall/pairs.txt"), &truth).expect("ours");
        for (datasets, words, is_checked) in [
            (None, "by its own truth", false),
            (Some("others"), "by its own truth", false),
            (Some("data"), "checked", true),
        ] {
            let datasets = datasets.map(at);
            let board = leaderboard(&at("entries"), datasets.as_deref()).expect("readable");
            assert_eq!(board.refused, []);
            let site = at("site");
            write_leaderboard(&site, &board).expect("writable");
            let read = |name: &str| fs::read_to_string(site.join(name)).expect("it was written");
            let column = format!("<td class=\"name\">{words}</td>");
            assert!(read("index.html").contains(&column), "{words}");
            let values: Value = serde_json::from_str(&read("leaderboard.json")).expect("JSON");
            let row = &values["groups"][0]["rows"][0];
            assert_eq!(row["errors_checked"], is_checked);
            let note = row["note"].to_string();
            assert_eq!(!note.contains("the truth that came with them"), is_checked);
            let table = read("leaderboard.csv");
            let mut lines = table.lines().map(|line| line.split(','));
            let [mut heads, mut cells] = [(); 2].map(|()| lines.next().expect("two lines"));
            let place = heads.position(|head| head == "errors_checked");
            let said = cells.nth(place.expect("a column"));
            assert_eq!(said, Some(if is_checked { "yes" } else { "no" }));
        }
    }
}
