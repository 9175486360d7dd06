//! How long a pair takes: what the records say of the stages, put together.

use std::collections::BTreeSet;

use crate::metrics::{Quartiles, StageQuartiles, Summary};

use super::content::Content;
use super::overview::Overview;

/// The stages of a matcher on a dataset. Each stage is timed only with the first estimator, since the other
/// estimators are given the same matches. Detection is timed only with the first matcher that has these
/// features. The time of the pose is that of `summary`.
pub(super) fn stages_of(content: &Content, summary: &Summary) -> StageQuartiles {
    let features = |matcher: &str| content.extractions.get(matcher);
    let here = || (content.summaries.iter()).filter(|s| s.dataset == summary.dataset);
    let stage = |get: fn(&StageQuartiles) -> Option<Quartiles>| {
        let mut same = here().filter(|s| s.matcher == summary.matcher);
        get(&summary.stages).or_else(|| same.find_map(|s| get(&s.stages)))
    };
    let extract = || {
        let own = features(&summary.matcher)?;
        let mut same = here().filter(|s| features(&s.matcher) == Some(own));
        same.find_map(|s| s.stages.extract)
    };
    StageQuartiles {
        extract: stage(|stages| stages.extract).or_else(extract),
        search: stage(|stages| stages.search),
        select: stage(|stages| stages.select),
        outside: stage(|stages| stages.outside),
        ..summary.stages
    }
}

/// Seconds for a pair if both its images are new: the sum of the medians of all stages that were timed, with
/// detection twice; or, of a matcher of [one stage](is_of_one_stage), how long a pair was waited for, and the pose. `None`
/// if these were not timed.
pub(super) fn seconds_for_a_pair(content: &Content, summary: &Summary) -> Option<f64> {
    let stages = stages_of(content, summary);
    let optional = |stage: Option<Quartiles>| stage.map_or(0.0, |spread| spread.median);
    let matching = if is_of_one_stage(content, summary) {
        // Its own word may leave out what it does with the images first.
        stages.outside.or(stages.search)?.median
    } else {
        let (extract, search) = (stages.extract?.median, stages.search?.median);
        2.0 * extract + search + optional(stages.select)
    };
    Some(matching + optional(stages.estimate))
}

/// Whether a matcher from outside gets matches from two images at once, so that all that it does is done for the pair: it
/// has no features of images, and nowhere a time of an image.
fn is_of_one_stage(content: &Content, summary: &Summary) -> bool {
    let mut own = (content.summaries.iter()).filter(|other| other.matcher == summary.matcher);
    content.outside.contains_key(&summary.matcher)
        && own.all(|Summary { stages, .. }| {
            // Pairs without matches do not say whether there were features.
            let has_features = stages.features.is_some_and(|features| features.mean > 0.0);
            stages.extract.is_none() && !has_features
        })
}

/// What is to be said of the times for a pair on a dataset, in sentences: which are of matchers of [one
/// stage](is_of_one_stage), and which are not known, and why.
pub(super) fn about_times(
    content: &Content,
    overview: &Overview<'_>,
    column: usize,
) -> Option<String> {
    let here = || {
        let cells = overview.rows.iter();
        cells.filter_map(|row| Some(row.cells[column].as_ref()?.summary))
    };
    let is_timed = |summary: &&Summary| seconds_for_a_pair(content, summary).is_some();
    let at_once: BTreeSet<&str> = (here().filter(is_timed))
        .filter(|summary| is_of_one_stage(content, summary))
        .map(|summary| &*summary.matcher)
        .collect();
    let untimed: BTreeSet<&str> = (here().filter(|summary| !is_timed(summary)))
        .map(|summary| &*summary.matcher)
        .collect();
    let (outside, own): (Vec<&str>, Vec<&str>) =
        (untimed.into_iter()).partition(|matcher| content.outside.contains_key(*matcher));
    let reasons = [
        ("features came from the cache", own),
        (
            "they come from elsewhere and do not tell that of an image or of a search",
            outside,
        ),
    ];
    let reasons: Vec<String> = (reasons.into_iter())
        .filter(|(_, matchers)| !matchers.is_empty())
        .map(|(reason, matchers)| format!("since {reason}: {}", matchers.join(", ")))
        .collect();
    let mut sentences = Vec::new();
    if !at_once.is_empty() {
        let at_once: Vec<&str> = at_once.into_iter().collect();
        sentences.push(format!(
            "Matchers without features take all their time for the pair, as long as it was waited for: {}.",
            at_once.join(", ")
        ));
    }
    if !reasons.is_empty() {
        sentences.push(format!("Without a time, {}.", reasons.join("; ")));
    }
    (!sentences.is_empty()).then(|| sentences.join(" "))
}
