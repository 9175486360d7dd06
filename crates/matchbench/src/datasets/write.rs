//! Writes a dataset in the authors' layout.
//!
//! Everything is written into a hidden folder beside the new one, which is renamed at the end. So an import
//! that is killed leaves no incomplete dataset. Numbers are printed with as many digits as are needed to read
//! the same numbers back.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::Path;

use image::ExtendedColorType;
use matchbench_vision::geometry::Camera;
use matchbench_vision::image::{FloatImage, GrayImage, Size};
use rayon::prelude::*;

use super::bring::{Kind, bring, former_names, refer_to_images};
use super::depth::{DepthUnit, stored_value};
use super::images::IMAGES;
use super::manifest::{self, Manifest, ManifestFrame};
use super::native::{CAMERA, HOMOGRAPHIES, PAIRS, POSES};
use super::text::matrix_rows;
use super::{About, DatasetError, Frame, Sequence};
use crate::files::HiddenFolder;

const INFALLIBLE: &str = "writing to a string cannot fail";

/// Where the images of a new dataset are stored.
#[derive(Clone, Copy, Default)]
pub enum ImageStorage<'a> {
    /// At their old paths, which `dataset.toml` names. They may also be added later.
    #[default]
    Reference,
    /// `Images/%04d.*` are links to the images (hard links if the system has no others).
    Link,
    /// `Images/%04d.*` are copies of the images.
    Copy,
    /// `Images/%04d.png` are made by these functions of the index of a frame, and so is `Depth/%04d.png` of all
    /// frames if any has depth. The paths in the frames are ignored.
    Rendered {
        /// The image of a frame.
        pixels: &'a (dyn Fn(usize) -> GrayImage + Sync),
        /// The depth of a frame in the unit of length of the poses; infinite where there is nothing.
        depth: &'a (dyn Fn(usize) -> FloatImage + Sync),
    },
}

/// The folder of numbered depth files in a dataset.
pub(super) const DEPTH: &str = "Depth";

impl std::fmt::Debug for ImageStorage<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Reference => "Reference",
            Self::Link => "Link",
            Self::Copy => "Copy",
            Self::Rendered { .. } => "Rendered(..)",
        })
    }
}

/// Writes `sequence` as the new folder `out`. The name of the folder becomes the name of the dataset
/// (`sequence.name` is ignored).
///
/// # Errors
/// If `out` exists and is not empty, if an image cannot be found, or if a file cannot be written.
pub fn write_native(
    out: &Path,
    sequence: &Sequence,
    about: &About,
    images: ImageStorage<'_>,
) -> Result<(), DatasetError> {
    let occupied = match fs::read_dir(out) {
        Ok(mut entries) => entries.next().is_some(),
        Err(_) => out.exists(),
    };
    if occupied {
        return Err(is_occupied(out));
    }
    write_folder(out, |folder| write_files(folder, sequence, about, images))
}

/// Makes the folder `out`: `write` fills another folder beside it, which is then renamed. So an interrupted
/// call leaves nothing that would stop the next one.
pub(super) fn write_folder(
    out: &Path,
    write: impl FnOnce(&Path) -> Result<(), DatasetError>,
) -> Result<(), DatasetError> {
    let hidden = HiddenFolder::beside(out).map_err(|error| DatasetError::io(out, &error))?;
    let staged = hidden.path();
    write(&staged)?;
    put(&staged, out)
}

/// Moves a finished folder to its name. An empty folder of this name may exist.
fn put(staged: &Path, out: &Path) -> Result<(), DatasetError> {
    let emptied = if out.exists() {
        fs::remove_dir(out)
    } else {
        Ok(())
    };
    (emptied.and_then(|()| fs::rename(staged, out))).map_err(|error| match error.kind() {
        // Another program was faster.
        io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::AlreadyExists => is_occupied(out),
        _ => DatasetError::io(out, &error),
    })
}

fn is_occupied(out: &Path) -> DatasetError {
    DatasetError::new(
        out,
        "there is something already",
        "give another folder or remove this one",
    )
}

