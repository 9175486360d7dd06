//! Finds symbolic links in folders that may come from other people, where writing through a link would change
//! a file somewhere else, and the place that a path leads to.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf, absolute};

/// Most links on the way to a file; a path with more goes round in circles.
const MOST_LINKS: usize = 40;

/// The absolute path, without links and without `..`, of what a path leads to, whether it is there or not. A folder that
/// is not there yet counts as one: `new/../plan.json` leads to `plan.json` once somebody makes `new`.
///
/// # Errors
/// If links go round in circles, or the path is empty.
pub(crate) fn place_of(path: &Path) -> io::Result<PathBuf> {
    let parts = |path: &Path| -> Vec<OsString> {
        let parts = path.components().rev();
        parts.map(|part| part.as_os_str().to_owned()).collect()
    };
    let mut rest = parts(&absolute(path)?);
    let (mut place, mut links) = (PathBuf::new(), 0);
    while let Some(part) = rest.pop() {
        match Path::new(&part).components().next() {
            None | Some(Component::CurDir) => {}
            Some(Component::ParentDir) => {
                place.pop();
            }
            Some(Component::RootDir | Component::Prefix(_)) => place.push(&part),
            Some(Component::Normal(name)) => {
                let next = place.join(name);
                match fs::read_link(&next) {
                    Ok(_) if links == MOST_LINKS => {
                        let what = format!("{}: its links go round in circles", path.display());
                        return Err(io::Error::other(what));
                    }
                    Ok(target) => {
                        links += 1;
                        rest.extend(parts(&target));
                    }
                    Err(_) => place = next,
                }
            }
        }
    }
    Ok(place)
}

/// Whether there is a link at `path`, whatever it leads to.
pub(crate) fn is_link(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|there| there.is_symlink())
}

/// The first link on the way from a folder to a file in it; `name` is relative to the folder.
pub(crate) fn link_on_the_way(folder: &Path, name: &Path) -> Option<PathBuf> {
    (name.components())
        .scan(folder.to_owned(), |place, part| {
            place.push(part);
            Some(place.clone())
        })
        .find(|place| is_link(place))
}

/// Refuses to write to `path` if it is a link.
pub(crate) fn refuse_link(path: &Path) -> io::Result<()> {
    refuse(is_link(path).then(|| path.to_owned()))
}

/// Refuses to write to a file in a folder if there is a link on the way to it; `name` is relative to the folder.
pub(crate) fn refuse_links(folder: &Path, name: &Path) -> io::Result<()> {
    refuse(link_on_the_way(folder, name))
}

fn refuse(link: Option<PathBuf>) -> io::Result<()> {
    link.map_or(Ok(()), |link| {
        let what = format!("cannot write {}: it is a link; delete it", link.display());
        Err(io::Error::other(what))
    })
}

/// A link at `path` or in it, up to `levels` levels down.
pub(crate) fn link_in(path: &Path, levels: usize) -> Option<PathBuf> {
    if is_link(path) {
        return Some(path.into());
    }
    link_below(path, levels)
}

fn link_below(folder: &Path, levels: usize) -> Option<PathBuf> {
    let levels = levels.checked_sub(1)?;
    // A file has no entries.
    let mut entries = fs::read_dir(folder).ok()?.flatten();
    entries.find_map(|entry| match entry.file_type().ok()? {
        kind if kind.is_symlink() => Some(entry.path()),
        kind if kind.is_dir() => link_below(&entry.path(), levels),
        _ => None,
    })
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn links_are_found_as_far_down_as_asked() {
        let folder = tempfile::tempdir().unwrap();
        let (below, link) = (folder.path().join("a/b"), folder.path().join("a/b/link"));
        fs::create_dir_all(&below).unwrap();
        assert_eq!(link_in(folder.path(), 5), None);
        symlink("nothing", &link).unwrap();
        assert_eq!(link_in(folder.path(), 2), None);
        assert_eq!(link_in(folder.path(), 3), Some(link.clone()));
        assert_eq!(link_in(&link, 0), Some(link.clone()));
        let on_the_way = |name: &str| link_on_the_way(folder.path(), Path::new(name));
        assert_eq!(on_the_way("a/b/link/file"), Some(link));
        assert_eq!(on_the_way("a/b/file"), None);
    }
}
