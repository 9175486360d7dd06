//! The built-in dataset: the scenes of `matchbench-scenes` as sequences, rendered into files on first use.
//!
//! A sequence gets its name only when it is complete ([`write_native`]), so a process that is killed leaves
//! nothing half-written. Each [`REVISION`] of the renderer has its own folder, and so has each change of the
//! other files of a sequence.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

pub use matchbench_scenes::{Pairing, Place, REVISION, Scene, World, scenes};

use super::{
    About, DatasetError, DepthFile, DepthUnit, Frame, ImageStorage, PairRule, Sequence, Truth,
    write_native,
};

/// Increased with every change of the files of a sequence other than its images; 2 added depth.
const CONTENTS: u32 = 2;

/// The folder in `cache` for all sequences in their current form.
fn folder_of_now(cache: &Path) -> PathBuf {
    cache.join(format!("revision-{REVISION}.{CONTENTS}"))
}

/// The frames and pairs of a scene with their true poses, and with homographies if the scene is a plane. The
/// images are made by [`World::render`].
pub fn sequence(scene: &Scene) -> Sequence {
    let depth = DepthFile {
        path: PathBuf::new(),
        unit: depth_unit(scene),
    };
    let frames = (0..scene.frames)
        .map(|frame| {
            let pose = scene.world_from_camera(frame);
            Frame::with_pose("", scene.camera(), pose).with_depth(Some(depth.clone()))
        })
        .collect();
    let (frames, mut pairs) = (PairRule::from(scene.pairing).apply(frames))
        .expect("all frames have poses, and no rule reads a file");
    for pair in &mut pairs {
        if let (Truth::Pose(b_from_a), Some(homography)) =
            (pair.truth, scene.homography(pair.a, pair.b))
        {
            pair.truth = Truth::Both {
                b_from_a,
                homography,
            };
        }
    }
    Sequence {
        name: scene.name.into(),
        frames,
        pairs,
    }
}

/// How the depth of a scene is stored, with the best resolution that 16 bits allow: a fifth of a millimetre for
/// depths up to 13 metres, or one millimetre up to 65 metres.
fn depth_unit(scene: &Scene) -> DepthUnit {
    let per_unit = match scene.place {
        Place::Street | Place::Facade => 1000.0,
        Place::Office | Place::Object | Place::Cabinet | Place::Mural | Place::Tiling => 5000.0,
    };
    DepthUnit {
        per_unit,
        invalid: None,
    }
}

impl From<Pairing> for PairRule {
    fn from(pairing: Pairing) -> Self {
        match pairing {
            Pairing::Fragments { length } => Self::Fragments { length },
            Pairing::All => Self::All,
            Pairing::Window { size } => Self::Window { size, stride: 1 },
        }
    }
}

/// The progress of [`ensure`], in frames of the sequences that have to be rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Frames rendered.
    pub done: u32,
    /// Frames to be rendered.
    pub total: u32,
}

