//! The facts about the datasets that a report shows first: the paper's Table 1 and Figure 1.

use std::path::Path;

use crate::datasets::{Sequence, describe, reference};
use crate::metrics::Portion;

use super::Thumbnail;

/// Longest side of a thumbnail in pixels, and its JPEG quality.
const EMBEDDED: (u32, u8) = (320, 62);

/// One dataset in the table, with a picture of it.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetFacts {
    /// Its name.
    pub name: String,
    /// The portion of the benchmark that its pairs belong to.
    pub portion: Portion,
    /// How many images it has.
    pub frames: usize,
    /// How many pairs it lists.
    pub pairs: usize,
    /// Columns and rows of the first image as it is used (turned), where it can be read.
    pub resolution: Option<(usize, usize)>,
    /// Where it comes from; empty if the dataset does not say.
    pub origin: String,
    /// What it shows, in a few words; empty if the dataset does not say.
    pub property: String,
    /// The arguments with which it was imported; empty if the dataset does not say.
    pub import: Vec<String>,
    /// The first image of the pair in the middle of the list, if it can be read.
    pub thumbnail: Option<Thumbnail>,
}

impl DatasetFacts {
    /// The facts of a dataset that was opened from the folder `dir`. What cannot be read is left out, since a
    /// report can be made without it.
    pub fn of_sequence(dir: &Path, sequence: &Sequence) -> Self {
        let about = describe(dir).unwrap_or_default();
        let middle = sequence.pairs.get(sequence.pairs.len() / 2);
        let picture = sequence
            .frames
            .get(middle.map_or(0, |pair| pair.a as usize));
        let size = sequence.frames.first().and_then(|frame| frame.size().ok());
        Self {
            name: sequence.name.clone(),
            portion: Portion::of(sequence.pairs.iter().map(|pair| (pair.a, pair.b))),
            frames: sequence.frames.len(),
            pairs: sequence.pairs.len(),
            resolution: size.map(|size| (size.width, size.height)),
            origin: about.origin,
            property: about.property,
            import: about.import,
            thumbnail: picture
                .and_then(|frame| frame.planes().ok())
                .map(|planes| Thumbnail::new(&planes, EMBEDDED.0, EMBEDDED.1)),
        }
    }

    /// The paper of those whose data it has, if that is known.
    pub(super) fn reference(&self) -> Option<&'static str> {
        reference(&self.import, &self.origin)
    }

    /// The number of pairs; `10 of 435` where this many were scored.
    pub(super) fn pairs_of(&self, scored: Option<usize>) -> String {
        match scored {
            Some(scored) if scored != self.pairs => format!("{scored} of {}", self.pairs),
            _ => self.pairs.to_string(),
        }
    }

    /// `640 x 480`, or a dash.
    pub(super) fn size(&self) -> String {
        match self.resolution {
            Some((width, height)) => format!("{width} × {height}"),
            None => super::numbers::NONE.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use matchbench_vision::geometry::Camera;
    use nalgebra::Isometry3;

    use super::*;
    use crate::datasets::{Frame, Turn};

    #[test]
    fn the_size_is_that_of_the_turned_image() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let image = folder.path().join("0.pgm");
        fs::write(&image, [b"P5 3 2 255\n", &[0; 6][..]].concat()).expect("writable");
        let camera = Camera::pinhole(1.0, 1.0, 1.0, 1.0);
        let mut sequence = Sequence {
            name: "room".into(),
            frames: vec![Frame::with_pose(image, camera, Isometry3::identity())],
            pairs: Vec::new(),
        };
        for (turn, size) in [(Turn::None, (3, 2)), (Turn::Quarter, (2, 3))] {
            sequence.frames[0].turn = turn;
            let facts = DatasetFacts::of_sequence(folder.path(), &sequence);
            assert_eq!(facts.resolution, Some(size));
            let thumbnail = facts.thumbnail.expect("it can be read");
            assert_eq!(thumbnail.original, size);
        }
    }
}
