//! Which frame a file of matches means: by number, or by the name of its image.
//!
//! Names are understood as [`ImageNames`] says. The root of a tool may lie above that of the dataset. So if a file has
//! no name that is the end of a path, its names are looked up without their first folders. If it has some, its other
//! names mean other images, such as those of other scenes. Images that were copied or linked into the dataset, or that
//! are behind links, answer to their former names too, and the file means whichever finds more pairs.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::datasets::{Frame, ImageNames, Named, Sequence};

/// Longest path of an image in a file of matches, in bytes.
const MAX_PATH: usize = 4096;

/// The two names that joined ones can be, at each separator; none where they are longer than two paths, since every
/// split is looked up.
pub(super) fn splits(joined: &str, separator: char) -> impl Iterator<Item = [&str; 2]> {
    let joined = if joined.len() > 2 * MAX_PATH {
        ""
    } else {
        joined
    };
    joined
        .match_indices(separator)
        .map(move |(at, found)| [&joined[..at], &joined[at + found.len()..]])
}

/// The only one of the ways in which a name can be split, if it is the only one.
pub(super) fn only<T>(mut splits: impl Iterator<Item = T>) -> Option<T> {
    splits.next().filter(|_| splits.next().is_none())
}

/// What a file calls a pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum PairName {
    /// Numbers of frames.
    Frames(u32, u32),
    /// A name for each image, which its pairs share: it may be long, and the pairs many.
    Two(Arc<str>, Arc<str>),
    /// Both names with this character between them, which names may contain too.
    Joined(String, char),
}

impl PairName {
    /// That of a file `<a>_<b>.<ending>`.
    pub(super) fn of_file(path: &Path) -> Self {
        let stem = path.file_stem().unwrap_or_default();
        Self::Joined(stem.to_string_lossy().into_owned(), '_')
    }
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
    /// By the name that the image had before it was copied or linked into the dataset, or that the link to it had.
    Former,
    /// By that name without its first folders.
    FormerEnd,
}

/// The names that the frames of a dataset answer to.
pub(super) struct Names {
    images: ImageNames,
    /// The same with the former names of images, where they have any.
    former: ImageNames,
    count: u32,
}

impl Names {
    pub(super) fn of(sequence: &Sequence) -> Self {
        let frames = &sequence.frames;
        let has_former = frames.iter().any(|frame| frame.name.is_some());
        Self {
            images: ImageNames::of(frames.iter().map(|frame| &*frame.image)),
            former: if has_former {
                ImageNames::of(frames.iter().map(Frame::former_image))
            } else {
                ImageNames::default()
            },
            count: frames.len() as u32,
        }
    }

    /// What `name` means.
    fn named(&self, name: &str, by: NamedBy) -> Option<Named> {
        match by {
            NamedBy::Frame => self.by_number(name).map(Named::One),
            NamedBy::Image => self.images.whole(name),
            NamedBy::ImageEnd => self.images.end(name),
            NamedBy::Former => self.former.whole(name),
            NamedBy::FormerEnd => self.former.end(name),
        }
    }

    fn by_number(&self, name: &str) -> Option<u32> {
        let number = name.parse().ok()?;
        (number < self.count && name.bytes().all(|byte| byte.is_ascii_digit())).then_some(number)
    }

