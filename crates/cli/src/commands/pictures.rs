//! Pairs to be looked at, from what a run left behind.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use matchbench::datasets::{Pair, Sequence, read_gray};
use matchbench::metrics::{Angle, ResultSet};
use matchbench::records::{MatchesFile, Outcome, SelectedMatches, matches, store};
use matchbench::report::{PairPoses, PairView, Thumbnail, epipolar_lines, match_views};

/// Longest side of an embedded image in pixels, and its JPEG quality.
const EMBEDDED: (u32, u8) = (480, 62);

/// Views of at most `count` pairs of each dataset with every matcher and estimator, from the
/// easiest to the hardest; only where the images and the selected matches are at hand.
pub(crate) fn sample(
    run: &Path,
    results: &[ResultSet],
    sequences: &BTreeMap<String, Sequence>,
    count: usize,
) -> Result<Vec<PairView>> {
    let mut views = Vec::new();
    for (name, sequence) in sequences {
        let sets: Vec<&ResultSet> = results.iter().filter(|set| set.dataset == *name).collect();
        let mut images = BTreeMap::new();
        for pair in chosen(&sets, sequence, count) {
            let mut thumbnail = |frame: u32| -> Option<Arc<Thumbnail>> {
                let read = || {
                    let image = read_gray(&sequence.frames[frame as usize].image).ok()?;
                    Some(Arc::new(Thumbnail::new(&image, EMBEDDED.0, EMBEDDED.1)))
                };
                images.entry(frame).or_insert_with(read).clone()
            };
            let (Some(a), Some(b)) = (thumbnail(pair.a), thumbnail(pair.b)) else {
                continue;
            };
            for set in &sets {
                let file = MatchesFile::open(&matches::path(run, name, &set.matcher))?;
                let Some(selected) = file.read((pair.a, pair.b, 0))? else {
                    continue;
                };
                let records = store::read(&store::path(run, name, &set.matcher, &set.estimator))?;
                let record = (records.iter())
                    .find(|r| (r.task.a, r.task.b, r.task.repetition) == (pair.a, pair.b, 0));
                let Some(record) = record else {
                    continue;
                };
                let images = [Arc::clone(&a), Arc::clone(&b)];
                let mut view = view(sequence, pair, &selected, &record.outcome, images);
                view.matcher.clone_from(&set.matcher);
                view.estimator.clone_from(&set.estimator);
                views.push(view);
            }
        }
    }
    Ok(views)
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
    let matches = match_views(&poses, &selected.a, &selected.b);
    let lines = epipolar_lines(&poses, &matches, images[1].original);
    PairView {
        dataset: sequence.name.clone(),
        matcher: String::new(),
        estimator: String::new(),
        frames: (pair.a, pair.b),
        images,
        matches,
        lines,
        keypoints: [Vec::new(), Vec::new()],
    }
}

/// `count` pairs, evenly taken from the order of how many matchers are right on them.
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
    (0..count)
        .map(|i| pairs[i * (pairs.len() - 1) / last].1)
        .collect()
}
