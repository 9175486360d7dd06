//! The names of what is in the folder of a run, and what else is there: a folder may be that of other things too.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use super::{KeepMatches, earlier, images, matches, store};
use crate::files::PREFIX;

pub(super) const PLAN: &str = "plan.json";
pub(super) const TUNING: &str = "tuning.json";
pub(super) const TUNED: &str = "tuned.json";
pub(super) const CACHE: &str = "cache";
pub(super) const REPORT: &str = "report";
pub(super) const LOGS: &str = "logs";
pub(super) const LOCK: &str = ".lock";

/// What a run makes in its folder once its plan is written.
const AFTER_PLAN: [&str; 6] = [
    TUNING,
    earlier::FOLDER,
    matches::FOLDER,
    matches::INLIERS,
    images::FOLDER,
    images::DEPTH,
];

/// The other names in the folder of a run, or of a plan of shards, that belong to it.
const OTHERS: [&str; 7] = [PLAN, TUNED, CACHE, LOCK, LOGS, store::FOLDER, "shards"];

/// Whether what is called so in the folder of a run, or of a plan of shards, belongs to it. Beside that others may keep files.
fn is_part(name: &OsStr) -> bool {
    AFTER_PLAN.iter().chain(&OTHERS).any(|part| name == *part)
}

/// The folder of the run, or of the plan of shards, that a file is a part of: its plan, records, matches ...; not its
/// report. `file` is absolute and without links.
pub fn run_of_part(file: &Path) -> Option<&Path> {
    file.ancestors().skip(1).find(|folder| {
        let part = file
            .strip_prefix(folder)
            .ok()
            .and_then(|inner| inner.iter().next());
        part.is_some_and(is_part) && has_plan(folder)
    })
}

/// Whether a folder has a plan, readable or not.
pub(super) fn has_plan(folder: &Path) -> bool {
    folder.join(PLAN).is_file()
}

/// What stands in a `folder` without a plan where a run would write. A run may begin there meanwhile, which writes its plan
/// first.
pub(super) fn in_the_way(folder: &Path) -> Option<PathBuf> {
    let mut places = AFTER_PLAN.iter().map(|name| folder.join(name));
    let place = places.find(|place| place.exists());
    place.filter(|_| !has_plan(folder))
}

/// What is in a `folder` without a run and is no part of one, so that a run that is begun there stands among the files of
/// others; the first by name.
pub fn stranger_in(folder: &Path) -> Option<PathBuf> {
    if has_plan(folder) {
        return None;
    }
    let is_of_run = |name: &OsStr| {
        let is_leftover = name.as_encoded_bytes().starts_with(PREFIX.as_bytes());
        is_part(name) || name == REPORT || is_leftover
    };
    let entries = fs::read_dir(folder).ok()?.flatten();
    let others = entries.filter(|entry| !is_of_run(&entry.file_name()));
    others.map(|entry| entry.path()).min()
}

/// Folders of matches, or of inliers, in a `run` that are not those which a start that keeps so much writes.
pub fn kept_otherwise(run: &Path, keep: KeepMatches) -> Vec<PathBuf> {
    let written = match keep {
        KeepMatches::All => Some(matches::FOLDER),
        KeepMatches::Inliers => Some(matches::INLIERS),
        KeepMatches::None => None,
    };
    let folders = [matches::FOLDER, matches::INLIERS].into_iter();
    let others = folders.filter(|folder| Some(*folder) != written);
    let others = others.map(|folder| run.join(folder));
    others.filter(|folder| folder.is_dir()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_of_others_is_told_from_the_parts_of_a_run() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let make = |name: &str| fs::write(folder.join(name), "").unwrap();
        assert_eq!(stranger_in(&folder.join("nowhere")), None);
        make(LOCK);
        make(".matchbench-left");
        for name in [LOGS, REPORT] {
            fs::create_dir(folder.join(name)).unwrap();
        }
        assert_eq!((stranger_in(folder), in_the_way(folder)), (None, None));
        make("thesis.tex");
        make("notes.txt");
        assert_eq!(stranger_in(folder), Some(folder.join("notes.txt")));
        fs::create_dir(folder.join("images")).unwrap();
        assert_eq!(in_the_way(folder), Some(folder.join("images")));
        make(TUNING);
        assert_eq!(in_the_way(folder), Some(folder.join(TUNING)));
        make(PLAN);
        assert_eq!(stranger_in(folder), None, "they stand beside a run");
        assert_eq!(in_the_way(folder), None, "it is of the run");
    }

    #[test]
    fn what_another_choice_has_kept_is_found() {
        let run = tempfile::tempdir().unwrap();
        let run = run.path();
        let found = |keep| kept_otherwise(run, keep).len();
        assert_eq!(found(KeepMatches::None), 0);
        fs::create_dir(run.join(matches::FOLDER)).unwrap();
        let choices = [KeepMatches::All, KeepMatches::Inliers, KeepMatches::None];
        assert_eq!(choices.map(found), [0, 1, 1]);
        fs::create_dir(run.join(matches::INLIERS)).unwrap();
        assert_eq!(choices.map(found), [1, 1, 2]);
    }
}