fn write_files(
    dir: &Path,
    sequence: &Sequence,
    about: &About,
    images: ImageStorage<'_>,
) -> Result<(), DatasetError> {
    let folder = dir.join(IMAGES);
    fs::create_dir_all(&folder).map_err(|error| DatasetError::io(&folder, &error))?;
    let mut manifest = describe(sequence, about);
    let depth = dir.join(DEPTH);
    manifest.depth = depth_unit(sequence, dir)?;
    if manifest.depth.is_some() && !matches!(images, ImageStorage::Reference) {
        fs::create_dir_all(&depth).map_err(|error| DatasetError::io(&depth, &error))?;
    }
    match images {
        ImageStorage::Reference => refer_to_images(&mut manifest, sequence)?,
        ImageStorage::Link | ImageStorage::Copy => {
            let names = former_names(&sequence.frames)?;
            let is_copied = matches!(images, ImageStorage::Copy);
            for (index, frame) in sequence.frames.iter().enumerate() {
                let name = bring(&frame.image, Kind::Image, &folder, index, is_copied)?;
                let former = names[index]
                    .as_deref()
                    .filter(|former| Path::new(former) != name);
                if let Some(former) = former {
                    let frames = &mut manifest.frames;
                    frames.resize(sequence.frames.len(), ManifestFrame::default());
                    frames[index].name = Some(former.to_owned());
                }
                if let Some(file) = &frame.depth {
                    let name = bring(&file.path, Kind::Depth, &depth, index, is_copied)?;
                    manifest.frames[index].depth = Some(Path::new(DEPTH).join(name));
                }
            }
        }
        ImageStorage::Rendered {
            pixels,
            depth: make,
        } => {
            (0..sequence.frames.len())
                .into_par_iter()
                .try_for_each(|i| save_image(&folder.join(numbered(i)), &pixels(i)))?;
            if let Some(unit) = manifest.depth {
                (0..sequence.frames.len())
                    .into_par_iter()
                    .try_for_each(|i| save_depth(&depth.join(numbered(i)), &make(i), unit))?;
                for (index, frame) in manifest.frames.iter_mut().enumerate() {
                    frame.depth = Some(Path::new(DEPTH).join(numbered(index)));
                }
            }
        }
    }
    if let Some(first) = sequence.frames.first() {
        write_file(&dir.join(CAMERA), &camera_text(&first.camera))?;
    }
    let poses: Option<String> = sequence
        .frames
        .iter()
        .map(|frame| Some(row(&matrix_rows(frame.world_from_camera.as_ref()?))))
        .collect();
    if let Some(poses) = poses {
        write_file(&folder.join(POSES), &poses)?;
    }
    let (mut posed, mut mapped) = (String::new(), String::new());
    for pair in &sequence.pairs {
        if let Some(b_from_a) = pair.pose() {
            let motion = row(&matrix_rows(b_from_a));
            write!(posed, "{} {} {motion}", pair.a, pair.b).expect(INFALLIBLE);
        }
        if let Some(homography) = pair.homography() {
            let rows = row(homography.transpose().as_slice());
            write!(mapped, "{} {} {rows}", pair.a, pair.b).expect(INFALLIBLE);
        }
    }
    if !posed.is_empty() || mapped.is_empty() {
        write_file(&dir.join(PAIRS), &posed)?;
    }
    if !mapped.is_empty() {
        write_file(&dir.join(HOMOGRAPHIES), &mapped)?;
    }
    let manifest = toml::to_string(&manifest).expect("a manifest is plain TOML");
    write_file(&dir.join(manifest::FILE), &manifest)
}

/// The manifest without image paths: one camera for all, or one per frame.
fn describe(sequence: &Sequence, about: &About) -> Manifest {
    let first = sequence.frames.first().map(|frame| frame.camera);
    let shared = sequence.frames.iter().all(|f| Some(f.camera) == first);
    let plain =
        |frame: &Frame| frame.turn.is_none() && frame.depth.is_none() && frame.name.is_none();
    let frames = if shared && sequence.frames.iter().all(plain) {
        Vec::new()
    } else {
        let own = |frame: &Frame| ManifestFrame {
            image: None,
            name: frame.name.clone(),
            depth: None,
            camera: (!shared).then_some(frame.camera),
            turn: frame.turn,
        };
        sequence.frames.iter().map(own).collect()
    };
    Manifest {
        origin: Some(about.origin.clone()),
        property: (!about.property.is_empty()).then(|| about.property.clone()),
        import: about.import.clone(),
        notes: about.notes.clone(),
        distortion: first.filter(|_| shared).and_then(|c| c.distortion),
        frames,
        ..Manifest::default()
    }
}

