//! From two sets of features to matched points: searched and selected.

use matchbench_vision::features::Features;
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
    let points = timed(&mut times.select, || {
        guard("selection", || {
            let selected = matcher.select(a, b, putative, seed)?;
            matcher.place(a, b, &selected)
        })
    })?;
    counts.selected = count(points.len());
    Ok(SelectedMatches::new(*counts, &points))
}

/// Numbers of features, matches and samples fit into 32 bits by far.
pub(super) fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::MatchedPoints;
    use matchbench_vision::image::GrayImage;
    use matchbench_vision::matching::{Correspondence, MatcherError};
    use matchbench_vision::nalgebra::Point2;

    use super::*;

    /// Keeps no match of a feature, but knows a pair of points.
    struct Placer;

    impl Matcher for Placer {
        fn extract(&self, _: &GrayImage) -> Result<Features, MatcherError> {
            Err(MatcherError("not asked for".into()))
        }

        fn search(&self, _: &Features, _: &Features) -> Result<Correspondences, MatcherError> {
            Ok(Vec::new())
        }

        fn select(
            &self,
            _: View<'_>,
            _: View<'_>,
            putative: Correspondences,
            _: Seed,
        ) -> Result<Correspondences, MatcherError> {
            Ok(putative)
        }

        fn place(
            &self,
            _: View<'_>,
            _: View<'_>,
            selected: &[Correspondence],
        ) -> Result<MatchedPoints, MatcherError> {
            assert!(selected.is_empty());
            let mut points = MatchedPoints::default();
            points.push(Point2::new(1.5, 2.0), Point2::new(3.0, 4.25), 0.5);
            Ok(points)
        }
    }

    #[test]
    fn points_are_where_the_matcher_places_them() {
        let empty = GrayImage::filled(matchbench_vision::image::Size::new(9, 9), 0);
        let orb = crate::matchers::find("orb").unwrap().build(None).unwrap();
        let features = orb.matcher.extract(&empty).unwrap();
        let view = View {
            features: &features,
            image: None,
            camera: None,
        };
        let (mut counts, mut times) = (Counts::default(), StageTimes::default());
        let found = select(
            &Placer,
            view,
            view,
            Vec::new(),
            Seed(1),
            &mut counts,
            &mut times,
        );
        let found = found.unwrap();
        assert_eq!(found.points.b, [Point2::new(3.0, 4.25)]);
        assert_eq!((found.counts.selected, counts.selected), (1, 1));
        assert!(times.select.is_some());
    }
}
