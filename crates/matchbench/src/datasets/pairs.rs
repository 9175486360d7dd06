//! Rules that choose which frames are matched: the rules of the paper's two portions, and further ones.
//!
//! | rule | pairs | in the paper (Sec. 4) |
//! | --- | --- | --- |
//! | `fragments:15` | the first frame of every 15 with each of the other 14 | 01-03; 04 with 5 |
//! | `all` | every frame with every later one | 05 |
//! | `window:9` | every frame with the next 9 | |
//! | `window:9,stride:15` | the same among every 15th frame | 06-08 |
//! | `list:FILE` | as listed: `a b` per line, numbers of frames or names of images | |
//! | `covisible:0.1..0.7` | frames whose share of common points is in that range | |
//!
//! Common points are known if the source has them (COLMAP models). The share of a frame is the number of common
//! points divided by the number of points that the frame sees. The smaller of the two shares of a pair counts.
//!
//! A stride removes frames from the dataset. Those that are kept are numbered again from 0, as in the authors'
//! sequences 06-08. The order of pairs is that of the authors' files: by `a`, then by `b`.

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use nalgebra::Isometry3;

use super::pair_list::{check_numbers, is_numbered, listed, numbered};
use super::text::TextFile;
use super::{DatasetError, Frame, Pair};
use crate::front_door::PAIRS;

/// A rule that chooses pairs of frames.
#[derive(Clone, Debug, PartialEq)]
pub enum PairRule {
    /// Consecutive fragments of `length` frames, the first of each matched to the others.
    Fragments {
        /// Frames in a fragment, at least 2; the last fragment may be shorter.
        length: usize,
    },
    /// Every frame with every later one.
    All,
    /// Every kept frame with the next `size` kept ones.
    Window {
        /// Frames that one is matched to, at least 1.
        size: usize,
        /// Every `stride`-th frame is kept, beginning with the first; at least 1.
        stride: usize,
    },
    /// The pairs listed in a file.
    List {
        /// Text file with `a b` in each line: numbers of frames, counted from 0, or names of images.
        file: PathBuf,
    },
    /// Every frame with every later one, if their share of common points is in a range.
    Covisible {
        /// Least share of common points, above 0.
        lowest: f64,
        /// Largest share, up to 1.
        highest: f64,
    },
}

/// A pair rule that cannot be parsed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown pair rule `{0}`: use fragments:N (N at least 2), all, window:N, window:N,stride:S, \
     list:FILE or covisible:LOWEST..HIGHEST (shares, 0 < LOWEST <= HIGHEST <= 1)"
)]
pub struct PairRuleError(String);

impl FromStr for PairRule {
    type Err = PairRuleError;

    fn from_str(text: &str) -> Result<Self, PairRuleError> {
        let unknown = || PairRuleError(text.to_owned());
        let number = |digits: &str, least: usize| match digits.trim().parse() {
            Ok(n) if n >= least => Ok(n),
            _ => Err(unknown()),
        };
        if text == "all" {
            return Ok(Self::All);
        }
        match text.split_once(':').ok_or_else(unknown)? {
            ("fragments", length) => Ok(Self::Fragments {
                length: number(length, 2)?,
            }),
            ("window", rest) => {
                let (size, stride) = match rest.split_once(',') {
                    None => (rest, "1"),
                    Some((size, stride)) => {
                        let stride = stride.trim().strip_prefix("stride:").ok_or_else(unknown)?;
                        (size, stride)
                    }
                };
                Ok(Self::Window {
                    size: number(size, 1)?,
                    stride: number(stride, 1)?,
                })
            }
            ("list", file) if !file.is_empty() => Ok(Self::List { file: file.into() }),
            ("covisible", range) => {
                let (lowest, highest) = range.split_once("..").ok_or_else(unknown)?;
                let share = |text: &str| text.trim().parse::<f64>().map_err(|_| unknown());
                let (lowest, highest) = (share(lowest)?, share(highest)?);
                if !(lowest > 0.0 && lowest <= highest && highest <= 1.0) {
                    return Err(unknown());
                }
                Ok(Self::Covisible { lowest, highest })
            }
            _ => Err(unknown()),
        }
    }
}

