//! Chooses the pairs of a run that are shown with pictures, and makes their views.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rayon::prelude::*;

use super::pair_homography::PairHomographies;
use super::pair_view::{
    PairPoses, PairView, Points, Tally, Thumbnail, epipolar_lines, evenly, match_views,
};
use crate::cache::FeatureCache;
use crate::datasets::{Pair, Sequence};
use crate::metrics::{DatasetGeometry, Model, ResultSet, hard_pairs};
use crate::records::{Outcome, Plan, RunFolder, SelectedMatches, StoreError};

/// Longest side of an embedded image in pixels, and its JPEG quality.
const EMBEDDED: (u32, u8) = (480, 62);
/// Most matches of a pair, and most keypoints of an image, that are drawn.
const MAX_MATCHES: usize = 120;
const MAX_KEYPOINTS: usize = 250;

/// Views of at most `count` pairs of each dataset with every matcher and estimator, pair by pair. The first few
/// pairs are spread from the easiest to the hardest, and examples of each kind of hard pairs are among them. A
/// view is only made if the images and the selected matches are available.
///
/// # Errors
/// If records or matches cannot be read.
pub(super) fn sample(
    run: &RunFolder,
    results: &[ResultSet],
    sequences: &BTreeMap<String, Sequence>,
    geometry: &BTreeMap<String, DatasetGeometry>,
    mut keypoints: Keypoints<'_>,
    count: usize,
) -> Result<(Vec<PairView>, Vec<String>), StoreError> {
    let (mut views, mut notes) = (Vec::new(), Vec::new());
    for (name, sequence) in sequences {
        let sets: Vec<&ResultSet> = results.iter().filter(|set| set.dataset == *name).collect();
        let hard = hard_pairs(&sets, geometry.get(name));
        let examples: BTreeSet<(u32, u32)> = hard.iter().filter_map(|hard| hard.example).collect();
        let examples = sequence
            .pairs
            .iter()
            .filter(|pair| examples.contains(&(pair.a, pair.b)));
        let examples: Vec<&Pair> = examples.take(count).collect();
        let mut pairs = chosen(&sets, sequence, count);
        pairs.retain(|pair| !examples.contains(pair));
        pairs.truncate(count - examples.len());
        pairs.extend(examples);
        let images = thumbnails(&[run], sequence, &pairs);
        notes.extend(images.note);
        let images = images.small;
        let mut of_dataset = Vec::new();
        for set in &sets {
            of_dataset.extend(views_of(
                run,
                set,
                sequence,
                &pairs,
                &images,
                &mut keypoints,
            )?);
        }
        of_dataset.sort_by_key(|(rank, _)| *rank);
        views.extend(of_dataset.into_iter().map(|(_, view)| view));
    }
    Ok((views, notes))
}

/// Views of `pairs` with the matches that a run kept of one method, each with the position of its pair in
/// `pairs`. What is not available is left out.
///
/// # Errors
/// If records or matches cannot be read.
pub(super) fn views_of(
    run: &RunFolder,
    set: &ResultSet,
    sequence: &Sequence,
    pairs: &[&Pair],
    images: &BTreeMap<u32, Arc<Thumbnail>>,
    keypoints: &mut Keypoints<'_>,
) -> Result<Vec<(usize, PairView)>, StoreError> {
    let name = &set.dataset;
    let mut views = Vec::new();
    let all = run.matches_of(name, &set.matcher)?;
    let inliers = run.inliers_of(name, &set.matcher, &set.estimator)?;
    let shown: BTreeSet<_> = pairs.iter().map(|pair| (pair.a, pair.b)).collect();
    let mut outcomes = BTreeMap::new();
    run.for_each_of([name, &set.matcher, &set.estimator], |record| {
        let pair = (record.task.a, record.task.b);
        if record.task.repetition == 0 && shown.contains(&pair) {
            outcomes.insert(pair, record.outcome);
        }
    })?;
    for (rank, pair) in pairs.iter().enumerate() {
        let (Some(a), Some(b)) = (images.get(&pair.a), images.get(&pair.b)) else {
            continue;
        };
        let Some(outcome) = outcomes.get(&(pair.a, pair.b)) else {
            continue;
        };
        let key = (pair.a, pair.b, 0);
        let file = if all.contains(key) { &all } else { &inliers };
        let Some(selected) = file.read(key)? else {
            continue;
        };
        let images = [Arc::clone(a), Arc::clone(b)];
        let Some(mut view) = view(sequence, pair, &selected, outcome, images) else {
            continue;
        };
        view.matches = evenly(&view.matches, MAX_MATCHES);
        view.matcher.clone_from(&set.matcher);
        view.estimator.clone_from(&set.estimator);
        view.keypoints = [pair.a, pair.b].map(|frame| keypoints.of(&set.matcher, sequence, frame));
        views.push((rank, view));
    }
    Ok(views)
}

