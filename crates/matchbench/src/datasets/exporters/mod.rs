//! Writes datasets in layouts of other tools: one exporter per file, one entry per exporter in [`EXPORTS`].
//!
//! These formats have no turned images. So cameras and poses are written for the pixels as they are stored.

mod colmap;
mod superglue;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;

use super::{DatasetError, Frame, Pair, Sequence, read_size};
use crate::counted::counted;
use crate::files::place_of;

/// A layout that a dataset can be written in.
#[derive(Debug)]
pub struct Export {
    /// Its name on the command line.
    pub id: &'static str,
    /// What is written, in one line.
    pub help: &'static str,
    /// The file in the folder that lists the pairs, where an import must be given it (`--pairs list:FILE`).
    pub pairs: Option<&'static str>,
    /// Whether it is pairs alone that are written, with what belongs to them: then it has no frame that is in no pair, and
    /// no pose but the relative ones.
    pub is_of_pairs: bool,
    write: fn(&Sequence, &Path) -> Result<PathBuf, DatasetError>,
}

/// All layouts that datasets can be written in.
pub const EXPORTS: &[Export] = &[
    Export {
        id: "colmap",
        help: "a folder with a COLMAP model as text (cameras, images, no points) and pairs.txt, for \
               COLMAP's matches importer",
        pairs: Some(colmap::PAIRS),
        is_of_pairs: false,
        write: colmap::write,
    },
    Export {
        id: "superglue",
        help: "a file with SuperGlue's 38 columns per pair: names, turns, K, K, T_0to1",
        pairs: None,
        is_of_pairs: true,
        write: superglue::write,
    },
];

impl Export {
    /// The layout with this id.
    ///
    /// # Errors
    /// If there is none.
    pub fn find(id: &str) -> Result<&'static Self, DatasetError> {
        let found = EXPORTS.iter().find(|export| export.id == id);
        found.ok_or_else(|| {
            let ids: Vec<_> = EXPORTS.iter().map(|export| export.id).collect();
            let remedy = format!("use one of {}", ids.join(", "));
            DatasetError::new(id, "no such layout", remedy)
        })
    }

    /// How many frames of a dataset are written.
    pub fn frames(&self, sequence: &Sequence) -> usize {
        if !self.is_of_pairs {
            return sequence.frames.len();
        }
        let paired: BTreeSet<u32> = (sequence.pairs.iter())
            .flat_map(|pair| [pair.a, pair.b])
            .collect();
        paired.len()
    }

    /// What a dataset holds that this layout has no place for, in words.
    pub fn leaves_out(&self, sequence: &Sequence) -> Vec<String> {
        let unpaired = sequence.frames.len() - self.frames(sequence);
        let count = |has: fn(&Frame) -> bool| sequence.frames.iter().filter(|f| has(f)).count();
        let poses = if self.is_of_pairs {
            count(|frame| frame.world_from_camera.is_some())
        } else {
            0
        };
        let depths = count(|frame| frame.depth.is_some());
        let is_mapped = |pair: &&Pair| pair.homography().is_some();
        let homographies = sequence.pairs.iter().filter(is_mapped).count();
        let of =
            |(what, number, of)| (number > 0).then(|| format!("{what} of {}", counted(number, of)));
        let unpaired = (unpaired > 0).then(|| counted(unpaired, "frame") + " in no pair");
        let others = [
            ("the absolute pose", poses, "frame"),
            ("the homography", homographies, "pair"),
            ("the depth", depths, "frame"),
        ];
        unpaired
            .into_iter()
            .chain(others.into_iter().filter_map(of))
            .collect()
    }
}

/// Writes a dataset in the layout with this [`EXPORTS`] id as `out`, which must not exist. Returns the folder
/// to which the image names in it are relative.
///
/// # Errors
/// If there is no such layout, if it cannot express what the dataset holds, if an image cannot be read (the
/// sizes are needed), or if `out` cannot be written.
pub fn export(layout: &str, sequence: &Sequence, out: &Path) -> Result<PathBuf, DatasetError> {
    let entry = Export::find(layout)?;
    let place = place_of(out).map_err(|error| DatasetError::io(out, &error))?;
    if place.exists() {
        return Err(DatasetError::new(
            out,
            "there is something already",
            "give another name or remove this one",
        ));
    }
    (entry.write)(sequence, out)
}

