//! Which frame a file of matches means: by number, or by the name of its image.
//!
//! Tools name an image by its path below some root (`db/0001.jpg`), by its file name, or without the
//! extension; hloc writes `-` for `/` in names of pairs. All of these are understood, as long as only one
//! image has a path that ends so. The root of a tool may lie above that of the dataset. So if a file has no name that is
//! the end of a path, its names are looked up without their first folders. If it has some, its other names mean
//! other images, such as those of other scenes. A name is never opened as a file.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::datasets::Sequence;

/// Folders above an image that may be part of its name.
const MAX_FOLDERS: usize = 6;

/// What a file calls a pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum PairName {
    /// Numbers of frames.
    Frames(u32, u32),
    /// A name for each image.
    Two(String, String),
    /// Both names with this character between them, which names may contain too.
    Joined(String, char),
}

impl fmt::Display for PairName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frames(a, b) => write!(f, "`{a} {b}`"),
            Self::Two(a, b) => write!(f, "`{a}` and `{b}`"),
            Self::Joined(name, _) => write!(f, "`{name}`"),
        }
    }
}

/// How frames are named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NamedBy {
    /// By number, counted from 0.
    Frame,
    /// By the name of the image.
    Image,
    /// By the name of the image without its first folders, which are those of another root.
    ImageEnd,
}

/// The names that the frames of a dataset answer to.
pub(super) struct Names {
    /// `None` for a name that several frames answer to.
    frames: HashMap<String, Option<u32>>,
    count: u32,
}

impl Names {
    pub(super) fn of(sequence: &Sequence) -> Self {
        let mut frames = HashMap::new();
        for (frame, number) in sequence.frames.iter().zip(0..) {
            for name in names_of(&frame.image) {
                (frames.entry(name))
                    .and_modify(|known| {
                        if *known != Some(number) {
                            *known = None;
                        }
                    })
                    .or_insert(Some(number));
            }
        }
        Self {
            frames,
            count: sequence.frames.len() as u32,
        }
    }

    /// The frame of that name.
    fn by_image(&self, name: &str) -> Option<u32> {
        self.frames.get(name).copied().flatten()
    }

    /// The frame of the longest end of that name which is a name.
    fn by_end(&self, name: &str) -> Option<u32> {
        let mut rest = name;
        loop {
            if let Some(frame) = self.frames.get(rest) {
                return *frame;
            }
            (_, rest) = rest.split_once('/')?;
        }
    }

    fn by_number(&self, name: &str) -> Option<u32> {
        let number = name.parse().ok()?;
        (number < self.count && name.bytes().all(|byte| byte.is_ascii_digit())).then_some(number)
    }

    /// The frame that is called `name`.
    fn frame(&self, name: &str, by: NamedBy) -> Option<u32> {
        match by {
            NamedBy::Frame => self.by_number(name),
            NamedBy::Image => self.by_image(name),
            NamedBy::ImageEnd => self.by_end(name),
        }
    }

    /// The frames of a pair; `None` if the dataset has no such images.
    ///
    /// # Errors
    /// If a joined name can be split in several ways.
    pub(super) fn pair(&self, name: &PairName, by: NamedBy) -> Result<Option<(u32, u32)>, String> {
        match name {
            PairName::Frames(a, b) => Ok(((*a).max(*b) < self.count).then_some((*a, *b))),
            PairName::Two(a, b) => Ok(self.frame(a, by).zip(self.frame(b, by))),
            PairName::Joined(name, separator) => {
                let mut splits = name.match_indices(*separator).filter_map(|(at, found)| {
                    let a = self.frame(&name[..at], by)?;
                    Some((a, self.frame(&name[at + found.len()..], by)?))
                });
                let first = splits.next();
                match splits.next() {
                    Some(second) => Err(format!(
                        "`{name}` can be the pair {:?} and the pair {second:?}",
                        first.expect("there is a second")
                    )),
                    None => Ok(first),
                }
            }
        }
    }

    /// Whether `names` are those of images or numbers of frames: whichever means more pairs of this
    /// dataset, and images where both mean as many. True beside it, where some pair could be meant
    /// either way and would be another.
    pub(super) fn kind(&self, names: &[PairName]) -> (NamedBy, bool) {
        if names
            .iter()
            .any(|name| matches!(name, PairName::Frames(..)))
        {
            return (NamedBy::Frame, false);
        }
        let found = |name, by| self.pair(name, by).ok().flatten();
        let has_names = names
            .iter()
            .any(|name| found(name, NamedBy::Image).is_some());
        let by_name = if has_names {
            NamedBy::Image
        } else {
            NamedBy::ImageEnd
        };
        let (mut images, mut frames, mut doubtful) = (0, 0, false);
        for name in names {
            let image = found(name, by_name);
            let frame = found(name, NamedBy::Frame);
            images += usize::from(image.is_some());
            frames += usize::from(frame.is_some());
            doubtful |= image.is_some() && frame.is_some() && image != frame;
        }
        let by = if frames > images {
            NamedBy::Frame
        } else if images == 0 {
            NamedBy::Image
        } else {
            by_name
        };
        (by, doubtful)
    }
}