impl fmt::Display for PairRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fragments { length } => write!(f, "fragments:{length}"),
            Self::All => f.write_str("all"),
            Self::Window { size, stride: 1 } => write!(f, "window:{size}"),
            Self::Window { size, stride } => write!(f, "window:{size},stride:{stride}"),
            Self::List { file } => write!(f, "list:{}", file.display()),
            Self::Covisible { lowest, highest } => write!(f, "covisible:{lowest}..{highest}"),
        }
    }
}

/// Largest number of pairs that a rule makes; they take about 3.5 GB.
const MAX_PAIRS: usize = 20_000_000;

impl PairRule {
    /// Every `stride`-th frame stays in the dataset.
    pub fn stride(&self) -> usize {
        match self {
            Self::Window { stride, .. } => *stride,
            _ => 1,
        }
    }

    /// The pairs `(a, b)` among `kept` frames, numbered after the stride was applied. A list must have numbers of frames,
    /// since names of images are not known here; [`PairRule::apply`] knows them.
    ///
    /// # Errors
    /// If the list cannot be read, or names a frame that does not exist, a frame with itself, or a pair twice.
    /// Also if the rule asks for common points, which are not known here, or makes more than 20,000,000 pairs.
    pub fn pairs(&self, kept: usize) -> Result<Vec<(u32, u32)>, DatasetError> {
        let (step, size) = match self {
            Self::Fragments { length } => (*length, length - 1),
            Self::All => (1, kept),
            Self::Window { size, .. } => (1, *size),
            Self::List { file } => return numbered(&TextFile::read(file)?, Some(kept)),
            Self::Covisible { .. } => return Err(self.without_points()),
        };
        let last = |a: usize| kept.min(a.saturating_add(size).saturating_add(1));
        let first_frames = || (0..kept).step_by(step);
        let count: usize = first_frames().map(|a| last(a) - (a + 1)).sum();
        if count > MAX_PAIRS {
            return Err(self.too_many(kept, &count.to_string(), MAX_PAIRS));
        }
        let pairs =
            first_frames().flat_map(|a| (a + 1..last(a)).map(move |b| (a as u32, b as u32)));
        Ok(pairs.collect())
    }

    fn too_many(&self, frames: usize, count: &str, most: usize) -> DatasetError {
        DatasetError::new(
            self.to_string(),
            format!("{frames} frames have {count} pairs by this rule; {most} are possible"),
            format!(
                "choose fewer pairs, for example by {} or fragments:15",
                PAIRS.with("window:9,stride:15")
            ),
        )
    }

    fn without_points(&self) -> DatasetError {
        DatasetError::new(
            self.to_string(),
            "nothing tells which points the frames have in common",
            "choose another rule, or import a COLMAP model with its points",
        )
    }

    /// Whether the rule is a list of numbers of frames.
    ///
    /// # Errors
    /// If the list cannot be read.
    pub(super) fn has_numbers(&self) -> Result<bool, DatasetError> {
        match self {
            Self::List { file } => Ok(is_numbered(&TextFile::read(file)?)),
            _ => Ok(false),
        }
    }

    /// A function that says whether the rule chooses a pair of frames among those that are listed: in either order, since a
    /// dataset may list a pair in either, but of a list in the order that it has there. Frames are numbered after the stride
    /// was applied; their number need not be known. `frames` are asked for if a list names images.
    ///
    /// # Errors
    /// If the list cannot be read, names a frame with itself or a pair twice, or names an image that none of the frames
    /// has, or there are no frames, or these cannot be read.
    pub fn chooser(
        &self,
        frames: impl FnOnce() -> Result<Option<Vec<Frame>>, DatasetError>,
    ) -> Result<Box<dyn Fn(u32, u32) -> bool>, DatasetError> {
        Ok(match self {
            Self::Fragments { length } => {
                let length = *length as u64;
                Box::new(move |a, b| {
                    let (first, last) = (u64::from(a.min(b)), u64::from(a.max(b)));
                    first < last && first % length == 0 && first / length == last / length
                })
            }
            Self::All => Box::new(|a, b| a != b),
            Self::Window { size, .. } => {
                let size = *size as u64;
                Box::new(move |a, b| a != b && u64::from(a.abs_diff(b)) <= size)
            }
            Self::List { file } => {
                let pairs: HashSet<_> = pairs_in(file, frames)?.into_iter().collect();
                Box::new(move |a, b| pairs.contains(&(a, b)))
            }
            Self::Covisible { .. } => return Err(self.without_points()),
        })
    }

