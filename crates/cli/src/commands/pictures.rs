//! Pairs to be looked at, from what a run left behind.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use matchbench::datasets::{Pair, Sequence, read_gray};
use matchbench::metrics::{Angle, ResultSet};
use matchbench::records::{MatchesFile, Outcome, SelectedMatches, matches, store};
use matchbench::report::{
    PairPoses, PairView, Points, Tally, Thumbnail, epipolar_lines, evenly, match_views,
};
use matchbench::run::{FeatureCache, Plan};

/// Longest side of an embedded image in pixels, and its JPEG quality.
const EMBEDDED: (u32, u8) = (480, 62);
/// Most matches of a pair, and keypoints of an image, that are drawn.
const MOST_MATCHES: usize = 120;
const MOST_KEYPOINTS: usize = 250;

/// Views of at most `count` pairs of each dataset with every matcher and estimator, pair by pair;
/// the first few are spread from the easiest to the hardest. Only where the images and the selected
/// matches are at hand.
pub(crate) fn sample(
    run: &Path,
    results: &[ResultSet],
    sequences: &BTreeMap<String, Sequence>,
    mut keypoints: Keypoints<'_>,
    count: usize,
) -> Result<Vec<PairView>> {
    let mut views = Vec::new();
    for (name, sequence) in sequences {
        let sets: Vec<&ResultSet> = results.iter().filter(|set| set.dataset == *name).collect();
        let pairs = chosen(&sets, sequence, count);
        let images = thumbnails(sequence, &pairs);
        let mut of_dataset = Vec::new();
        for set in &sets {
            let file = MatchesFile::open(&matches::path(run, name, &set.matcher))?;
            let records = store::read(&store::path(run, name, &set.matcher, &set.estimator))?;
            let outcomes: BTreeMap<_, _> = (records.iter())
                .filter(|record| record.task.repetition == 0)
                .map(|record| ((record.task.a, record.task.b), &record.outcome))
                .collect();
            for (rank, pair) in pairs.iter().enumerate() {
                let (Some(a), Some(b)) = (images.get(&pair.a), images.get(&pair.b)) else {
                    continue;
                };
                let Some(outcome) = outcomes.get(&(pair.a, pair.b)) else {
                    continue;
                };
                let Some(selected) = file.read((pair.a, pair.b, 0))? else {
                    continue;
                };
                let images = [Arc::clone(a), Arc::clone(b)];
                let mut view = view(sequence, pair, &selected, outcome, images);
                view.matches = evenly(&view.matches, MOST_MATCHES);
                view.matcher.clone_from(&set.matcher);
                view.estimator.clone_from(&set.estimator);
                view.keypoints =
                    [pair.a, pair.b].map(|frame| keypoints.of(&set.matcher, sequence, frame));
                of_dataset.push((rank, view));
            }
        }
        of_dataset.sort_by_key(|(rank, _)| *rank);
        views.extend(of_dataset.into_iter().map(|(_, view)| view));
    }
    Ok(views)
}

/// The images of some pairs, made small; what cannot be read is left out.
fn thumbnails(sequence: &Sequence, pairs: &[&Pair]) -> BTreeMap<u32, Arc<Thumbnail>> {
    let frames: BTreeSet<u32> = pairs.iter().flat_map(|pair| [pair.a, pair.b]).collect();
    (frames.into_iter())
        .filter_map(|frame| {
            let image = read_gray(&sequence.frames[frame as usize].image).ok()?;
            let thumbnail = Thumbnail::new(&image, EMBEDDED.0, EMBEDDED.1);
            Some((frame, Arc::new(thumbnail)))
        })
        .collect()
}

/// Keypoints from the feature cache, as far as it has them.
pub(crate) struct Keypoints<'a> {
    plan: &'a Plan,
    cache: FeatureCache,
    /// By matcher, dataset and frame.
    found: BTreeMap<(String, String, u32), Points>,
}

impl<'a> Keypoints<'a> {
    /// Those of the matchers of a run.
    pub(crate) fn new(plan: &'a Plan, cache: FeatureCache) -> Self {
        Self {
            plan,
            cache,
            found: BTreeMap::new(),
        }
    }

    /// Some keypoints of a frame, evenly taken from the list; none where they are not known.
    fn of(&mut self, matcher: &str, sequence: &Sequence, frame: u32) -> Points {
        let find = || {
            let matcher = self.plan.matchers.iter().find(|plan| plan.id == matcher)?;
            let image = &sequence.frames[frame as usize].image;
            let features = self.cache.find(image, &matcher.extraction)?;
            let keypoints = evenly(&features.keypoints, MOST_KEYPOINTS);
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

/// A pair with its matches; the names of matcher and estimator are left empty.
pub(crate) fn view(
    sequence: &Sequence,
    pair: &Pair,
    selected: &SelectedMatches,
    outcome: &Outcome,
    images: [Arc<Thumbnail>; 2],
) -> PairView {
    let camera = |frame: u32| &sequence.frames[frame as usize].camera;
    let poses = PairPoses::new(camera(pair.a), camera(pair.b), &pair.b_from_a, outcome);
    let matches = match_views(&poses, &selected.points.a, &selected.points.b);
    let lines = epipolar_lines(&poses, &matches, images[1].original);
    PairView {
        dataset: sequence.name.clone(),
        matcher: String::new(),
        estimator: String::new(),
        frames: (pair.a, pair.b),
        images,
        tally: Tally::of(&matches),
        matches,
        lines,
        keypoints: [Vec::new(), Vec::new()],
    }
}

/// `count` pairs, evenly taken from the order of how many matchers are right on them, the first few
/// from all over it.
fn chosen<'a>(sets: &[&ResultSet], sequence: &'a Sequence, count: usize) -> Vec<&'a Pair> {
    let mut right = BTreeMap::<(u32, u32), u32>::new();
    for pair in sets.iter().flat_map(|set| &set.pairs) {
        let is_right = pair.error(Angle::Pose).is_some_and(|error| error < 5.0);
        *right.entry((pair.a, pair.b)).or_default() += u32::from(is_right);
    }
    let mut pairs: Vec<(u32, &Pair)> = (sequence.pairs.iter())
        .filter_map(|pair| Some((*right.get(&(pair.a, pair.b))?, pair)))
        .collect();
    pairs.sort_by_key(|&(right, pair)| (std::cmp::Reverse(right), pair.a, pair.b));
    let count = count.min(pairs.len());
    let last = count.saturating_sub(1).max(1);
    let mut ranks: Vec<usize> = (0..count).collect();
    // 0, half, a quarter ...: wherever the list is cut, it is spread.
    ranks.sort_by_key(|&rank| (rank as u32).reverse_bits());
    (ranks.into_iter())
        .map(|i| pairs[i * (pairs.len() - 1) / last].1)
        .collect()
}