/// Small images by their frames, and notes about those that are left out.
#[derive(Default)]
pub(super) struct Thumbnails {
    pub(super) small: BTreeMap<u32, Arc<Thumbnail>>,
    pub(super) note: Option<String>,
}

/// The images of some pairs, made small. An image is left out if it cannot be read, or if it is not the image
/// that one of the `runs` matched.
pub(super) fn thumbnails(runs: &[&RunFolder], sequence: &Sequence, pairs: &[&Pair]) -> Thumbnails {
    let noted: Vec<_> = (runs.iter())
        .filter_map(|run| run.images_of(&sequence.name).ok())
        .collect();
    let is_matched = |frame: u32| {
        let image = &sequence.frames[frame as usize].image;
        noted.iter().all(|noted| noted.is_as_noted(frame, image))
    };
    let frames: BTreeSet<u32> = pairs.iter().flat_map(|pair| [pair.a, pair.b]).collect();
    let small: BTreeMap<u32, Arc<Thumbnail>> = (frames.par_iter())
        .filter(|frame| is_matched(**frame))
        .filter_map(|&frame| {
            let planes = sequence.frames[frame as usize].planes().ok()?;
            let thumbnail = Thumbnail::new(&planes, EMBEDDED.0, EMBEDDED.1);
            Some((frame, Arc::new(thumbnail)))
        })
        .collect();
    let left_out = frames.iter().filter(|frame| !small.contains_key(frame));
    let changed = left_out.copied().find(|frame| !is_matched(*frame));
    let note = changed.map(|frame| {
        format!(
            "{} is another image than the one that was matched; no picture shows it",
            sequence.frames[frame as usize].image.display()
        )
    });
    Thumbnails { small, note }
}

/// Keypoints from the feature cache, as far as it has them.
pub(super) struct Keypoints<'a> {
    plan: &'a Plan,
    cache: FeatureCache,
    /// By matcher, dataset and frame.
    found: BTreeMap<(String, String, u32), Points>,
}

impl<'a> Keypoints<'a> {
    /// The keypoints of the matchers of a run.
    pub(super) fn new(plan: &'a Plan, cache: FeatureCache) -> Self {
        Self {
            plan,
            cache,
            found: BTreeMap::new(),
        }
    }

    /// Some keypoints of a frame, evenly spread over the list; empty if they are not known.
    fn of(&mut self, matcher: &str, sequence: &Sequence, frame: u32) -> Points {
        let find = || {
            let extraction = self.plan.matcher(matcher)?.extraction.as_ref()?;
            let frame = &sequence.frames[frame as usize];
            let features = self
                .cache
                .find(&frame.image, frame.turn.into(), extraction)?;
            let keypoints = evenly(&features.keypoints, MAX_KEYPOINTS);
            Some(
                keypoints
                    .iter()
                    .map(|keypoint| keypoint.at.cast())
                    .collect(),
            )
        };
        let key = (matcher.to_owned(), sequence.name.clone(), frame);
        (self.found.entry(key))
            .or_insert_with(|| find().unwrap_or_default())
            .clone()
    }
}

/// A pair with its matches. The names of matcher and estimator, and the keypoints, are left empty. `None` if
/// there is no truth for the kind of model in the outcome.
pub fn view(
    sequence: &Sequence,
    pair: &Pair,
    selected: &SelectedMatches,
    outcome: &Outcome,
    images: [Arc<Thumbnail>; 2],
) -> Option<PairView> {
    let camera = |frame: u32| &sequence.frames[frame as usize].camera;
    let (a, b) = (&selected.points.a, &selected.points.b);
    let of_homography = matches!(
        outcome,
        Outcome::Homography { .. } | Outcome::NoHomography { .. }
    );
    let (matches, lines, model) = match (pair.pose(), pair.homography()) {
        (Some(pose), _) if !of_homography => {
            let poses = PairPoses::new(camera(pair.a), camera(pair.b), pose, outcome);
            let matches = match_views(&poses, a, b);
            let lines = epipolar_lines(&poses, &matches, images[1].original);
            (matches, lines, Model::Pose)
        }
        (_, truth) => {
            let pair = PairHomographies {
                truth: *truth?,
                estimate: outcome.homography(),
            };
            let outline = pair.outline(images[0].original);
            (pair.match_views(a, b), vec![outline], Model::Homography)
        }
    };
    Some(PairView {
        dataset: sequence.name.clone(),
        matcher: String::new(),
        estimator: String::new(),
        frames: (pair.a, pair.b),
        images,
        tally: Tally::of(&matches),
        matches,
        lines,
        model,
        homography: outcome.homography(),
        keypoints: [Vec::new(), Vec::new()],
    })
}

