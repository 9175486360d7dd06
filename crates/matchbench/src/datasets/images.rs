//! Finds the image file of each frame.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::manifest::{self, Manifest};
use super::{DatasetError, Problem};
use crate::counted::counted;

/// The folder of numbered images in a dataset.
pub(super) const IMAGES: &str = "Images";

/// Endings of the image files that can be decoded.
pub(super) const EXTENSIONS: [&str; 10] = [
    "png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp", "pgm", "ppm", "pnm",
];

/// Endings of files that are images too, but cannot be decoded; the last nine are raw formats of cameras.
const UNREAD: [&str; 28] = [
    "gif", "pbm", "pam", "pfm", "jp2", "j2k", "jpf", "jpx", "jxl", "avif", "heic", "heif", "exr",
    "hdr", "tga", "dds", "ico", "psd", "svg", "dng", "cr2", "cr3", "nef", "arw", "orf", "raf",
    "rw2", "raw",
];

/// The image of every frame: the one that the manifest names, else `Images/%04d.*`.
pub(super) fn frame_images(
    dir: &Path,
    manifest: &Manifest,
    problems: &mut Vec<Problem>,
) -> Vec<PathBuf> {
    let in_manifest = manifest.frames.len();
    let named: Vec<_> = (0..in_manifest).map(|i| manifest.image(dir, i)).collect();
    if in_manifest > 0 && named.iter().all(Option::is_some) {
        let images: Vec<PathBuf> = named.into_iter().flatten().collect();
        let remedy = format!(
            "put it there, or correct `image_root` in {}",
            dir.join(manifest::FILE).display()
        );
        let root = manifest.image_root(dir);
        if root.is_dir() {
            problems.extend(images.iter().filter_map(|image| not_there(image, &remedy)));
        } else {
            let what = "the folder of the images is missing";
            problems.push(DatasetError::new(root, what, remedy).into());
        }
        return images;
    }
    let images = numbered_images(&dir.join(IMAGES), problems);
    if in_manifest > 0 && in_manifest != images.len() {
        problems.push(
            DatasetError::new(
                dir.join(manifest::FILE),
                format!(
                    "{} for {}",
                    counted(in_manifest, "frame"),
                    counted(images.len(), "image")
                ),
                "give one [[frames]] per image or none at all",
            )
            .into(),
        );
    }
    let mut named = named.into_iter();
    let images: Vec<PathBuf> = images
        .into_iter()
        .map(|image| named.next().flatten().unwrap_or(image))
        .collect();
    let remedy = "put the image there, or take the frame out";
    problems.extend(images.iter().filter_map(|image| not_there(image, remedy)));
    images
}

/// Depth files that `dataset.toml` names and that do not exist.
pub(super) fn missing_depth(dir: &Path, manifest: &Manifest) -> Vec<Problem> {
    let files = (0..manifest.frames.len()).filter_map(|index| manifest.depth(dir, index));
    let missing = files.filter(|file| !file.path.is_file()).map(|file| {
        let remedy = "put it there, or take `depth` of this frame out of dataset.toml";
        DatasetError::new(file.path, "the depth is missing", remedy).into()
    });
    missing.collect()
}

/// Says why there is no image at this path, if there is none. The content is not read.
fn not_there(image: &Path, remedy: &str) -> Option<Problem> {
    let what = match fs::metadata(image) {
        Ok(metadata) if metadata.is_file() => return None,
        Ok(_) => "this is no regular file, so no image",
        Err(_) => "the image is missing",
    };
    Some(DatasetError::new(image, what, remedy).into())
}