    /// The pairs of a list, by the numbers of their frames; `None` if the rule is no list.
    ///
    /// # Errors
    /// As [`PairRule::chooser`].
    pub fn list(
        &self,
        frames: impl FnOnce() -> Result<Option<Vec<Frame>>, DatasetError>,
    ) -> Result<Option<Vec<(u32, u32)>>, DatasetError> {
        match self {
            Self::List { file } => Ok(Some(pairs_in(file, frames)?)),
            _ => Ok(None),
        }
    }

    /// Applies the rule: returns the frames that remain, and their pairs with the true relative poses.
    ///
    /// # Errors
    /// As [`PairRule::pairs`], if a list names an image that is not there, and if a frame of a pair has no pose.
    pub fn apply(&self, frames: Vec<Frame>) -> Result<(Vec<Frame>, Vec<Pair>), DatasetError> {
        let frames: Vec<Frame> = frames.into_iter().step_by(self.stride()).collect();
        let pairs = match self {
            Self::List { file } => listed(&TextFile::read(file)?, &frames)?,
            rule => rule.pairs(frames.len())?,
        };
        let pairs = with_poses(&frames, pairs)?;
        Ok((frames, pairs))
    }
}

/// The pairs of a list: of numbers, or of names that `frames` have, which are asked for then.
fn pairs_in(
    file: &Path,
    frames: impl FnOnce() -> Result<Option<Vec<Frame>>, DatasetError>,
) -> Result<Vec<(u32, u32)>, DatasetError> {
    let list = TextFile::read(file)?;
    if is_numbered(&list) {
        return numbered(&list, None);
    }
    let frames = frames()?.ok_or_else(|| {
        DatasetError::new(
            file,
            "the list names images, and the dataset that has them is not at hand",
            "name the folder that holds the dataset with --datasets, or list numbers of frames",
        )
    })?;
    listed(&list, &frames)
}

/// Pairs of frames, by their numbers, with their relative poses: what [`PairRule::apply`] makes of a list, for a program
/// that has the list in no file.
///
/// # Errors
/// If a pair names a frame that does not exist or has no pose, or a frame with itself, or if it stands twice.
pub fn pairs_of(frames: &[Frame], pairs: Vec<(u32, u32)>) -> Result<Vec<Pair>, DatasetError> {
    check_numbers(&pairs, frames.len()).map_err(|(row, what)| {
        let remedy = "correct this pair; rows are counted from 0";
        DatasetError::new("pairs", format!("row {row}: {what}"), remedy)
    })?;
    with_poses(frames, pairs)
}

/// Pairs of frames with their relative poses.
pub(super) fn with_poses(
    frames: &[Frame],
    pairs: Vec<(u32, u32)>,
) -> Result<Vec<Pair>, DatasetError> {
    let pose = |index: u32| {
        let frame = &frames[index as usize];
        frame.world_from_camera.as_ref().ok_or_else(|| {
            DatasetError::new(
                &frame.image,
                "the image has no pose",
                "leave it out or give its pose",
            )
        })
    };
    pairs
        .into_iter()
        .map(|(a, b)| Ok(Pair::with_pose(a, b, relative_pose(pose(a)?, pose(b)?))))
        .collect()
}

/// The pairs of frames whose share of common points is in the range. `seen` has the points of each frame,
/// without repetition.
///
/// # Errors
/// If there are more than 20,000,000 pairs.
pub(super) fn covisible(
    seen: &[Vec<u64>],
    lowest: f64,
    highest: f64,
) -> Result<Vec<(u32, u32)>, DatasetError> {
    at_most(MAX_PAIRS, seen, lowest, highest)
}