/// Chooses `count` pairs, evenly spread over the list of pairs in the order of how many matchers solve them.
/// Any first few of the result are spread over the whole list too.
fn chosen<'a>(sets: &[&ResultSet], sequence: &'a Sequence, count: usize) -> Vec<&'a Pair> {
    let mut right = BTreeMap::<(u32, u32), u32>::new();
    for pair in sets.iter().flat_map(|set| &set.pairs) {
        let limit = match pair.model {
            Model::Pose => 5.0,
            Model::Homography => 3.0,
        };
        let is_right = pair.judged_error().is_some_and(|error| error < limit);
        *right.entry((pair.a, pair.b)).or_default() += u32::from(is_right);
    }
    let mut pairs: Vec<(u32, &Pair)> = (sequence.pairs.iter())
        .filter_map(|pair| Some((*right.get(&(pair.a, pair.b))?, pair)))
        .collect();
    pairs.sort_by_key(|&(right, pair)| (std::cmp::Reverse(right), pair.a, pair.b));
    let count = count.min(pairs.len());
    let last = count.saturating_sub(1).max(1);
    let mut ranks: Vec<usize> = (0..count).collect();
    // The order is 0, half, a quarter ...: wherever the list is cut, the pairs are spread.
    ranks.sort_by_key(|&rank| (rank as u32).reverse_bits());
    (ranks.into_iter())
        .map(|i| pairs[i * (pairs.len() - 1) / last].1)
        .collect()
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::Camera;
    use nalgebra::Isometry3;

    use super::*;
    use crate::datasets::{Frame, Turn};
    use crate::metrics::{AngularError, Deviation, Failure, PairResult};

    /// A dataset of the pairs (0, 1), (0, 2) ... (0, 8).
    fn sequence() -> Sequence {
        let frame = Frame {
            turn: Turn::None,
            image: "nowhere.png".into(),
            name: None,
            camera: Camera::pinhole(8.0, 8.0, 3.5, 3.5),
            world_from_camera: None,
            depth: None,
        };
        let b_from_a = Isometry3::translation(1.0, 0.0, 0.0);
        Sequence {
            name: "street".into(),
            frames: vec![frame; 9],
            pairs: (1..9).map(|b| Pair::with_pose(0, b, b_from_a)).collect(),
        }
    }

    /// A matcher that is right on the pairs with the frames `right`.
    fn set(right: &[u32]) -> ResultSet {
        let result = |b: u32| {
            let mut pair = PairResult::failed(0, b, Failure::NoSupport);
            if right.contains(&b) {
                pair.outcome = Ok(Deviation::Pose(AngularError {
                    rotation: 0.1,
                    translation: Some(0.2),
                }));
            }
            pair
        };
        ResultSet {
            dataset: "street".into(),
            matcher: "m".into(),
            estimator: "e".into(),
            repetitions: 1,
            pairs: (1..9).map(result).collect(),
            ignored: 0,
            lacking: 0,
        }
    }

    fn frames(sets: &[&ResultSet], count: usize) -> Vec<u32> {
        let sequence = sequence();
        let pairs = chosen(sets, &sequence, count);
        pairs.iter().map(|pair| pair.b).collect()
    }

    #[test]
    fn the_easiest_and_the_hardest_pair_come_first() {
        // Right on 5 with both, on 3 and 8 with one: the order is 5, 3, 8, 1, 2, 4, 6, 7.
        let (one, other) = (set(&[5, 3]), set(&[5, 8]));
        assert_eq!(frames(&[&one, &other], 2), [5, 7]);
        assert_eq!(frames(&[&one, &other], 1), [5]);
        let mut all = frames(&[&one, &other], usize::MAX);
        assert_eq!(all[..2], [5, 2], "then half-way");
        all.sort_unstable();
        assert_eq!(all, [1, 2, 3, 4, 5, 6, 7, 8], "each once");
    }

    #[test]
    fn pairs_without_a_result_have_no_picture() {
        let mut limited = set(&[1]);
        limited.pairs.truncate(3);
        assert_eq!(frames(&[&limited], 8).len(), 3);
        assert!(frames(&[], 8).is_empty() && frames(&[&limited], 0).is_empty());
    }
}
