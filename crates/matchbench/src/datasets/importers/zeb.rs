//! ZEB, the zero-shot evaluation benchmark of GIM (Shen, Cai, Yin, Mueller, Li, Wang, Chen, Wang:
//! "GIM: Learning Generalizable Image Matcher From Internet Videos", ICLR 2024).
//!
//! Each of its twelve sets is a folder with one text file per pair. The file has one line: two image names, two
//! overlaps, K_0 (9), K_1 (9) and the 4x4 T_0to1 (`b_from_a`; 12 numbers are accepted too). The file is called
//! `SCENE_...txt`; the image with the name `00000008.jpg` is `SCENE_00000008.png` beside it. K is taken
//! unchanged, since it is used with pixels counted from the centre of the first one. Pairs are in the order of
//! the names of the files. The overlaps are not used.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

use super::list::{NamedFrames, camera};
use super::{ImportOptions, Imported, base_name};
use crate::counted::counted;
use crate::datasets::images::files_ending_in;
use crate::datasets::text::{self, TextFile};
use crate::datasets::{DatasetError, Pair, Turn};

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let mut files = files_ending_in(&["txt"], src)?;
    files.sort();
    let root = options.root(src);
    let mut frames = NamedFrames::default();
    let mut pairs = Vec::new();
    for path in &files {
        let file = TextFile::read(path)?;
        let mut rows = file.rows();
        let (line, row) = rows.next().ok_or_else(|| {
            file.error(
                "the text is empty",
                "expected one line that describes a pair",
            )
        })?;
        if let Some((line, _)) = rows.next() {
            return Err(file.error_at(line, "a second line, where one pair is expected"));
        }
        let words: Vec<&str> = row.split_whitespace().collect();
        let (a, b, b_from_a) =
            pair(path, &words, &root, &mut frames).map_err(|what| file.error_at(line, what))?;
        pairs.push(Pair::with_pose(a, b, b_from_a));
    }
    let origin = format!("ZEB, {}", base_name(src));
    Ok(Imported::listed(origin, frames.into_frames(), pairs))
}

fn pair(
    file: &Path,
    words: &[&str],
    root: &Path,
    frames: &mut NamedFrames,
) -> Result<(u32, u32, Isometry3<f64>), String> {
    let [name_a, name_b, _, _, numbers @ ..] = words else {
        return Err("two names and two overlaps are expected".to_owned());
    };
    let numbers = text::numbers(&numbers.join(" "))?;
    let b_from_a = match numbers.len() {
        30 | 34 => text::rigid_motion_of(&numbers[18..]),
        found => Err(format!(
            "{} after the overlaps where 9 + 9 + 16 are expected",
            counted(found, "number")
        )),
    }?;
    let mut number = |name: &str, k: &[f64]| {
        let camera = camera(k)?;
        Ok::<_, String>(frames.number(image(root, file, name), Turn::None, camera, None))
    };
    let (a, b) = (
        number(name_a, &numbers[..9])?,
        number(name_b, &numbers[9..18])?,
    );
    if a == b {
        return Err("the image is matched with itself".to_owned());
    }
    Ok((a, b, b_from_a))
}

/// The file of an image that `text` names. The name of a scene may itself contain underscores, so each
/// underscore is tried as its end. If nothing is found, GIM's own rule is used, where the name ends at the
/// first underscore.
fn image(root: &Path, text: &Path, name: &str) -> PathBuf {
    let text = text.file_stem().unwrap_or_default().to_string_lossy();
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let scenes = text.match_indices('_').map(|(end, _)| &text[..end]);
    let mut named = scenes
        .flat_map(|scene| [stem, name].map(|image| root.join(format!("{scene}_{image}.png"))));
    let first = named.next();
    let found = first
        .iter()
        .cloned()
        .chain(named)
        .find(|path| path.is_file());
    (found.or_else(|| Some(root.join(name)).filter(|path| path.is_file())))
        .or(first)
        .unwrap_or_else(|| root.join(name))
}