    /// The frame that is called `name`, if it is certain which.
    fn frame(&self, name: &str, by: NamedBy) -> Option<u32> {
        self.named(name, by)?.one()
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
                let mut splits = splits(name, *separator)
                    .filter_map(|[a, b]| Some((self.frame(a, by)?, self.frame(b, by)?)));
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

    /// The first of both names of a pair that several images have, with two of these, where otherwise the pair would be
    /// one of the dataset.
    pub(super) fn ambiguous(&self, name: &PairName, by: NamedBy) -> Option<Ambiguous> {
        let of_both = |names: [&str; 2]| {
            let [a, b] = names.map(|name| self.named(name, by));
            (names.into_iter().zip([a?, b?])).find_map(|(name, named)| match named {
                Named::One(_) => None,
                Named::Several(one, other) => Some((name.to_owned(), [one, other])),
            })
        };
        match name {
            PairName::Frames(..) => None,
            PairName::Two(a, b) => of_both([a, b]),
            PairName::Joined(name, separator) => splits(name, *separator).find_map(of_both),
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
        let found = |name: &PairName, by| self.pair(name, by).ok().flatten();
        let counted = |by| {
            (
                by,
                (names.iter().filter(|name| found(name, by).is_some())).count(),
            )
        };
        let mut ways = [NamedBy::Image, NamedBy::Former].map(counted);
        if ways.iter().all(|(_, count)| *count == 0) {
            ways = [NamedBy::ImageEnd, NamedBy::FormerEnd].map(counted);
        }
        let [images, former] = ways;
        let frames = counted(NamedBy::Frame);
        let (mut by, mut most) = images;
        for (other, count) in [former, frames] {
            if count > most {
                (by, most) = (other, count);
            }
        }
        if most == 0 {
            // Some names may be found, but none for certain.
            let is_ambiguous =
                |by: &NamedBy| names.iter().any(|name| self.ambiguous(name, *by).is_some());
            let ways = [
                NamedBy::Image,
                NamedBy::Former,
                NamedBy::ImageEnd,
                NamedBy::FormerEnd,
            ];
            let by = ways.into_iter().find(|by| is_ambiguous(by));
            return (by.unwrap_or(NamedBy::Image), false);
        }
        let others = [images.0, former.0, frames.0];
        let is_doubtful = |name: &PairName| {
            let meant = found(name, by);
            let differs =
                |other: NamedBy| found(name, other).is_some_and(|other| Some(other) != meant);
            meant.is_some() && others.into_iter().any(differs)
        };
        (by, names.iter().any(is_doubtful))
    }
}

/// A name, and two frames that it fits.
pub(super) type Ambiguous = (String, [u32; 2]);

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

    /// The same of images that were copied, with what they were called.
    fn copied(images: &[(&str, &str)]) -> Names {
        let camera = Camera::pinhole(1.0, 1.0, 0.0, 0.0);
        let frame = |&(image, former): &(&str, &str)| Frame {
            name: Some(former.into()),
            ..Frame::with_pose(image, camera, Isometry3::identity())
        };
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
    fn other_scenes_of_a_file_are_no_images_of_this_one() {
        let names = names(&["/data/scene8/color/1.png", "/data/scene8/color/2.png"]);
        let pair = |scene: &str| {
            PairName::Two(
                format!("{scene}/color/1.png").into(),
                format!("{scene}/color/2.png").into(),
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
    fn copies_answer_to_the_names_that_the_images_had() {
        let names = copied(&[
            ("Images/0000.png", "left/000000.png"),
            ("Images/0001.png", "left/000003.png"),
            ("Images/0002.png", "left/000006.png"),
            ("Images/0003.png", "left/000009.png"),
        ]);
        let kind = |pairs: &[&str]| {
            let pairs: Vec<_> = pairs.iter().map(|name| joined(name)).collect();
            let (by, doubtful) = names.kind(&pairs);
            (by, doubtful, names.pair(&pairs[0], by).unwrap())
        };
        assert_eq!(
            kind(&["000003_000006", "000006_000009"]),
            (NamedBy::Former, false, Some((1, 2)))
        );
        // Pair 0 3 of numbers would be found too.
        assert_eq!(
            kind(&["000000_000003"]),
            (NamedBy::Former, true, Some((0, 1)))
        );
        assert_eq!(
            kind(&["0001.png_0003.png"]),
            (NamedBy::Image, false, Some((1, 3)))
        );
        assert_eq!(kind(&["1_3"]), (NamedBy::Frame, false, Some((1, 3))));
        let wider = ["kitti/left/000003.png_kitti/left/000009.png"];
        assert_eq!(kind(&wider), (NamedBy::FormerEnd, false, Some((1, 3))));
    }

    #[test]
    fn a_name_of_several_images_is_told() {
        let names = names(&["db/a_0.JPG", "query/a_0.png", "query/b.png"]);
        let pair = joined("a_0_b");
        let (by, _) = names.kind(std::slice::from_ref(&pair));
        assert_eq!(names.pair(&pair, by), Ok(None));
        let ambiguous = names.ambiguous(&pair, by);
        assert_eq!(ambiguous, Some(("a_0".to_owned(), [0, 1])));
        let elsewhere = PairName::Two("x/a_0".into(), "x/b".into());
        let (by, _) = names.kind(std::slice::from_ref(&elsewhere));
        assert_eq!(
            names.ambiguous(&elsewhere, by),
            Some(("x/a_0".to_owned(), [0, 1]))
        );
        assert_eq!(names.ambiguous(&joined("a_0_c"), by), None, "there is no c");
        assert_eq!(names.ambiguous(&joined("a_0.png_b"), NamedBy::Image), None);
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
