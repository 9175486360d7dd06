//! The Image Matching Challenge.
//!
//! 2020 and 2021 (Jin, Mishkin, Mishchuk, Matas, Fua, Yi, Trulls: "Image Matching across Wide Baselines: From
//! Paper to Practice", IJCV 129, 2021): a folder with `calibration/`, or with its files directly. These are
//! `calibration_NAME.h5` with `K` (3x3), `R` (3x3) and `T` (3), world to camera, without a unit. Images are
//! `NAME.jpg` or `.png` in `images/` beside it. K is taken unchanged, since it is used with pixels counted from
//! the centre of the first one.
//!
//! 2025: `train_labels.csv` with the columns dataset, scene, image, rotation_matrix (9 numbers) and
//! translation_vector (3); the numbers are separated by `;` and are cam_from_world. Images are
//! `train/DATASET/NAME` beside it. Images that belong to no scene have no numbers and are left out. There is no
//! K. Give one by the option of a camera; otherwise a focal length of 1.2 times the longer side is used
//! instead, for which the images are needed. The option of a sequence chooses `DATASET/SCENE`.
//!
//! 2023 and 2024 are COLMAP models (kind `colmap`).

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use nalgebra::Isometry3;

use super::oxford::image;
use super::{
    ImportOption, ImportOptions, Imported, base_name, given_camera, images_left_out, list,
};
use crate::arrays::Hdf5;
use crate::counted::counted;
use crate::datasets::text::{self, TextFile};
use crate::datasets::{About, DatasetError, Frame, read_size};

/// Most bytes that a matrix of a calibration, or a chunk of it, may have.
const MAX_BYTES: usize = 1 << 16;

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    if src.is_dir() {
        read_calibrations(src, options)
    } else {
        read_labels(src, options)
    }
}

fn read_calibrations(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    if let Some(sequence) = &options.sequence {
        return Err(DatasetError::new(
            src,
            format!("a folder of calibrations has no sequence `{sequence}`"),
            format!(
                "leave {} out, or give a train_labels.csv",
                ImportOption::Sequence
            ),
        ));
    }
    let inside = src.join("calibration");
    let folder = if inside.is_dir() {
        inside
    } else {
        src.to_owned()
    };
    let beside = [src.join("images"), src.join("../images")];
    let images = beside
        .into_iter()
        .find(|path| path.is_dir())
        .unwrap_or(src.join("images"));
    let root = options.root(&images);
    let given = given_camera(src, options, &[])?;
    let mut frames = Vec::new();
    for (name, file) in calibrations(&folder)? {
        let (camera, camera_from_world) = calibration(&file)?;
        let image = image(&root, &name).unwrap_or_else(|| root.join(format!("{name}.jpg")));
        let camera = given.unwrap_or(camera);
        frames.push(Frame::with_pose(image, camera, camera_from_world.inverse()));
    }
    Ok(Imported {
        about: About {
            origin: format!("Image Matching Challenge, {}", base_name(src)),
            notes: Vec::new(),
            ..About::default()
        },
        ..Imported::of(frames)
    })
}

/// The names of images and their calibrations, sorted by name.
fn calibrations(folder: &Path) -> Result<Vec<(String, PathBuf)>, DatasetError> {
    let entries = fs::read_dir(folder).map_err(|error| DatasetError::io(folder, &error))?;
    let mut found: Vec<_> = entries
        .filter_map(|entry| {
            let file = entry.ok()?.file_name().into_string().ok()?;
            let name = file.strip_prefix("calibration_")?.strip_suffix(".h5")?;
            Some((name.to_owned(), folder.join(&file)))
        })
        .collect();
    found.sort();
    if found.is_empty() {
        return Err(DatasetError::new(
            folder,
            "there is no calibration_NAME.h5",
            "give a folder with calibration/ and images/, or a train_labels.csv",
        ));
    }
    Ok(found)
}

fn calibration(path: &Path) -> Result<(Camera, Isometry3<f64>), DatasetError> {
    let fail = |what: String| DatasetError::new(path, what, "download the file again");
    let file = Hdf5::with_arrays_of(path, MAX_BYTES).map_err(DatasetError::of_array)?;
    let numbers = |name: &str, count: usize| {
        let found = (file.array(name).map_err(DatasetError::of_array)?).to_vec();
        if found.len() != count || !found.iter().all(|value| value.is_finite()) {
            return Err(fail(format!("`{name}` is not {count} finite numbers")));
        }
        Ok(found)
    };
    let (k, r, t) = (numbers("K", 9)?, numbers("R", 9)?, numbers("T", 3)?);
    Ok((
        list::camera(&k).map_err(fail)?,
        motion(&r, &t).map_err(fail)?,
    ))
}

