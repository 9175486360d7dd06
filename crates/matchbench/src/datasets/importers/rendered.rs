//! The built-in scenes, by their names: the scenes of `matchbench demo` as datasets of their own.

use std::path::Path;

use super::{ImportOptions, Imported, Kind};
use crate::datasets::rendered::{REVISION, Scene, World, scenes, sequence};
use crate::datasets::{About, DatasetError, ImageStorage, Sequence, write_native};
use crate::front_door::IMAGES;

/// Id of the kind. Its sources are names, not files.
pub(crate) const RENDERED: &str = "rendered";

/// The frames and pairs of the scene called `src`.
pub(super) fn read(src: &Path, _: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let Some(scene) = called(src) else {
        let names: Vec<&str> = scenes().iter().map(|scene| scene.name).collect();
        return Err(DatasetError::new(
            src,
            "no built-in scene has this name",
            format!("use one of {}", names.join(", ")),
        ));
    };
    let Sequence { frames, pairs, .. } = sequence(scene);
    let origin = format!(
        "rendered by matchbench, revision {REVISION}: {}",
        scene.description
    );
    Ok(Imported::listed(origin, frames, pairs))
}

/// The scene that an import of this kind from `src` makes, if it makes one.
pub(super) fn scene(kind: &Kind, src: &Path) -> Option<&'static Scene> {
    called(src).filter(|_| kind.id == RENDERED)
}

/// Renders the images into the new dataset `out`.
pub(super) fn write(
    out: &Path,
    scene: &Scene,
    sequence: &Sequence,
    about: &About,
    images: ImageStorage<'_>,
) -> Result<(), DatasetError> {
    if matches!(images, ImageStorage::Link | ImageStorage::Copy) {
        return Err(DatasetError::new(
            IMAGES.to_string(),
            "a rendered scene has no images elsewhere",
            "leave it out",
        ));
    }
    let world = World::build(scene.place);
    let pixels = |frame: usize| world.render(scene, frame as u32);
    let depth = |frame: usize| world.depth(scene, frame as u32);
    let storage = ImageStorage::Rendered {
        pixels: &pixels,
        depth: &depth,
    };
    write_native(out, sequence, about, storage)
}

fn called(src: &Path) -> Option<&'static Scene> {
    let name = src.to_str()?;
    scenes().iter().find(|scene| scene.name == name)
}

#[cfg(test)]
mod tests {
    use super::super::{import, import_once};
    use super::*;

    #[test]
    fn a_scene_is_imported_as_the_demo_renders_it() {
        let folder = tempfile::tempdir().unwrap();
        let scene = (scenes().iter())
            .min_by_key(|scene| scene.frames as usize * scene.size.width * scene.size.height)
            .unwrap();
        let out = folder.path().join(scene.name);
        let options = ImportOptions::default();
        let copied = ImportOptions {
            images: ImageStorage::Copy,
            ..ImportOptions::default()
        };
        let name = Path::new(scene.name);
        assert!(import(RENDERED, name, &out, &copied).is_err());
        import(RENDERED, name, &out, &options).unwrap();
        let (imported, whole) = (Sequence::open(&out).unwrap(), sequence(scene));
        assert_eq!(imported.frames.len(), scene.frames as usize);
        assert_eq!(imported.pairs.len(), whole.pairs.len());
        assert!(imported.frames.iter().all(|frame| frame.image.is_file()));
        let again = import_once(RENDERED, name, &out, &options);
        assert_eq!(again.unwrap(), None, "it is there already");
        let about = crate::datasets::describe(&out).unwrap();
        assert_eq!(about.import, [RENDERED, scene.name]);
        assert!(about.notes.is_empty(), "{:?}", about.notes);
        let unknown = import(
            RENDERED,
            Path::new("nowhere"),
            &folder.path().join("x"),
            &options,
        );
        assert!(unknown.unwrap_err().remedy.contains(scene.name));
    }
}
