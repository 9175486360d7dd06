//! Whether matches from outside are mostly copies of others.
//!
//! Each copy of a right match is one more correspondence, and outweighs other matches where a pose is estimated. No matcher
//! of this program makes more than a few.

use super::ResultSet;
use crate::matchers::mostly_copies;
use crate::records::{MatchesFile, RunFolder};

/// The most pairs that are looked at of a matcher on a dataset, evenly spread over all.
const MAX_PAIRS: usize = 32;
/// Fewer matches say nothing: no pose is estimated from them.
const FEW: usize = 20;

/// Of each matcher from outside and each dataset a sentence if most matches of a pair are copies of others, where the run
/// has kept any. What cannot be read is left to whoever needs it: no score does.
pub(super) fn copies(run: &RunFolder, sets: &[ResultSet]) -> Vec<String> {
    let mut sentences = Vec::new();
    for dataset in &run.plan().datasets {
        let outside = run.plan().matchers.iter();
        for matcher in outside.filter(|matcher| matcher.extraction.is_none()) {
            let is_of_both =
                |set: &&ResultSet| set.dataset == dataset.name && set.matcher == matcher.id;
            let sentence = (sets.iter().find(is_of_both)).and_then(|set| told(run, set));
            sentences.extend(sentence);
        }
    }
    sentences
}

/// What is to be said of the matches of these results.
fn told(run: &RunFolder, set: &ResultSet) -> Option<String> {
    let (mut looked_at, mut copied, mut example) = (0, 0, None);
    let kept = kept(run, set)?;
    let is_kept = |pair: &(u32, u32)| kept.contains((pair.0, pair.1, 0));
    let pairs = set.pairs.iter().map(|pair| (pair.a, pair.b));
    let pairs: Vec<(u32, u32)> = pairs.filter(is_kept).collect();
    let step = pairs.len().div_ceil(MAX_PAIRS).max(1);
    for (a, b) in pairs.into_iter().step_by(step) {
        let points = kept.read((a, b, 0)).ok()??.points;
        looked_at += 1;
        let places = points.a.iter().zip(&points.b);
        // As the file has them.
        let places = places.map(|(a, b)| [a.x, a.y, b.x, b.y].map(|x| x as f32));
        if let Some(different) = mostly_copies(places).filter(|_| points.len() >= FEW) {
            copied += 1;
            example.get_or_insert((a, b, points.len(), different));
        }
    }
    let (a, b, matches, different) = example?;
    let ResultSet {
        dataset, matcher, ..
    } = set;
    Some(format!(
        "most matches of {matcher} on {dataset} are copies of others in {copied} of {looked_at} pairs that were looked at ({a} {b}: \
         {matches} matches, {different} of them different); each copy counts in the scores, so let it give each match once"
    ))
}

/// The matches that the run has kept: all, or those that agree with a pose.
fn kept(run: &RunFolder, set: &ResultSet) -> Option<MatchesFile> {
    let has_any = |file: &MatchesFile| {
        let mut pairs = set.pairs.iter();
        pairs.any(|pair| file.contains((pair.a, pair.b, 0)))
    };
    let all = run.matches_of(&set.dataset, &set.matcher).ok();
    all.filter(has_any).or_else(|| {
        run.inliers_of(&set.dataset, &set.matcher, &set.estimator)
            .ok()
    })
}