/// The camera of a frame for the pixels as stored, and their size.
fn stored_camera(frame: &Frame) -> Result<(Camera, Size), DatasetError> {
    let stored = read_size(&frame.image)?;
    let turned = frame.turn.size(stored);
    let (width, height) = (turned.width as f64, turned.height as f64);
    let camera = frame.turn.inverse().camera(&frame.camera, width, height);
    Ok((camera, stored))
}

/// The folder that contains all images, and the name of each relative to it, with `/`. An image that is a link is called
/// as the link is, since exported matches have that name too.
fn names(sequence: &Sequence) -> Result<(PathBuf, Vec<String>), DatasetError> {
    let paths = (sequence.frames.iter())
        .map(|Frame { image, .. }| {
            std::path::absolute(image).map_err(|error| DatasetError::io(image, &error))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let root = super::bring::common_folder(&paths);
    let name = |path: &PathBuf| {
        let relative = path.strip_prefix(&root).unwrap_or(path);
        let parts: Option<Vec<&str>> = relative.iter().map(|part| part.to_str()).collect();
        let cannot_say = |has: &str| {
            let what = format!("the name of the image {has}, which this layout cannot say");
            DatasetError::new(path, what, "rename the image or its folder")
        };
        let name = (parts.ok_or_else(|| cannot_say("is not UTF-8"))?).join("/");
        if name.contains(char::is_whitespace) {
            return Err(cannot_say("has a space"));
        }
        Ok(name)
    };
    let names = paths.iter().map(name).collect::<Result<Vec<_>, _>>()?;
    Ok((root, names))
}

fn cannot_say(frame: &Frame, what: &str) -> DatasetError {
    DatasetError::new(
        &frame.image,
        what,
        "choose another layout, or leave the frame out",
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;

    #[test]
    fn what_is_left_out_depends_on_the_layout() {
        let camera = Camera {
            fx: 20.0,
            fy: 20.0,
            cx: 10.0,
            cy: 10.0,
            distortion: None,
        };
        let still = Isometry3::identity();
        let frame = |number: u32| Frame::with_pose(format!("{number}.png"), camera, still);
        let sequence = Sequence {
            name: "room".into(),
            frames: (0..5).map(frame).collect(),
            pairs: [(0, 1), (1, 3)]
                .map(|(a, b)| Pair::with_pose(a, b, still))
                .into(),
        };
        let [colmap, superglue] = ["colmap", "superglue"].map(|id| Export::find(id).unwrap());
        assert_eq!([colmap, superglue].map(|of| of.frames(&sequence)), [5, 3]);
        assert!(colmap.leaves_out(&sequence).is_empty());
        assert_eq!(
            superglue.leaves_out(&sequence),
            ["2 frames in no pair", "the absolute pose of 5 frames"]
        );
    }

    #[cfg(unix)]
    #[test]
    fn an_image_that_is_a_link_is_called_as_the_link_is() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let camera = Camera::pinhole(20.0, 20.0, 10.0, 10.0);
        std::fs::create_dir(at("Images")).unwrap();
        let frames = [0, 1].map(|index| {
            let (real, link) = (
                at(&format!("{index}.PGM")),
                at(&format!("Images/000{index}.pgm")),
            );
            std::fs::write(&real, "P5 2 1 255 ab").unwrap();
            std::os::unix::fs::symlink(real, &link).unwrap();
            Frame::with_pose(link, camera, Isometry3::identity())
        });
        let sequence = Sequence {
            name: "room".into(),
            frames: frames.into(),
            pairs: vec![Pair::with_pose(0, 1, Isometry3::identity())],
        };
        let root = export("colmap", &sequence, &at("model")).unwrap();
        assert_eq!(root, at("Images"));
        let pairs = std::fs::read_to_string(at("model/pairs.txt")).unwrap();
        assert_eq!(pairs, "0000.pgm 0001.pgm\n");
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named_once() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("occupied");
        std::fs::write(&file, "").unwrap();
        let sequence = Sequence {
            name: "room".into(),
            frames: Vec::new(),
            pairs: Vec::new(),
        };
        for entry in EXPORTS {
            let refused = export(entry.id, &sequence, &file.join("below")).unwrap_err();
            let message = refused.to_string();
            assert_eq!(message.matches("occupied").count(), 1, "{message}");
        }
    }
}
