//! The files of a report in their folder. A later report replaces them, and removes those that it does not have. Files
//! of anybody else are neither overwritten nor removed.
//!
//! The folder has a list of the files that reports wrote. Each is listed before it is written, so that those of a
//! report that was interrupted are known too. Folders come from other people as well, so the list may be theirs: it
//! counts only if it begins as ours does, and only files in folders that reports have are ever removed.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::files::{
    Appender, link_on_the_way, read_text, refuse_links, remove_leftovers_below, write_whole_file,
};

use super::converted::{pdf, png};
use super::target::check_target;

/// The list of the files of a report, kept in its folder.
const LIST: &str = ".files";
/// How a list begins.
const FIRST: &str = "# Written by matchbench: a later report replaces or removes these files.";
/// The folders in which files of a report are removed.
const FOLDERS: [&str; 5] = ["cite", FIGURES, "images", "pairs", "tables"];
/// The folder of the figures.
pub(super) const FIGURES: &str = "figures";
/// Pixels of a PNG figure for each unit of its drawing: sharp on dense screens and in print.
const PNG_SCALE: f32 = 2.0;

/// What every page of a report says.
const OF_REPORT: &str = "matchbench";
/// What every page of the paper says, and no other.
const OF_PAPER: &str = "MatchBench: tables and figures, run again";

/// Writes the files of a report.
pub(super) struct Pages<'a> {
    folder: &'a Path,
    earlier: Earlier,
    written: Mutex<Written>,
}

/// The files of earlier reports in a folder.
#[derive(Default)]
struct Earlier {
    names: BTreeSet<String>,
    /// Whether it is a paper of an early version, which wrote no list: then all its files are taken for ours.
    is_without_list: bool,
}

/// The files of this report so far.
#[derive(Default)]
struct Written {
    names: BTreeSet<String>,
    /// The list, once there is something in it.
    list: Option<Appender>,
}

impl Earlier {
    /// Refuses a folder that belongs to a run or a dataset, or whose page or list is somebody else's.
    fn of(folder: &Path) -> io::Result<Self> {
        let (list, page) = (folder.join(LIST), folder.join("index.html"));
        check_target(&page)?;
        let page_says = |what: &str| read_text(&page).is_ok_and(|page| page.contains(what));
        let text = match read_text(&list) {
            Ok(text) => text,
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                let what = format!("{}: {error}", list.display());
                return Err(io::Error::new(error.kind(), what));
            }
            Err(_) if page_says(OF_PAPER) => {
                return Ok(Self {
                    is_without_list: true,
                    ..Self::default()
                });
            }
            Err(_) if page.exists() => return Err(of_others(&page)),
            Err(_) => return Ok(Self::default()),
        };
        // Lists of early versions have names alone.
        let names = match text.strip_prefix(FIRST) {
            Some(names) => names,
            None if page_says(OF_REPORT) || page_says(OF_PAPER) => &text,
            None => return Err(of_others(&list)),
        };
        let names = names.lines().filter(|name| !name.is_empty());
        Ok(Self {
            names: names.map(str::to_owned).collect(),
            is_without_list: false,
        })
    }

    /// Refuses a file that is there and not of these.
    fn refuse_others(&self, folder: &Path, name: &str) -> io::Result<()> {
        let file = folder.join(name);
        if self.is_without_list || self.names.contains(name) || file.symlink_metadata().is_err() {
            return Ok(());
        }
        Err(of_others(&file))
    }
}

fn of_others(file: &Path) -> io::Error {
    let what = format!(
        "{} is not of an earlier report; write into another folder",
        file.display()
    );
    io::Error::new(io::ErrorKind::AlreadyExists, what)
}

/// A form in which a figure could not be made.
pub(super) struct Undrawn {
    /// How files of this form end.
    pub(super) ending: &'static str,
    /// Which figure it is, and why, in a sentence.
    pub(super) note: String,
}

impl<'a> Pages<'a> {
    /// Refuses a folder that belongs to a run or a dataset, or whose page or list is somebody else's.
    pub(super) fn new(folder: &'a Path) -> io::Result<Self> {
        let earlier = Earlier::of(folder)?;
        remove_leftovers_below(folder, 2);
        Ok(Self {
            folder,
            earlier,
            written: Mutex::default(),
        })
    }

    /// Refuses the folder if one of these files is there and no earlier report listed it.
    pub(super) fn refuse_others(&self, names: &[&str]) -> io::Result<()> {
        (names.iter()).try_for_each(|name| self.earlier.refuse_others(self.folder, name))
    }

    /// Writes one file; its name is relative to the folder. Refuses to replace one that no earlier report listed.
    pub(super) fn write(&self, name: &Path, contents: &[u8]) -> io::Result<()> {
        let text = name.to_string_lossy().replace('\\', "/");
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        if !written.names.contains(&text) {
            self.earlier.refuse_others(self.folder, &text)?;
            let list = match &mut written.list {
                Some(list) => list,
                none => none.insert(self.list()?),
            };
            list.append(format!("{text}\n").as_bytes())?;
            written.names.insert(text);
        }
        drop(written);
        write_own(self.folder, name, contents)
    }