/// [R t] from nine and three numbers.
fn motion(r: &[f64], t: &[f64]) -> Result<Isometry3<f64>, String> {
    text::rigid_motion(&std::array::from_fn(|k| match k % 4 {
        3 => t[k / 4],
        column => r[k / 4 * 3 + column],
    }))
}

/// A line of `train_labels.csv`.
struct Label<'a> {
    dataset: &'a str,
    scene: &'a str,
    image: &'a str,
    rotation: &'a str,
    translation: &'a str,
}

fn read_labels(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let file = TextFile::read(src)?;
    let mut rows = file.rows();
    let heads = rows.next().map_or("", |(_, row)| row);
    let heads: Vec<&str> = heads.split(',').map(str::trim).collect();
    let column = |name: &str| {
        heads.iter().position(|head| *head == name).ok_or_else(|| {
            let what = format!("the first line has no column `{name}`");
            file.error(what, "give the train_labels.csv of the challenge of 2025")
        })
    };
    let columns = [
        "dataset",
        "scene",
        "image",
        "rotation_matrix",
        "translation_vector",
    ]
    .map(column);
    let [dataset, scene, image, rotation, translation] = columns;
    let columns = [dataset?, scene?, image?, rotation?, translation?];
    let mut labels = Vec::new();
    for (line, row) in rows {
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        if cells.len() != heads.len() {
            let what = format!(
                "{} where {} are expected",
                counted(cells.len(), "column"),
                heads.len()
            );
            return Err(file.error_at(line, what));
        }
        let [dataset, scene, image, rotation, translation] = columns.map(|column| cells[column]);
        labels.push((
            line,
            Label {
                dataset,
                scene,
                image,
                rotation,
                translation,
            },
        ));
    }
    let wanted = choose(&file, &labels, options.sequence.as_deref())?;
    labels.retain(|(_, label)| (label.dataset, label.scene) == wanted);

    let beside = src.parent().unwrap_or(Path::new("")).join("train");
    let root = options.root(&beside);
    let given = given_camera(src, options, &[])?;
    let mut frames = Vec::new();
    let mut left_out = Vec::new();
    for (line, label) in labels {
        let numbers = |cell: &str| cell.split(';').map(str::trim).collect::<Vec<_>>().join(" ");
        let (r, t) = (numbers(label.rotation), numbers(label.translation));
        if [&r, &t]
            .iter()
            .any(|cell| cell.split_whitespace().all(|word| word == "nan"))
        {
            left_out.push(label.image.to_owned());
            continue;
        }
        let pose = text::exactly::<9>(&r)
            .and_then(|r| motion(&r, &text::exactly::<3>(&t)?))
            .map_err(|what| file.error_at(line, what))?;
        let image = root.join(label.dataset).join(label.image);
        let camera = match given {
            Some(camera) => camera,
            None => list::stand_in(read_size(&image).map_err(|error| DatasetError {
                remedy: format!("without K ({}) the images are needed", ImportOption::Camera),
                ..error
            })?),
        };
        frames.push(Frame::with_pose(image, camera, pose.inverse()));
    }
    let mut notes: Vec<String> = images_left_out("without a pose", &left_out)
        .into_iter()
        .collect();
    if given.is_none() {
        notes.push(format!("{}; poses found with it are rough", list::STAND_IN));
    }
    Ok(Imported {
        about: About {
            origin: format!("Image Matching Challenge 2025, {}/{}", wanted.0, wanted.1),
            notes,
            ..About::default()
        },
        sequence: Some(format!("{}/{}", wanted.0, wanted.1)),
        ..Imported::of(frames)
    })
}

/// The scene that was asked for, or the only one.
fn choose<'a>(
    file: &TextFile,
    labels: &[(usize, Label<'a>)],
    wanted: Option<&str>,
) -> Result<(&'a str, &'a str), DatasetError> {
    let scenes = labels.iter().map(|(_, label)| (label.dataset, label.scene));
    let scenes: BTreeSet<(&str, &str)> = scenes.filter(|(_, scene)| *scene != "outliers").collect();
    let is_wanted = |scene: &&(&str, &str)| {
        wanted
            .is_none_or(|wanted| wanted == scene.0 || wanted == format!("{}/{}", scene.0, scene.1))
    };
    let found: Vec<_> = scenes.iter().filter(is_wanted).copied().collect();
    if let [scene] = found[..] {
        return Ok(scene);
    }
    let names: Vec<_> = scenes
        .iter()
        .take(40)
        .map(|(set, scene)| format!("{set}/{scene}"))
        .collect();
    let what = if found.is_empty() {
        "there is no such scene"
    } else {
        "there are several scenes"
    };
    let remedy = format!(
        "choose by {} one of {}",
        ImportOption::Sequence,
        names.join(", ")
    );
    Err(file.error(what, remedy))
}