/// How the depth of a sequence is stored, if it has any.
fn depth_unit(sequence: &Sequence, dir: &Path) -> Result<Option<DepthUnit>, DatasetError> {
    let mut units = (sequence.frames.iter()).filter_map(|frame| Some(frame.depth.as_ref()?.unit));
    let first = units.next();
    if units.all(|unit| Some(unit) == first) {
        return Ok(first);
    }
    let what = "the depth of its frames is stored in different ways";
    Err(DatasetError::new(
        dir,
        what,
        "make datasets of one way each",
    ))
}

/// The name of the file of a frame that is made here.
fn numbered(index: usize) -> String {
    format!("{index:04}.png")
}

fn save_image(path: &Path, image: &GrayImage) -> Result<(), DatasetError> {
    save_png(path, image.data(), image.size(), ExtendedColorType::L8)
}

fn save_depth(path: &Path, depth: &FloatImage, unit: DepthUnit) -> Result<(), DatasetError> {
    let stored: Vec<u8> = (depth.data().iter())
        .flat_map(|&depth| stored_value(depth, unit).to_ne_bytes())
        .collect();
    save_png(path, &stored, depth.size(), ExtendedColorType::L16)
}

fn save_png(
    path: &Path,
    bytes: &[u8],
    size: Size,
    colour: ExtendedColorType,
) -> Result<(), DatasetError> {
    image::save_buffer(path, bytes, size.width as u32, size.height as u32, colour)
        .map_err(|error| DatasetError::new(path, error.to_string(), "check the disk and try again"))
}

fn camera_text(camera: &Camera) -> String {
    let Camera { fx, fy, cx, cy, .. } = camera;
    format!("{fx:?} 0 {cx:?}\n0 {fy:?} {cy:?}\n0 0 1\n")
}

/// `Debug` prints the shortest text that reads back as the same number.
fn row(numbers: &[f64]) -> String {
    let mut row = String::new();
    for (k, number) in numbers.iter().enumerate() {
        let gap = if k == 0 { "" } else { " " };
        write!(row, "{gap}{number:?}").expect(INFALLIBLE);
    }
    row.push('\n');
    row
}

fn write_file(path: &Path, text: &str) -> Result<(), DatasetError> {
    fs::write(path, text).map_err(|error| DatasetError::io(path, &error))
}

#[cfg(test)]
mod tests {
    use super::super::{Pair, Turn, read_gray, testing, validate};
    use super::*;

    #[test]
    fn a_folder_that_another_program_has_filled_meanwhile_stays() {
        let (folder, dir) = testing::dataset();
        let staged = folder.path().join("staged");
        fs::create_dir(&staged).unwrap();
        let error = put(&staged, &dir).unwrap_err();
        assert!(error.what.contains("something already"), "{error}");
        assert!(staged.is_dir() && dir.join(PAIRS).is_file());
    }