    /// The list of what is here already, to be continued.
    fn list(&self) -> io::Result<Appender> {
        write_list(self.folder, self.earlier.names.iter())?;
        Appender::open(&self.folder.join(LIST), None)
    }

    /// Writes the figure `name` as the drawing that it is, as PNG and as PDF. Where one of these cannot be made, a note
    /// is in its place, and is returned.
    pub(super) fn write_drawing(&self, name: &str, svg: &str) -> io::Result<Vec<Undrawn>> {
        let file = |ending: &str| PathBuf::from(format!("{FIGURES}/{name}.{ending}"));
        self.write(&file("svg"), svg.as_bytes())?;
        let mut notes = Vec::new();
        for (ending, drawn) in [("png", png(svg, PNG_SCALE)), ("pdf", pdf(svg))] {
            match drawn {
                Ok(bytes) => self.write(&file(ending), &bytes)?,
                Err(broken) => {
                    let form = ending.to_uppercase();
                    let note = format!("{name}.svg cannot be drawn as {form}: {broken}");
                    let place = file(&format!("{ending}.txt"));
                    self.write(&place, format!("{note}\n").as_bytes())?;
                    notes.push(Undrawn { ending, note });
                }
            }
        }
        Ok(notes)
    }

    /// Removes the files of the earlier report that this one does not have, such as pages of pairs that are not
    /// shown any more. Files that no report listed belong to somebody else, and stay.
    pub(super) fn remove_earlier(self) -> io::Result<()> {
        let written = self.written.into_inner();
        let Written { mut names, .. } = written.unwrap_or_else(PoisonError::into_inner);
        for name in self.earlier.names {
            let path = Path::new(&name);
            if !names.contains(&name)
                && is_in_own_folder(path)
                && link_on_the_way(self.folder, path).is_none()
            {
                // It may have been removed by hand.
                let _ = fs::remove_file(self.folder.join(path));
            } else {
                names.insert(name);
            }
        }
        write_list(self.folder, names.iter())
    }
}

/// Whether a file of this name lies in one of the folders of a report.
fn is_in_own_folder(name: &Path) -> bool {
    let is_below = (name.components()).all(|part| matches!(part, Component::Normal(_)));
    is_below && FOLDERS.iter().any(|folder| name.starts_with(folder))
}

fn write_list<'n>(folder: &Path, names: impl Iterator<Item = &'n String>) -> io::Result<()> {
    let mut text = format!("{FIRST}\n");
    for name in names {
        text.push_str(name);
        text.push('\n');
    }
    write_own(folder, Path::new(LIST), text.as_bytes())
}

/// Writes a file of a report. Folders of reports can come from other people, so a file that a link in such a
/// folder leads to must not be overwritten.
fn write_own(folder: &Path, name: &Path, contents: &[u8]) -> io::Result<()> {
    refuse_links(folder, name)?;
    write_whole_file(&folder.join(name), contents)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(folder: &Path, names: &[&str]) -> io::Result<()> {
        let out = Pages::new(folder)?;
        for name in names {
            out.write(Path::new(name), b"<p>matchbench</p>")?;
        }
        out.remove_earlier()
    }

    #[test]
    fn files_of_others_are_neither_replaced_nor_removed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        let names = ["tables/scores.csv", "index.html"];
        fs::create_dir_all(at("tables")).expect("writable");
        for (name, text) in [
            ("tables/scores.csv", "mine"),
            ("index.html", "<p>mine, about matchbench</p>"),
            (".files", "notes.txt\ntables/mine.csv\n"),
        ] {
            fs::write(at(name), text).expect("writable");
            let told = write(folder.path(), &names).expect_err("it is not ours");
            assert!(told.to_string().contains(name), "{told}");
            assert_eq!(fs::read_to_string(at(name)).expect("it stays"), text);
            fs::remove_file(at(name)).expect("it is there");
            assert!(!at(".files").exists(), "nothing was written");
        }
        write(folder.path(), &names).expect("nothing is in the way");
        // Whoever writes our first line can still not have other files removed.
        for name in ["notes.txt", "tables/mine.csv", "src/main.rs"] {
            fs::create_dir_all(at(name).parent().expect("it has one")).expect("writable");
            fs::write(at(name), "mine").expect("writable");
        }
        let list =
            format!("{FIRST}\nnotes.txt\nsrc/main.rs\ntables/../notes.txt\ntables/mine.csv\n");
        fs::write(at(".files"), list + "index.html\ntables/scores.csv\n").expect("writable");
        write(folder.path(), &["index.html"]).expect("they are ours");
        assert!(at("notes.txt").is_file() && at("src/main.rs").is_file());
        assert!(!at("tables/scores.csv").exists() && !at("tables/mine.csv").exists());
    }

    #[test]
    fn what_an_interrupted_report_wrote_is_ours() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = Pages::new(folder.path()).expect("an empty folder");
        out.write(Path::new("tables/scores.csv"), b"half a report")
            .expect("writable");
        drop(out);
        write(folder.path(), &["tables/scores.csv", "index.html"]).expect("it is ours");
        write(folder.path(), &["index.html"]).expect("it is ours");
        assert!(!folder.path().join("tables/scores.csv").exists());
    }
}
