//! How the files of images come into a new dataset: as links, as copies, or by their paths; and what they were called.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::manifest::{Manifest, ManifestFrame};
use super::{DatasetError, Frame, Sequence, read_size};
use crate::arrays::Hdf5;

/// What a file of a frame holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Image,
    Depth,
}

/// Links or copies a file of frame `index` into `folder`; returns its name there.
pub(super) fn bring(
    file: &Path,
    kind: Kind,
    folder: &Path,
    index: usize,
    is_copied: bool,
) -> Result<PathBuf, DatasetError> {
    let source = fs::canonicalize(file).map_err(|error| DatasetError::io(file, &error))?;
    let extension = file.extension().unwrap_or_default();
    let name = Path::new(&format!("{index:04}")).with_extension(extension.to_ascii_lowercase());
    let target = folder.join(&name);
    if is_copied {
        // A list may name any file by a mistake or on purpose, and only images and depth are copied. (A copy from a
        // pipe would wait for data.)
        if kind == Kind::Image || !Hdf5::is_file(&source) {
            read_size(&source)?;
        }
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

/// Names images and depth by their paths, behind links, and images that were links also by what these are called.
pub(super) fn refer_to_images(
    manifest: &mut Manifest,
    sequence: &Sequence,
) -> Result<(), DatasetError> {
    let images = sequence
        .frames
        .iter()
        .map(|frame| real_path(&frame.image))
        .collect::<Result<Vec<_>, _>>()?;
    let depths = (sequence.frames.iter())
        .map(|frame| {
            frame
                .depth
                .as_ref()
                .map(|file| real_path(&file.path))
                .transpose()
        })
        .collect::<Result<Vec<_>, _>>()?;
    let all: Vec<PathBuf> = images
        .iter()
        .chain(depths.iter().flatten())
        .cloned()
        .collect();
    let root = common_folder(&all);
    manifest
        .frames
        .resize(images.len(), ManifestFrame::default());
    let relative = |path: &PathBuf| path.strip_prefix(&root).unwrap_or(path).to_owned();
    let names = former_names(&sequence.frames)?;
    let files = images.iter().zip(&depths).zip(names);
    for (frame, ((image, depth), name)) in manifest.frames.iter_mut().zip(files) {
        frame.image = Some(relative(image));
        frame.depth = depth.as_ref().map(relative);
        if frame.name.is_none() {
            // A link may have another name than the file that it points to.
            frame.name = name.filter(|name| !image.ends_with(name));
        }
    }
    manifest.image_root = Some(root);
    Ok(())
}

/// The path without links; if the image does not exist yet, the path unchanged.
fn real_path(image: &Path) -> Result<PathBuf, DatasetError> {
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
    use super::super::testing;
    use super::*;

    #[test]
    fn the_common_folder_holds_all_files() {
        let common =
            |files: &[&str]| common_folder(&files.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(common(&["/a/b/1.png", "/a/b/2.png"]), Path::new("/a/b"));
        assert_eq!(common(&["/a/b/1.png", "/a/bc/2.png"]), Path::new("/a"));
        assert_eq!(common(&[]), Path::new(""));
    }

    #[cfg(unix)]
    #[test]
    fn links_that_are_referred_to_keep_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let root = fs::canonicalize(folder.path()).unwrap();
        fs::create_dir_all(root.join("images/db")).unwrap();
        fs::create_dir(root.join("blobs")).unwrap();
        let mut frames = testing::frames(4);
        let names = ["a.png", "db/b.png", "c.png", "later.png"];
        for (frame, name) in frames.iter_mut().zip(names) {
            frame.image = root.join("images").join(name);
        }
        for (blob, frame) in [("3f2a", &frames[0]), ("db/b.png", &frames[1])] {
            let blob = root.join("blobs").join(blob);
            fs::create_dir_all(blob.parent().unwrap()).unwrap();
            fs::write(&blob, "").unwrap();
            link(&blob, &frame.image).unwrap();
        }
        fs::write(&frames[2].image, "").unwrap();
        frames[2].name = Some("before.png".into());
        let mut manifest = Manifest::default();
        let written = |frame: &Frame| ManifestFrame {
            name: frame.name.clone(),
            ..ManifestFrame::default()
        };
        manifest.frames = frames.iter().map(written).collect();
        let sequence = Sequence {
            name: String::new(),
            frames,
            pairs: Vec::new(),
        };
        refer_to_images(&mut manifest, &sequence).unwrap();
        let found = manifest.frames.iter().map(|frame| {
            let image = frame.image.as_deref().and_then(Path::to_str);
            (image.unwrap(), frame.name.as_deref())
        });
        let expected = [
            ("blobs/3f2a", Some("a.png")),
            ("blobs/db/b.png", None), // which ends with its name
            ("images/c.png", Some("before.png")),
            ("images/later.png", None),
        ];
        assert_eq!(found.collect::<Vec<_>>(), expected);
        assert_eq!(manifest.image_root, Some(root));
    }
}
