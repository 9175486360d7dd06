//! How the files of images come into a new dataset: as links, as copies, or by their paths; and what they were called.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::{DatasetError, Frame, read_size};

/// Links or copies a file of frame `index` into `folder`; returns its name there.
pub(super) fn bring(
    file: &Path,
    folder: &Path,
    index: usize,
    is_copied: bool,
) -> Result<PathBuf, DatasetError> {
    let source = fs::canonicalize(file).map_err(|error| DatasetError::io(file, &error))?;
    let extension = file.extension().unwrap_or_default();
    let name = Path::new(&format!("{index:04}")).with_extension(extension.to_ascii_lowercase());
    let target = folder.join(&name);
    if is_copied {
        // A list may name any file by a mistake or on purpose, and only images are copied. (A copy from a pipe
        // would wait for data.)
        read_size(&source)?;
        fs::copy(&source, &target).map(drop)
    } else {
        link(&source, &target)
    }
    .map_err(|error| DatasetError::io(&target, &error))?;
    Ok(name)
}

#[cfg(unix)]
fn link(source: &Path, target: &Path) -> std::io::Result<()> {
    std::os::unix::fs::symlink(source, target)
}

#[cfg(not(unix))]
fn link(source: &Path, target: &Path) -> std::io::Result<()> {
    fs::hard_link(source, target)
}

/// What the images of frames are called: their names, or else their paths below the folder of all of them, without the
/// folders above, which are private to this machine. `None` where a path is not UTF-8.
pub(super) fn former_names(frames: &[Frame]) -> Result<Vec<Option<String>>, DatasetError> {
    let images = (frames.iter())
        .map(|frame| {
            std::path::absolute(&frame.image)
                .map_err(|error| DatasetError::io(&frame.image, &error))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let root = common_folder(&images);
    let name = |image: &PathBuf| {
        let relative = image.strip_prefix(&root).unwrap_or(image);
        let parts = relative.iter().map(|part| part.to_str());
        Some(parts.collect::<Option<Vec<_>>>()?.join("/"))
    };
    let names = frames.iter().zip(&images);
    Ok(names
        .map(|(frame, image)| frame.name.clone().or_else(|| name(image)))
        .collect())
}

/// The path without links; if the image does not exist yet, the path unchanged.
pub(super) fn real_path(image: &Path) -> Result<PathBuf, DatasetError> {
    let path = match fs::canonicalize(image) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => std::path::absolute(image),
        found => found,
    }
    .map_err(|error| DatasetError::io(image, &error))?;
    if path.to_str().is_none() {
        return Err(DatasetError::new(
            image,
            "the path is not UTF-8, so dataset.toml cannot name it",
            "rename the folder, or link or copy the images",
        ));
    }
    Ok(path)
}

/// The deepest folder that contains all of `files`.
pub(super) fn common_folder(files: &[PathBuf]) -> PathBuf {
    let mut folder = files
        .first()
        .and_then(|f| f.parent())
        .unwrap_or(Path::new(""));
    for file in files {
        while !file.starts_with(folder) {
            folder = folder.parent().unwrap_or(Path::new(""));
        }
    }
    folder.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_common_folder_holds_all_files() {
        let common =
            |files: &[&str]| common_folder(&files.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(common(&["/a/b/1.png", "/a/b/2.png"]), Path::new("/a/b"));
        assert_eq!(common(&["/a/b/1.png", "/a/bc/2.png"]), Path::new("/a"));
        assert_eq!(common(&[]), Path::new(""));
    }
}
