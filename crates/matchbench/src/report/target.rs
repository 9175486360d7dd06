//! Where reports, tables and pictures must not be written: into the run or the dataset that they are made of.

use std::fs;
use std::io;
use std::path::{Path, PathBuf, absolute};

use crate::datasets::dataset_of_part;
use crate::records::run_of_part;

/// Refuses a file that is, or would be, a part of a run or of a dataset. Others in their folders may be written.
///
/// # Errors
/// If it is one; the error names what it belongs to.
pub fn check_target(file: &Path) -> io::Result<()> {
    let real = without_links(file)?;
    let run = run_of_part(&real).map(|folder| ("run", folder));
    let part = run.or_else(|| dataset_of_part(&real).map(|folder| ("dataset", folder)));
    part.map_or(Ok(()), |(what, folder)| {
        Err(io::Error::other(format!(
            "{}: it belongs to the {what} {}, which it would damage; choose another file",
            file.display(),
            folder.display()
        )))
    })
}

/// The absolute path, with the links followed of the part of it that is there.
fn without_links(file: &Path) -> io::Result<PathBuf> {
    let file = absolute(file)?;
    let there = file
        .ancestors()
        .find_map(|folder| Some((folder, fs::canonicalize(folder).ok()?)));
    Ok(match there {
        Some((folder, real)) => match file.strip_prefix(folder) {
            Ok(rest) if rest.as_os_str().is_empty() => real,
            Ok(rest) => real.join(rest),
            Err(_) => file,
        },
        None => file,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_runs_and_datasets_are_refused_and_files_beside_them_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in [
            "run/records/wall/sift+best.jsonl",
            "run/report/index.html",
            "wall/Images/0.png",
        ] {
            fs::create_dir_all(at(name).parent().unwrap()).unwrap();
            fs::write(at(name), "").unwrap();
        }
        fs::write(at("run/plan.json"), "{}").unwrap();
        fs::write(at("wall/pairs.txt"), "").unwrap();
        for (name, of) in [
            ("run/plan.json", "the run"),
            ("run/records/wall/sift+best.jsonl", "the run"),
            ("run/records/new/index.html", "the run"),
            ("run/logs/../matches/wall/sift.bin", "the run"),
            ("wall/Images/0.png", "the dataset"),
            ("wall/pairs.txt", "the dataset"),
            ("wall/camera.txt", "the dataset"),
        ] {
            let said = check_target(&at(name)).expect_err(name).to_string();
            assert!(
                said.contains(of) && said.contains("choose another"),
                "{said}"
            );
        }
        for name in [
            "run/report/index.html",
            "run/scores.csv",
            "wall/pair.png",
            "plan.json",
            "records/a",
            "new/x/y.png",
        ] {
            check_target(&at(name)).expect(name);
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(at("run/plan.json"), at("link")).unwrap();
            assert!(check_target(&at("link")).is_err());
        }
    }
}