/// The names that an image answers to: the ends of its path, also without the ending, and with `-`
/// for `/`.
fn names_of(image: &Path) -> Vec<String> {
    let parts: Vec<_> = (image.iter().rev().take(1 + MAX_FOLDERS))
        .map(|part| part.to_string_lossy())
        .collect();
    let mut names = Vec::new();
    for depth in 1..=parts.len() {
        let name = parts[..depth]
            .iter()
            .rev()
            .map(AsRef::as_ref)
            .collect::<Vec<&str>>();
        let name = name.join("/");
        let stem = match name.rsplit_once('.') {
            Some((stem, ending)) if !ending.contains('/') => Some(stem.to_owned()),
            _ => None,
        };
        for name in [Some(name), stem].into_iter().flatten() {
            if name.contains('/') {
                names.push(name.replace('/', "-"));
            }
            names.push(name);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::Camera;
    use nalgebra::Isometry3;

    use super::*;
    use crate::datasets::Frame;

    fn names(images: &[&str]) -> Names {
        let camera = Camera::pinhole(1.0, 1.0, 0.0, 0.0);
        let frame = |image: &&str| Frame::with_pose(image, camera, Isometry3::identity());
        Names::of(&Sequence {
            name: "room".into(),
            frames: images.iter().map(frame).collect(),
            pairs: Vec::new(),
        })
    }

    fn joined(name: &str) -> PairName {
        PairName::Joined(name.into(), '_')
    }

    #[test]
    fn an_image_answers_to_the_ends_of_its_path() {
        let names = names(&[
            "/data/db/0007.jpg",
            "/data/query/0007.jpg",
            "/data/db/1.2.png",
        ]);
        for (name, frame) in [
            ("db/0007.jpg", Some(0)),
            ("query/0007.jpg", Some(1)),
            ("query-0007.jpg", Some(1)),
            ("data/db/0007", Some(0)),
            ("elsewhere/query/0007.jpg", None),
            ("1.2", Some(2)),
            ("1.2.png", Some(2)),
            ("0007.jpg", None),
            ("0008.jpg", None),
            ("../../../etc/passwd", None),
            ("", None),
        ] {
            assert_eq!(names.by_image(name), frame, "{name}");
        }
        assert_eq!(names.by_end("elsewhere/query/0007.jpg"), Some(1));
        assert_eq!(names.by_end("elsewhere/0007.jpg"), None, "there are two");
        assert_eq!(names.by_end("elsewhere/0008.jpg"), None);
    }

    #[test]
    fn other_scenes_of_a_file_are_no_images_of_this_one() {
        let names = names(&["/data/scene8/color/1.png", "/data/scene8/color/2.png"]);
        let pair = |scene: &str| {
            PairName::Two(
                format!("{scene}/color/1.png"),
                format!("{scene}/color/2.png"),
            )
        };
        let of_both = [pair("scene7"), pair("scene8")];
        let (by, _) = names.kind(&of_both);
        assert_eq!(by, NamedBy::Image);
        assert_eq!(names.pair(&of_both[0], by), Ok(None));
        assert_eq!(names.pair(&of_both[1], by), Ok(Some((0, 1))));
        // Without a name of the dataset, the folders may be those of another root.
        let (by, _) = names.kind(&[pair("elsewhere")]);
        assert_eq!(by, NamedBy::ImageEnd);
        assert_eq!(names.pair(&pair("elsewhere"), by), Ok(Some((0, 1))));
    }

    #[test]
    fn joined_names_are_split_where_both_parts_are_images() {
        let names = names(&["a_1.png", "a_2.png", "1.png"]);
        let pair = |name| names.pair(&joined(name), NamedBy::Image);
        assert_eq!(pair("a_1_a_2"), Ok(Some((0, 1))));
        assert_eq!(pair("a_2.png_1.png"), Ok(Some((1, 2))));
        assert_eq!(pair("a_3_a_1"), Ok(None));
        let names = self::names(&["a.png", "a_a.png"]);
        let message = names.pair(&joined("a_a_a"), NamedBy::Image).unwrap_err();
        assert!(
            message.contains("(0, 1)") && message.contains("(1, 0)"),
            "{message}"
        );
    }

    #[test]
    fn numbers_are_frames_where_they_are_no_images() {
        let pairs = ["0_1", "0_02"].map(joined);
        assert_eq!(
            names(&["x.png", "y.png", "z.png"]).kind(&pairs),
            (NamedBy::Frame, false)
        );
        // Image 0.png is frame 2: the images win, and it is said.
        let reversed = names(&["02.png", "1.png", "0.png"]);
        assert_eq!(reversed.kind(&pairs), (NamedBy::Image, true));
        assert_eq!(
            names(&["0.png", "1.png", "02.png"]).kind(&pairs),
            (NamedBy::Image, false)
        );
        let three = names(&["x.png", "y.png", "z.png"]);
        assert_eq!(three.pair(&joined("0_3"), NamedBy::Frame), Ok(None));
        assert_eq!(three.pair(&joined("+0_1"), NamedBy::Frame), Ok(None));
        assert_eq!(
            three.pair(&PairName::Frames(0, 3), NamedBy::Frame),
            Ok(None)
        );
    }
}
