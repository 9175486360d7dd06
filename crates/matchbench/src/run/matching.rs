//! From two sets of features to matched points: searched and selected.

use matchbench_vision::features::Features;
use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::matching::{Correspondences, Matcher, View};
use matchbench_vision::seed::Seed;

use super::guard::{guard, timed};
use super::seeds::selection_seed;
use crate::records::{Counts, SelectedMatches, StageTimes};

/// The nearest features, with the numbers of both and their own.
///
/// # Errors
/// If the search breaks.
pub(super) fn search(
    matcher: &dyn Matcher,
    a: &Features,
    b: &Features,
    counts: &mut Counts,
    times: &mut StageTimes,
) -> Result<Correspondences, String> {
    (counts.features_a, counts.features_b) = (count(a.len()), count(b.len()));
    let putative = timed(&mut times.search, || {
        guard("search", || matcher.search(a, b))
    })?;
    counts.putative = count(putative.len());
    Ok(putative)
}

/// The matched points that the selection leaves of the `putative` matches; `seed` is that of the pair.
///
/// # Errors
/// If the selection breaks, or names a feature that is not there.
pub(super) fn select(
    matcher: &dyn Matcher,
    a: View<'_>,
    b: View<'_>,
    putative: Correspondences,
    seed: Seed,
    counts: &mut Counts,
    times: &mut StageTimes,
) -> Result<SelectedMatches, String> {
    let seed = selection_seed(seed);
    let matches = timed(&mut times.select, || {
        guard("selection", || matcher.select(a, b, putative, seed))
    })?;
    counts.selected = count(matches.len());
    let points = guard("selection", || {
        MatchedPoints::of_matches(&matches, a.features, b.features)
    })?;
    Ok(SelectedMatches::new(*counts, &points))
}

/// Numbers of features, matches and samples fit into 32 bits by far.
pub(super) fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}
