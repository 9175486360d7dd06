//! Removes incomplete files of processes that were killed: hidden files and folders that no process holds.
//!
//! The name of every temporary file begins with [`PREFIX`], and the file is locked while its process lives; a
//! folder is locked by a file in it. The lock ends with the process, however the process ends. So if a file can
//! be locked, no process needs it.

use std::fs::{self, File};
use std::path::Path;
use std::time::Duration;

/// Names of temporary files and folders begin with this.
pub(crate) const PREFIX: &str = ".matchbench-";
/// The file in a temporary folder that is locked.
pub(crate) const HELD: &str = ".held";
/// A file younger than this may not be locked yet by the process that creates it.
const YOUNG: Duration = Duration::from_secs(1);

/// Marks a temporary file as one that is being written, as long as it is open.
pub(crate) fn hold(file: &File) {
    // If a file system has no locks, leftovers are not removed, but files can still be written.
    let _ = file.try_lock();
}

/// Removes leftovers of killed processes in a folder, but not in those below it.
pub fn remove_leftovers(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(PREFIX) {
            remove_if_left(&entry.path());
        }
    }
}

/// The same in a folder and those below it, up to `levels` levels down. Links are not followed.
pub fn remove_leftovers_below(folder: &Path, levels: usize) {
    remove_leftovers(folder);
    let Some(levels) = levels.checked_sub(1) else {
        return;
    };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|what| what.is_dir()) {
            remove_leftovers_below(&entry.path(), levels);
        }
    }
}

/// Errors are ignored: a leftover that cannot be removed stays hidden and disturbs nothing.
fn remove_if_left(path: &Path) {
    let Ok(metadata) = fs::symlink_metadata(path) else {
        return;
    };
    let age = metadata
        .modified()
        .ok()
        .and_then(|time| time.elapsed().ok());
    if age.is_none_or(|age| age < YOUNG) {
        return;
    }
    let is_free = |file: &Path| {
        if !fs::metadata(file).is_ok_and(|there| there.is_file()) {
            return false;
        }
        let file = File::options().write(true).open(file);
        file.and_then(|file| Ok(file.try_lock()?)).is_ok()
    };
    if metadata.is_file() && is_free(path) {
        let _ = fs::remove_file(path);
    } else if metadata.is_dir() && is_free(&path.join(HELD)) {
        let _ = fs::remove_dir_all(path);
    }
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use super::*;

    #[test]
    fn leftovers_are_found_below_and_links_are_not_followed() {
        let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let old = SystemTime::now() - Duration::from_secs(60);
        let leave = |place: &Path| {
            fs::create_dir_all(place).unwrap();
            let file = place.join(".matchbench-left");
            File::create(&file).unwrap().set_modified(old).unwrap();
            file
        };
        let [near, far] = ["a", "a/b"].map(|place| leave(&folder.path().join(place)));
        let theirs = leave(other.path());
        #[cfg(unix)]
        std::os::unix::fs::symlink(other.path(), folder.path().join("link")).unwrap();
        remove_leftovers_below(folder.path(), 1);
        assert!(!near.exists() && far.exists());
        remove_leftovers_below(folder.path(), 2);
        assert!(!far.exists() && theirs.exists());
    }

    #[test]
    fn what_is_held_or_young_or_another_s_stays() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        let make = |name: &str, seconds: u64| {
            let file = File::create(at(name)).expect("writable");
            let time = SystemTime::now() - Duration::from_secs(seconds);
            file.set_modified(time).expect("it is ours");
            file
        };
        drop(make(".matchbench-left", 60));
        drop(make(".matchbench-young", 0));
        drop(make(".other", 60));
        let held = make(".matchbench-held", 60);
        hold(&held);
        #[cfg(unix)] // elsewhere a folder is not opened like a file
        {
            fs::create_dir(at(".matchbench-folder")).expect("writable");
            drop(make(".matchbench-folder/.held", 60));
            let old = SystemTime::now() - Duration::from_secs(60);
            (File::open(at(".matchbench-folder")).and_then(|f| f.set_modified(old))).expect("ours");
        }
        remove_leftovers(folder.path());
        let mut left: Vec<_> = (fs::read_dir(folder.path()).expect("readable"))
            .map(|entry| entry.expect("readable").file_name())
            .collect();
        left.sort();
        assert_eq!(left, [".matchbench-held", ".matchbench-young", ".other"]);
    }
}