/// The same with another limit.
fn at_most(
    most: usize,
    seen: &[Vec<u64>],
    lowest: f64,
    highest: f64,
) -> Result<Vec<(u32, u32)>, DatasetError> {
    let mut seen_by: HashMap<u64, Vec<usize>> = HashMap::new();
    let mut pairs = Vec::new();
    // Starts from the last frame, so that the list of a point holds only later frames.
    for (a, points) in seen.iter().enumerate().rev() {
        let mut common = vec![0_usize; seen.len()];
        for point in points {
            let frames = seen_by.entry(*point).or_default();
            for &b in &*frames {
                common[b] += 1;
            }
            frames.push(a);
        }
        for (b, &count) in common
            .iter()
            .enumerate()
            .rev()
            .filter(|(_, count)| **count > 0)
        {
            let share = count as f64 / points.len().max(seen[b].len()) as f64;
            if !(lowest..=highest).contains(&share) {
                continue;
            }
            if pairs.len() == most {
                let rule = PairRule::Covisible { lowest, highest };
                return Err(rule.too_many(seen.len(), &format!("more than {most}"), most));
            }
            pairs.push((a as u32, b as u32));
        }
    }
    pairs.reverse();
    Ok(pairs)
}

/// `b_from_a` of two cameras whose poses in the world are known.
pub fn relative_pose(
    world_from_a: &Isometry3<f64>,
    world_from_b: &Isometry3<f64>,
) -> Isometry3<f64> {
    world_from_b.inverse() * world_from_a
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn count(rule: &str, frames: usize) -> usize {
        let rule: PairRule = rule.parse().unwrap();
        let kept = frames.div_ceil(rule.stride());
        rule.pairs(kept).unwrap().len()
    }

    /// Frames and pairs of the published sequences 01 to 08.
    #[test]
    fn the_papers_counts_are_reproduced() {
        assert_eq!(count("fragments:15", 2583), 2410);
        assert_eq!(count("fragments:15", 2405), 2244);
        assert_eq!(count("fragments:15", 1006), 938);
        assert_eq!(count("fragments:5", 4541), 3632);
        assert_eq!(count("all", 30), 435);
        assert_eq!(count("window:9,stride:15", 2583), 1512);
        assert_eq!(count("window:9,stride:15", 2405), 1404);
        assert_eq!(count("window:9,stride:15", 1006), 567);
    }

    #[test]
    fn pairs_without_a_file_are_checked_as_those_of_a_list() {
        let frames = super::super::testing::frames(3);
        let rule: PairRule = "all".parse().unwrap();
        let (_, all) = rule.apply(frames.clone()).unwrap();
        assert_eq!(
            pairs_of(&frames, vec![(0, 1), (0, 2), (1, 2)]).unwrap(),
            all
        );
        for (pair, words) in [
            ((2, 3), "row 1: frame 3 does not exist: there are 3"),
            ((1, 1), "row 1: frame 1 is matched with itself"),
            ((0, 1), "row 1: the pair stands here a second time"),
        ] {
            let error = pairs_of(&frames, vec![(0, 1), pair]).unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
        }
    }

    #[test]
    fn each_rule_chooses_what_it_says() {
        let pairs = |rule: &str| rule.parse::<PairRule>().unwrap().pairs(5).unwrap();
        assert_eq!(pairs("fragments:3"), [(0, 1), (0, 2), (3, 4)]);
        assert_eq!(
            pairs("window:2"),
            [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4)]
        );
        assert_eq!(pairs("all").len(), 10);
        assert_eq!(pairs("fragments:2"), [(0, 1), (2, 3)]);
    }

    #[test]
    fn what_a_rule_chooses_is_what_it_lists_in_either_order() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("list.txt");
        std::fs::write(&file, "0 3\n5 1\n").unwrap();
        let list = format!("list:{}", file.display());
        for rule in ["fragments:4", "all", "window:3", &list] {
            let rule: PairRule = rule.parse().unwrap();
            let (chosen, listed) = (rule.chooser(|| Ok(None)).unwrap(), rule.pairs(9).unwrap());
            let has_order = matches!(rule, PairRule::List { .. });
            for a in 0..9 {
                for b in 0..9 {
                    let is_listed =
                        listed.contains(&(a, b)) || (!has_order && listed.contains(&(b, a)));
                    assert_eq!(chosen(a, b), is_listed, "{rule}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn a_list_of_names_is_read_where_the_frames_are_known() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("list.txt");
        let rule: PairRule = format!("list:{}", file.display()).parse().unwrap();
        let frames = || {
            let mut frames = super::super::testing::frames(3);
            for (frame, image) in frames.iter_mut().zip(["x/a.png", "x/b.png", "x/c.png"]) {
                frame.image = image.into();
            }
            Ok(Some(frames))
        };
        std::fs::write(&file, "c.png a.png\nb.png c.png\n").unwrap();
        assert_eq!(rule.list(frames).unwrap(), Some(vec![(2, 0), (1, 2)]));
        let chosen = rule.chooser(frames).unwrap();
        assert!(chosen(2, 0) && chosen(1, 2) && !chosen(0, 2));
        let error = rule.chooser(|| Ok(None)).err().unwrap().to_string();
        assert!(
            error.contains("list.txt: ") && error.contains("--datasets"),
            "{error}"
        );
        std::fs::write(&file, "c.png d.png\n").unwrap();
        let error = rule.list(frames).unwrap_err().to_string();
        assert!(error.contains("list.txt:1: `d.png`"), "{error}");
        std::fs::write(&file, "0 1\n").unwrap();
        assert_eq!(
            rule.list(|| Ok(None)).unwrap(),
            Some(vec![(0, 1)]),
            "numbers need none"
        );
    }

    #[test]
    fn more_pairs_than_fit_are_counted_and_not_made() {
        for rule in ["all", "window:4000000000"] {
            let rule: PairRule = rule.parse().unwrap();
            let error = rule.pairs(200_000).unwrap_err().to_string();
            assert!(
                error.contains("19999900000 pairs") && error.contains("fragments:15"),
                "{error}"
            );
        }
        assert_eq!(count("window:9", 200_000), 1_799_955);
    }

    #[test]
    fn no_frames_no_pairs() {
        for rule in ["fragments:15", "all", "window:9", "window:9,stride:15"] {
            assert_eq!(count(rule, 0), 0);
            assert_eq!(count(rule, 1), 0);
        }
        assert_eq!(count(&format!("window:{}", usize::MAX), 3), 3);
    }

    #[test]
    fn rules_print_as_they_are_written() {
        for text in [
            "fragments:15",
            "all",
            "window:9",
            "window:9,stride:15",
            "list:my pairs.txt",
            "covisible:0.1..0.7",
        ] {
            assert_eq!(text.parse::<PairRule>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "al",
            "fragments",
            "fragments:1",
            "fragments:x",
            "window:0",
            "window:9,stride:0",
            "window:9,step:2",
            "list:",
            "all:3",
            "covisible:0.1",
            "covisible:0..1",
            "covisible:0.5..0.4",
            "covisible:nan..1",
        ] {
            let error = text.parse::<PairRule>().unwrap_err().to_string();
            assert!(error.contains(&format!("`{text}`")), "{error}");
        }
    }

    #[test]
    fn covisible_frames_share_the_right_part_of_their_points() {
        let seen = [
            vec![1, 2, 3, 4],
            vec![9, 3, 4, 5],
            vec![9],
            vec![],
            vec![1, 2, 3],
        ];
        let pairs = |lowest, highest| covisible(&seen, lowest, highest).unwrap();
        assert_eq!(pairs(0.2, 1.0), [(0, 1), (0, 4), (1, 2), (1, 4)]);
        assert_eq!(pairs(0.3, 0.7), [(0, 1)]);
        assert_eq!(pairs(0.75, 0.75), [(0, 4)]);
        // Two of two points here are two of five there, whichever is the first.
        for seen in [
            [vec![1, 2], vec![1, 2, 3, 4, 5]],
            [vec![1, 2, 3, 4, 5], vec![1, 2]],
        ] {
            assert_eq!(covisible(&seen, 0.4, 0.4).unwrap(), [(0, 1)]);
            assert_eq!(covisible(&seen, 0.9, 1.0).unwrap(), []);
        }
        assert_eq!(covisible(&[], 0.1, 1.0).unwrap(), []);
    }

    #[test]
    fn more_covisible_pairs_than_fit_are_refused() {
        let seen = vec![vec![7]; 10];
        assert_eq!(at_most(45, &seen, 0.5, 1.0).unwrap().len(), 45);
        let error = at_most(44, &seen, 0.5, 1.0).unwrap_err().to_string();
        for part in [
            "covisible:0.5..1",
            "10 frames have more than 44 pairs by this rule; 44 are possible",
            "choose fewer pairs",
        ] {
            assert!(error.contains(part), "{error}");
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in ".{0,40}") {
            let _ = text.parse::<PairRule>();
        }
    }
}
