//! From two image files to matched points, at once: a source that has no stages of its own here.
//!
//! What comes from outside is checked before it is believed: as many points in both images, finite
//! positions, ambiguities from 0 to 1.

use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::seed::Seed;

use super::RunError;
use super::guard::guard;
use super::matching::count;
use super::seeds::selection_seed;
use crate::matchers::{BuiltPointSource, ImageFiles, SourceError, SourcedMatches};
use crate::records::{Counts, SelectedMatches, StageTimes};

/// The matched points of a pair, or why there are none; `seed` is that of the pair.
///
/// # Errors
/// [`RunError::SourceEnded`] if there will be none for any pair.
pub(super) fn sourced(
    source: &BuiltPointSource,
    pair: &ImageFiles<'_>,
    seed: Seed,
    counts: &mut Counts,
    times: &mut StageTimes,
) -> Result<Result<SelectedMatches, String>, RunError> {
    let seed = selection_seed(seed);
    let mut ended = None;
    let matches = guard(format_args!("matching by {}", source.id), || {
        source.source.matches(pair, seed).inspect_err(|error| {
            if let SourceError::Ended(reason) = error {
                ended = Some(reason.clone());
            }
        })
    });
    if let Some(reason) = ended {
        let id = source.id.clone();
        return Err(RunError::SourceEnded { id, reason });
    }
    Ok(matches.and_then(|matches| {
        check(&matches).map_err(|reason| format!("matching by {} failed: {reason}", source.id))?;
        [times.extract_a, times.extract_b] = matches.seconds.extract;
        times.search = matches.seconds.matching;
        let selected = count(matches.points.a.len());
        *counts = Counts {
            features_a: matches.features[0],
            features_b: matches.features[1],
            putative: matches.putative.unwrap_or(selected),
            selected,
        };
        Ok(SelectedMatches::new(*counts, &matches.points))
    }))
}

fn check(matches: &SourcedMatches) -> Result<(), String> {
    let SourcedMatches {
        points, seconds, ..
    } = matches;
    let MatchedPoints { a, b, ambiguity } = points;
    if a.len() != b.len() || a.len() != ambiguity.len() {
        return Err(format!(
            "{} points in a, {} in b and {} ambiguities are no matches",
            a.len(),
            b.len(),
            ambiguity.len()
        ));
    }
    if let Some(index) =
        (a.iter().zip(b)).position(|(a, b)| ![a.x, a.y, b.x, b.y].iter().all(|x| x.is_finite()))
    {
        return Err(format!("match {index} has a position that is not finite"));
    }
    if let Some(index) = (ambiguity.iter()).position(|x| !(0.0..=1.0).contains(x)) {
        return Err(format!(
            "match {index} has the ambiguity {}; it must be from 0 to 1",
            ambiguity[index]
        ));
    }
    let mut seconds = [seconds.extract[0], seconds.extract[1], seconds.matching].into_iter();
    match seconds.find_map(|time| time.filter(|time| !(*time >= 0.0 && time.is_finite()))) {
        Some(time) => Err(format!("{time} seconds are no time")),
        None => Ok(()),
    }
}