    #[test]
    fn a_folder_that_breaks_off_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let broken = write_folder(&out, |staged| {
            write_file(&staged.join("first"), "")?;
            Err(is_occupied(staged))
        });
        assert!(broken.is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        write_folder(&out, |staged| write_file(&staged.join("first"), "")).unwrap();
        assert!(out.join("first").is_file());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_is_written_reads_back() {
        let (_folder, dir) = testing::dataset();
        assert_eq!(validate(&dir), []);
        let found = Sequence::open(&dir).unwrap();
        let expected = testing::sequence(4);
        assert_eq!(found.name, "small");
        assert_eq!(
            (found.frames.len(), found.pairs.len()),
            (4, expected.pairs.len())
        );
        for (index, (f, e)) in found.frames.iter().zip(&expected.frames).enumerate() {
            let (found, expected) = (f.world_from_camera.unwrap(), e.world_from_camera.unwrap());
            assert!((found.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-15);
            assert_eq!(f.camera, e.camera);
            assert_eq!(read_gray(&f.image).unwrap(), testing::pixels(index));
        }
        for (f, e) in found.pairs.iter().zip(&expected.pairs) {
            assert_eq!((f.a, f.b), (e.a, e.b));
            let (f, e) = (f.pose().unwrap(), e.pose().unwrap());
            assert_eq!(f.translation, e.translation);
            let turn = f.to_homogeneous() - e.to_homogeneous();
            assert!(turn.amax() < 1e-15);
        }
    }

    #[test]
    fn numbers_are_printed_so_that_they_read_back() {
        let numbers = [
            0.1 + 0.2,
            -1.0 / 3.0,
            9.04368e-12,
            1e300,
            0.0,
            -0.0,
            f64::MIN_POSITIVE,
        ];
        let text = row(&numbers);
        let words: Vec<&str> = text.split_whitespace().collect();
        let back: [&str; 7] = words.try_into().unwrap();
        let back = back.map(|word| word.parse().unwrap());
        assert_eq!(back.map(f64::to_bits), numbers.map(f64::to_bits), "{text}");
    }

    #[test]
    fn images_are_referenced_linked_or_copied() {
        let (folder, source) = testing::dataset();
        let sequence = Sequence::open(&source).unwrap();
        for (name, storage) in [
            ("reference", ImageStorage::Reference),
            ("link", ImageStorage::Link),
            ("copy", ImageStorage::Copy),
        ] {
            let out = folder.path().join("new").join(name);
            write_native(&out, &sequence, &About::default(), storage).unwrap();
            assert_eq!(validate(&out), [], "{name}");
            let found = Sequence::open(&out).unwrap();
            assert_eq!(found.pairs.len(), sequence.pairs.len());
            let own = found.frames[3].image == out.join("Images/0003.png");
            assert_eq!(own, name != "reference");
        }
        fs::remove_dir_all(&source).unwrap();
        let open = |name: &str| Sequence::open(&folder.path().join("new").join(name));
        assert!(open("copy").is_ok());
        let problems = validate(&folder.path().join("new/reference"));
        assert_eq!(problems.len(), 1, "one for the folder, not one per image");
        assert!(open("reference").unwrap_err().remedy.contains("image_root"));
    }

    #[test]
    fn copies_and_links_keep_the_names_of_the_images() {
        let (folder, source) = testing::dataset();
        let mut sequence = Sequence::open(&source).unwrap();
        for (frame, name) in sequence
            .frames
            .iter_mut()
            .zip(["db/7.png", "db/8.png", "q/7.png"])
        {
            let image = folder.path().join("elsewhere").join(name);
            fs::create_dir_all(image.parent().unwrap()).unwrap();
            fs::rename(&frame.image, &image).unwrap();
            frame.image = image;
        }
        sequence.frames.truncate(3);
        sequence.pairs.retain(|pair| pair.a.max(pair.b) < 3);
        let names = |dir: &Path| -> Vec<Option<String>> {
            let frames = Sequence::open(dir).unwrap().frames;
            frames.into_iter().map(|frame| frame.name).collect()
        };
        let referring = folder.path().join("reference");
        write_native(
            &referring,
            &sequence,
            &About::default(),
            ImageStorage::Reference,
        )
        .unwrap();
        let fingerprint = Sequence::open(&referring).unwrap().fingerprint();
        for (name, storage) in [("copy", ImageStorage::Copy), ("link", ImageStorage::Link)] {
            let out = folder.path().join(name);
            write_native(&out, &sequence, &About::default(), storage).unwrap();
            assert_eq!(validate(&out), []);
            let expected = ["db/7.png", "db/8.png", "q/7.png"].map(|name| Some(name.to_owned()));
            assert_eq!(names(&out), expected, "{name}");
            let found = Sequence::open(&out).unwrap();
            assert_eq!(found.fingerprint(), fingerprint);
            // A copy of the copy keeps them, and a reference does.
            for (again, storage) in [("a", ImageStorage::Copy), ("b", ImageStorage::Reference)] {
                let again = folder.path().join(format!("{name}-{again}"));
                write_native(&again, &found, &About::default(), storage).unwrap();
                assert_eq!(names(&again), expected);
            }
        }
        let (folder, source) = testing::dataset();
        let out = folder.path().join("same");
        let numbered = Sequence::open(&source).unwrap();
        write_native(&out, &numbered, &About::default(), ImageStorage::Copy).unwrap();
        assert_eq!(names(&out), [const { None }; 4], "the copies are called so");
    }

    #[test]
    fn only_images_are_copied() {
        let (folder, source) = testing::dataset();
        let mut sequence = Sequence::open(&source).unwrap();
        let secret = folder.path().join("secret.png");
        fs::write(&secret, "a private key").unwrap();
        sequence.frames[1].image = source.join("../secret.png");
        let out = folder.path().join("out");
        let copy = |sequence: &Sequence| {
            write_native(&out, sequence, &About::default(), ImageStorage::Copy)
        };
        let error = copy(&sequence).unwrap_err();
        assert!(error.file.ends_with("secret.png"), "{error}");
        assert!(!out.exists());
        sequence.frames[1].image = source.join("../small/Images/0001.png");
        copy(&sequence).unwrap();
    }

    #[test]
    fn cameras_of_their_own_and_lenses_survive() {
        let (folder, source) = testing::dataset();
        let mut sequence = Sequence::open(&source).unwrap();
        for frame in &mut sequence.frames {
            frame.camera.distortion = Some(matchbench_vision::geometry::Lens::Brown(
                matchbench_vision::geometry::Distortion {
                    k1: 0.1,
                    k2: 0.02,
                    p1: 0.03,
                    p2: 0.04,
                    k3: 0.05,
                },
            ));
        }
        let cameras = |sequence: &Sequence| -> Vec<Camera> {
            sequence.frames.iter().map(|f| f.camera).collect()
        };
        for (name, storage) in [("a", ImageStorage::Reference), ("b", ImageStorage::Copy)] {
            for own in [false, true] {
                sequence.frames[2].camera.fx = if own { 22.0 } else { 20.5 };
                let out = folder.path().join(format!("{name}{own}"));
                write_native(&out, &sequence, &About::default(), storage).unwrap();
                assert_eq!(cameras(&Sequence::open(&out).unwrap()), cameras(&sequence));
                assert_eq!(validate(&out), []);
            }
        }
    }

    #[test]
    fn turns_homographies_and_images_that_are_to_come_survive() {
        let (folder, source) = testing::dataset();
        let mut sequence = Sequence::open(&source).unwrap();
        let shift = nalgebra::Matrix3::new(1.0, 0.0, 1.0 / 3.0, 0.0, 1.0, -2.0, 1e-7, 0.0, 1.0);
        sequence.frames[1].turn = Turn::Half;
        sequence.pairs[0] = Pair::with_homography(0, 1, shift);
        sequence.pairs.truncate(1);
        for (name, storage) in [("a", ImageStorage::Reference), ("b", ImageStorage::Copy)] {
            let out = folder.path().join(name);
            write_native(&out, &sequence, &About::default(), storage).unwrap();
            assert_eq!(validate(&out), []);
            let found = Sequence::open(&out).unwrap();
            assert_eq!(found.pairs, sequence.pairs);
            let turns: Vec<_> = found.frames.iter().map(|f| u8::from(f.turn)).collect();
            assert_eq!(turns, [0, 2, 0, 0]);
            let stored = read_gray(&found.frames[1].image).unwrap();
            assert_eq!(found.frames[1].pixels().unwrap(), Turn::Half.pixels(stored));
        }
        sequence.frames[2].image = source.join("later.png");
        let out = folder.path().join("later");
        write_native(&out, &sequence, &About::default(), ImageStorage::Reference).unwrap();
        let problems = validate(&out);
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert!(problems[0].error.file.ends_with("later.png"));
    }

    #[test]
    fn nothing_is_overwritten_and_nothing_half_is_left() {
        let (folder, dir) = testing::dataset();
        let write = |out: &Path, sequence: &Sequence| {
            write_native(out, sequence, &About::default(), ImageStorage::Copy)
        };
        let error = write(&dir, &Sequence::open(&dir).unwrap()).unwrap_err();
        assert!(error.what.contains("something already"));
        // These frames have no image, so the import fails halfway.
        assert!(write(&folder.path().join("new"), &testing::sequence(2)).is_err());
        let left: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        assert_eq!(left, ["small"]);
        // An empty folder may be filled.
        let empty = folder.path().join("empty");
        fs::create_dir(&empty).unwrap();
        write(&empty, &Sequence::open(&dir).unwrap()).unwrap();
        assert_eq!(validate(&empty), []);
    }
}