/// Makes sure that all sequences are in `cache`, and returns their folders in the order of [`scenes`]. Existing
/// sequences are not changed. The others are rendered with all threads of the current rayon pool. `observer` is
/// called after each frame, from any thread.
///
/// # Errors
/// If a file or folder cannot be written.
pub fn ensure(
    cache: &Path,
    observer: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<PathBuf>, DatasetError> {
    ensure_scenes(cache, scenes(), observer)
}

/// As [`ensure`], for scenes that the caller gives. They may have fewer frames or another size than those of
/// [`scenes`]; then they need their own `cache`.
///
/// # Errors
/// If a file or folder cannot be written.
pub fn ensure_scenes(
    cache: &Path,
    scenes: &[Scene],
    observer: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<PathBuf>, DatasetError> {
    let folder = |scene: &Scene| folder_of_now(cache).join(scene.name);
    let missing: Vec<&Scene> = scenes
        .iter()
        .filter(|scene| !folder(scene).exists())
        .collect();
    let total = missing.iter().map(|scene| scene.frames).sum();
    let done = AtomicU32::new(0);
    for place in Place::ALL {
        let mut world = None; // built once, and only if a sequence needs it
        for scene in missing.iter().filter(|scene| scene.place == place) {
            let world = world.get_or_insert_with(|| World::build(place));
            let pixels = |frame: usize| {
                let image = world.render(scene, frame as u32);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                observer(Progress { done, total });
                image
            };
            let about = About {
                origin: format!(
                    "rendered by matchbench, revision {REVISION}: {}",
                    scene.description
                ),
                notes: Vec::new(),
                ..About::default()
            };
            let out = folder(scene);
            let depth = |frame: usize| world.depth(scene, frame as u32);
            let storage = ImageStorage::Rendered {
                pixels: &pixels,
                depth: &depth,
            };
            write_native(&out, &sequence(scene), &about, storage)
                // Another process may have been faster. Both render the same bits.
                .or_else(|error| if out.exists() { Ok(()) } else { Err(error) })?;
        }
    }
    Ok(scenes.iter().map(folder).collect())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use matchbench_vision::image::Size;

    use super::super::{Severity, validate};
    use super::*;

    fn tiny_scenes() -> Vec<Scene> {
        let mut tiny = scenes().to_vec();
        tiny.retain(|scene| scene.place == Place::Cabinet);
        for scene in &mut tiny {
            scene.size = Size::new(16, 12);
            scene.frames = 3;
        }
        tiny
    }

    fn rendered(cache: &Path, scenes: &[Scene]) -> u32 {
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
        let folder = folder_of_now(cache.path());
        let image = folder.join("cabinet/Images/0001.png");
        let first = fs::read(&image).expect("an image");
        fs::remove_dir_all(folder.join("cabinet")).expect("it is there");
        assert_eq!(rendered(cache.path(), &scenes), 3);
        assert_eq!(fs::read(&image).expect("an image"), first);
        let left = fs::read_dir(folder).expect("the folder").count();
        assert_eq!(left, scenes.len(), "no temporary folders stay");
    }

    #[test]
    fn what_is_written_can_be_opened() {
        let cache = tempfile::tempdir().expect("a temporary folder");
        let scenes = &tiny_scenes()[..1];
        let folders = ensure_scenes(cache.path(), scenes, &|_| ()).expect("writable");
        let opened = Sequence::open(&folders[0]).expect("written just now");
        let expected = sequence(&scenes[0]);
        assert_eq!(
            (opened.name, opened.pairs.len()),
            (expected.name, expected.pairs.len())
        );
        for (pair, truth) in opened.pairs.iter().zip(&expected.pairs) {
            assert_eq!((pair.a, pair.b), (truth.a, truth.b));
            let difference =
                pair.pose().unwrap().to_homogeneous() - truth.pose().unwrap().to_homogeneous();
            assert!(difference.amax() < 1e-12);
        }
        let mut problems = validate(&folders[0]);
        problems.retain(|problem| problem.severity == Severity::Error);
        assert_eq!(problems, []);
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let error = ensure_scenes(file.path(), &tiny_scenes(), &|_| ()).expect_err("a file");
        let name = file.path().display().to_string();
        assert!(error.to_string().contains(&name), "{error}");
    }

    #[test]
    fn pairs_follow_their_rules() {
        let ends = |name: &str| -> Vec<(u32, u32)> {
            let found = scenes().iter().find(|scene| scene.name == name);
            let pairs = sequence(found.expect("a scene of that name")).pairs;
            pairs.iter().map(|pair| (pair.a, pair.b)).collect()
        };
        assert_eq!(ends("office").len(), 3 * 9);
        assert_eq!(ends("office")[8..10], [(0, 9), (10, 11)]);
        assert_eq!(ends("street").len(), 5 * 4);
        assert_eq!(ends("facade").len(), 12 * 11 / 2);
        assert_eq!(ends("mural").len(), 4 * 5);
        assert_eq!(ends("tiling")[4..6], [(0, 5), (6, 7)]);
        assert_eq!(ends("office-wide").len(), 14 * 4 - 10);
        assert_eq!(ends("office-wide").last(), Some(&(12, 13)));
    }
}
