//! Where reports, tables and pictures must not be written: into the run or the dataset that they are made of.

use std::io;
use std::path::Path;

use crate::datasets::dataset_of_part;
use crate::files::place_of;
use crate::records::run_of_part;

/// Refuses a file that is, or would be, a part of a run or of a dataset. Others in their folders may be written.
///
/// # Errors
/// If it is one; the error names what it belongs to.
pub fn check_target(file: &Path) -> io::Result<()> {
    let real = place_of(file)?;
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

#[cfg(test)]
mod tests {
    use std::fs;

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
        fs::create_dir(at("plane")).unwrap();
        fs::write(at("plane/homographies.txt"), "").unwrap();
        for (name, of) in [
            ("run/plan.json", "the run"),
            ("run/records/wall/sift+best.jsonl", "the run"),
            ("run/records/new/index.html", "the run"),
            ("run/logs/../matches/wall/sift.bin", "the run"),
            ("run/new/../plan.json", "the run"),
            ("new/more/../../wall/x/./../pairs.txt", "the dataset"),
            ("wall/Depth/0.png", "the dataset"),
            ("plane/homographies.txt", "the dataset"),
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
            // A link to a file that is not there yet would make it.
            std::os::unix::fs::symlink("run/records/new", at("ahead")).unwrap();
            assert!(check_target(&at("ahead")).is_err());
            std::os::unix::fs::symlink("round", at("round")).unwrap();
            assert!(check_target(&at("round")).is_err());
        }
    }
}
