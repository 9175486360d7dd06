//! The built-in dataset as files, rendered on first use.
//!
//! A sequence is written into a folder beside its place and renamed when complete, so a process
//! that is killed leaves nothing half-written under a sequence's name. A stamp names the revision
//! of the renderer: an older sequence is rendered again.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use image::{ColorType, ImageError};
use matchbench_vision::image::GrayImage;
use nalgebra::Isometry3;
use rayon::prelude::*;
use thiserror::Error;

use super::{Place, REVISION, RenderedScene, World, sequences};

/// The file that says which revision a sequence was rendered by.
const STAMP: &str = "rendered.txt";

/// How far [`ensure`] has come; counts frames of the sequences that have to be rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Frames written.
    pub done: u32,
    /// Frames to be written.
    pub total: u32,
}

/// Why the built-in dataset could not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The file system refused.
    #[error("cannot write the built-in dataset to {path}: {source}")]
    Io {
        /// The file or folder in question.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// An image could not be encoded or written.
    #[error("cannot write the image {path}: {source}")]
    Image {
        /// The image file.
        path: PathBuf,
        /// What the encoder says.
        source: ImageError,
    },
}

/// Makes sure that all sequences lie in `cache`, one folder each, and returns the folders in the
/// order of [`sequences`]. Complete sequences of this [`REVISION`] are left alone; the others are
/// rendered with all threads of the current rayon pool. `observer` is called after each frame,
/// from any thread.
///
/// # Errors
/// If a file or folder cannot be written.
pub fn ensure(
    cache: &Path,
    observer: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<PathBuf>, RenderError> {
    ensure_scenes(cache, sequences(), observer)
}

fn ensure_scenes(
    cache: &Path,
    scenes: &[RenderedScene],
    observer: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<PathBuf>, RenderError> {
    fs::create_dir_all(cache).map_err(|source| io_error(cache, source))?;
    let missing: Vec<&RenderedScene> = scenes
        .iter()
        .filter(|scene| !is_complete(&cache.join(scene.name)))
        .collect();
    let total = missing.iter().map(|scene| scene.frames).sum();
    let done = AtomicU32::new(0);
    for place in Place::ALL {
        let mut world = None; // built once, and only if a sequence needs it
        for scene in missing.iter().filter(|scene| scene.place == place) {
            let world = world.get_or_insert_with(|| World::build(place));
            write_sequence(cache, scene, world, &|| {
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                observer(Progress { done, total });
            })?;
        }
    }
    Ok(scenes.iter().map(|scene| cache.join(scene.name)).collect())
}

fn stamp() -> String {
    format!("matchbench rendered scenes, revision {REVISION}\n")
}

fn is_complete(folder: &Path) -> bool {
    fs::read_to_string(folder.join(STAMP)).is_ok_and(|text| text == stamp())
}

fn write_sequence(
    cache: &Path,
    scene: &RenderedScene,
    world: &World,
    written: &(dyn Fn() + Sync),
) -> Result<(), RenderError> {
    let beside = tempfile::Builder::new()
        .prefix(&format!(".{}-", scene.name))
        .tempdir_in(cache)
        .map_err(|source| io_error(cache, source))?;
    let images = beside.path().join("Images");
    fs::create_dir(&images).map_err(|source| io_error(&images, source))?;
    (0..scene.frames).into_par_iter().try_for_each(|frame| {
        let path = images.join(format!("{frame:04}.png"));
        write_png(&path, &world.render(scene, frame))?;
        written();
        Ok(())
    })?;

    let poses: Vec<Isometry3<f64>> = (0..scene.frames)
        .map(|i| scene.world_from_camera(i))
        .collect();
    let poses = poses
        .iter()
        .fold(String::new(), |text, pose| text + &pose_row(pose) + "\n");
    let pairs = scene.pairs().iter().fold(String::new(), |mut text, pair| {
        let _ = writeln!(text, "{} {} {}", pair.a, pair.b, pose_row(&pair.b_from_a));
        text
    });
    let k = scene.camera().matrix();
    let camera = (0..3).fold(String::new(), |mut text, i| {
        let _ = writeln!(text, "{} {} {}", k[(i, 0)], k[(i, 1)], k[(i, 2)]);
        text
    });
    for (name, text) in [
        ("Images/pose.txt", &poses),
        ("camera.txt", &camera),
        ("pairs.txt", &pairs),
        (STAMP, &stamp()),
    ] {
        let path = beside.path().join(name);
        fs::write(&path, text).map_err(|source| io_error(&path, source))?;
    }
    put_in_place(beside, &cache.join(scene.name))
}

/// Renames the finished folder to its name, replacing what an older revision left there.
fn put_in_place(beside: tempfile::TempDir, folder: &Path) -> Result<(), RenderError> {
    if folder.exists() {
        if is_complete(folder) {
            return Ok(()); // another process was faster; both rendered the same bits
        }
        fs::remove_dir_all(folder).map_err(|source| io_error(folder, source))?;
    }
    let finished = beside.keep();
    fs::rename(&finished, folder).or_else(|source| {
        let _ = fs::remove_dir_all(&finished);
        if is_complete(folder) {
            Ok(())
        } else {
            Err(io_error(folder, source))
        }
    })
}

/// The 3x4 matrix of a pose, row after row.
fn pose_row(pose: &Isometry3<f64>) -> String {
    let matrix = pose.to_homogeneous();
    let numbers: Vec<String> = (0..12)
        .map(|i| format!("{:.12}", matrix[(i / 4, i % 4)]))
        .collect();
    numbers.join(" ")
}

fn write_png(path: &Path, image: &GrayImage) -> Result<(), RenderError> {
    image::save_buffer(
        path,
        image.data(),
        image.width() as u32,
        image.height() as u32,
        ColorType::L8,
    )
    .map_err(|source| RenderError::Image {
        path: path.to_owned(),
        source,
    })
}

fn io_error(path: &Path, source: io::Error) -> RenderError {
    RenderError::Io {
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use matchbench_vision::image::Size;

    use super::*;

    fn tiny_scenes() -> Vec<RenderedScene> {
        let in_cabinet = sequences()
            .iter()
            .filter(|scene| scene.place == Place::Cabinet);
        in_cabinet
            .map(|scene| RenderedScene {
                size: Size::new(16, 12),
                frames: 3,
                ..scene.clone()
            })
            .collect()
    }

    fn rendered(cache: &Path, scenes: &[RenderedScene]) -> u32 {
        let frames = AtomicU32::new(0);
        ensure_scenes(cache, scenes, &|_| {
            frames.fetch_add(1, Ordering::Relaxed);
        })
        .expect("a temporary folder can be written");
        frames.into_inner()
    }

    #[test]
    fn renders_what_is_missing_and_nothing_twice() {
        let cache = tempfile::tempdir().expect("a temporary folder");
        let scenes = tiny_scenes();
        assert_eq!(rendered(cache.path(), &scenes), 6);
        assert_eq!(rendered(cache.path(), &scenes), 0);
        let folder = cache.path().join("cabinet");
        let first = fs::read(folder.join("Images/0001.png")).expect("an image");

        // What a copy that was cut off, or an older revision, leaves behind.
        fs::remove_file(folder.join(STAMP)).expect("the stamp");
        fs::remove_file(folder.join("Images/0001.png")).expect("an image");
        assert_eq!(rendered(cache.path(), &scenes), 3);
        assert_eq!(
            fs::read(folder.join("Images/0001.png")).expect("an image"),
            first
        );
        fs::write(
            folder.join(STAMP),
            "matchbench rendered scenes, revision 0\n",
        )
        .expect("a stamp");
        assert_eq!(rendered(cache.path(), &scenes), 3);

        let left = fs::read_dir(cache.path()).expect("the cache").count();
        assert_eq!(left, scenes.len(), "no temporary folders stay");
    }

    #[test]
    fn writes_the_authors_layout() {
        let cache = tempfile::tempdir().expect("a temporary folder");
        let scenes = &tiny_scenes()[..1];
        rendered(cache.path(), scenes);
        let read = |name: &str| -> Vec<Vec<f64>> {
            let text = fs::read_to_string(cache.path().join("cabinet").join(name));
            let numbers = |line: &str| {
                line.split(' ')
                    .map(|n| n.parse().expect("a number"))
                    .collect()
            };
            text.expect("the file").lines().map(numbers).collect()
        };
        let shape = |rows: &[Vec<f64>]| (rows.len(), rows[0].len());
        assert_eq!(shape(&read("Images/pose.txt")), (3, 12));
        assert_eq!(shape(&read("camera.txt")), (3, 3));
        assert_eq!(shape(&read("pairs.txt")), (2, 14));
        let (pair, pose) = (&read("pairs.txt")[0], scenes[0].pairs()[0]);
        assert_eq!((pair[0], pair[1]), (0.0, 1.0));
        assert!((pair[5] - pose.b_from_a.translation.x).abs() < 1e-11);
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let error = ensure_scenes(file.path(), &tiny_scenes(), &|_| ()).expect_err("a file");
        let name = file.path().display().to_string();
        assert!(error.to_string().contains(&name), "{error}");
    }
}