/// The images of a folder whose names are numbers counting from 0.
fn numbered_images(folder: &Path, problems: &mut Vec<Problem>) -> Vec<PathBuf> {
    let files = match image_files(folder) {
        Ok(files) => files,
        Err(error) => {
            problems.push(error.into());
            return Vec::new();
        }
    };
    let mut numbered = BTreeMap::<u32, PathBuf>::new();
    for file in files {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let Ok(number) = stem.parse() else {
            problems.push(Problem::warning(DatasetError::new(
                &file,
                "the image's name is no number, so it belongs to no frame",
                "name images 0000, 0001 ... or move it elsewhere",
            )));
            continue;
        };
        match numbered.entry(number) {
            Entry::Vacant(place) => {
                place.insert(file);
            }
            Entry::Occupied(first) => problems.push(
                DatasetError::new(
                    &file,
                    format!(
                        "frame {number} has another image, {}",
                        first.get().display()
                    ),
                    "remove one of them",
                )
                .into(),
            ),
        }
    }
    if numbered.is_empty() {
        problems.push(
            DatasetError::new(folder, "there are no images", "put 0000.png ... there").into(),
        );
    }
    let mut expected = 0;
    for (&number, image) in &numbered {
        if number > expected {
            let what = match number - expected {
                1 => format!("the image before it, {expected:04}, is missing"),
                _ => format!("the images {expected:04} to {:04} are missing", number - 1),
            };
            problems.push(DatasetError::new(image, what, "number images from 0000 on").into());
        }
        expected = number.saturating_add(1);
    }
    numbered.into_values().collect()
}

/// The visible image files of a folder, in natural order (`2.png` before `10.png`).
pub(super) fn image_files(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    files_ending_in(&EXTENSIONS, folder)
}

/// The visible files of a folder that are images in formats that cannot be read, in natural order. Those beside
/// which the same image is among the `images` that can be read (`2.nef` and `2.jpg`) are not among them.
pub(super) fn unread_image_files(
    folder: &Path,
    images: &[PathBuf],
) -> Result<Vec<PathBuf>, DatasetError> {
    let read: HashSet<_> = images
        .iter()
        .filter_map(|image| image.file_stem())
        .collect();
    let mut unread = files_ending_in(&UNREAD, folder)?;
    unread.retain(|image| image.file_stem().is_none_or(|stem| !read.contains(stem)));
    Ok(unread)
}

/// The visible files of a folder with one of these endings, in natural order.
pub(super) fn files_ending_in(
    extensions: &[&str],
    folder: &Path,
) -> Result<Vec<PathBuf>, DatasetError> {
    let entries = fs::read_dir(folder).map_err(|error| DatasetError::io(folder, &error))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry
            .map_err(|error| DatasetError::io(folder, &error))?
            .path();
        let extension = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase());
        let hidden = path
            .file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if !hidden && extension.is_some_and(|e| extensions.contains(&e.as_str())) {
            files.push(path);
        }
    }
    files.sort_by_cached_key(|path| natural_key(&path.to_string_lossy()));
    Ok(files)
}

/// Sorts runs of digits as numbers, whatever their length, and the rest as text.
fn natural_key(name: &str) -> (Vec<(String, usize, String)>, String) {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let (text, tail) = rest.split_at(
            rest.find(|c: char| c.is_ascii_digit())
                .unwrap_or(rest.len()),
        );
        let (digits, tail) = tail.split_at(
            tail.find(|c: char| !c.is_ascii_digit())
                .unwrap_or(tail.len()),
        );
        let digits = digits.trim_start_matches('0');
        parts.push((text.to_owned(), digits.len(), digits.to_owned()));
        rest = tail;
    }
    (parts, name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_counted_not_spelled() {
        let mut names = [
            "img10.png",
            "img9.png",
            "a.png",
            "img010.png",
            "img1_2.png",
            "",
        ];
        names.sort_by_cached_key(|name| natural_key(name));
        assert_eq!(
            names,
            [
                "",
                "a.png",
                "img1_2.png",
                "img9.png",
                "img010.png",
                "img10.png"
            ]
        );
    }

    #[test]
    fn gaps_doubles_and_strangers_are_found() {
        let folder = tempfile::tempdir().unwrap();
        for name in [
            "0000.png",
            "0001.jpg",
            "0001.png",
            "0004.PNG",
            "montage.png",
            "._0002.png",
            "pose.txt",
        ] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let mut problems = Vec::new();
        let images = numbered_images(folder.path(), &mut problems);
        assert_eq!(images.len(), 3);
        let text: Vec<_> = problems.iter().map(ToString::to_string).collect();
        assert_eq!(problems.len(), 3, "{text:?}");
        assert!(text[0].contains("frame 1 has another image"));
        assert!(text[1].contains("montage.png"));
        assert!(text[2].contains("0002 to 0003 are missing"));
    }
}
