//! The view of a pair whose homography is known: matches by their distance from it, and the frame of image a as
//! seen in image b.

use matchbench_vision::geometry::transfer;
use nalgebra::{Matrix3, Point2};

use super::pair_view::{EpipolarLines, MatchView, Points, agrees_below};
use crate::metrics::Model;

/// Points on each side of the frame. Several are needed, since a side that reaches the horizon is not straight.
const PER_SIDE: usize = 16;

/// The true homography of a pair, and the estimated one, if there is one.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairHomographies {
    pub(super) truth: Matrix3<f64>,
    pub(super) estimate: Option<Matrix3<f64>>,
}

impl PairHomographies {
    /// The matches `a[i]`, `b[i]`, by the distance from b to the place where the homographies map a.
    pub(super) fn match_views(&self, a: &[Point2<f64>], b: &[Point2<f64>]) -> Vec<MatchView> {
        let distance = |h: &Matrix3<f64>, a, b: &Point2<f64>| (transfer(h, a) - b).norm();
        let near = agrees_below(Model::Homography);
        (a.iter().zip(b))
            .map(|(&a, b)| MatchView {
                a,
                b: *b,
                distance: Some(distance(&self.truth, a, b)),
                agrees: (self.estimate).is_some_and(|h| distance(&h, a, b) < near),
            })
            .collect()
    }

    /// The border of image a, of so many columns and rows, in image b. It begins and ends at one corner; the
    /// match of the result is the places of this corner in both images.
    pub(super) fn outline(&self, (width, height): (usize, usize)) -> EpipolarLines {
        let [right, bottom] = [width, height].map(|side| side.saturating_sub(1) as f64);
        let corners = [[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]].map(Point2::from);
        let along = |h: &Matrix3<f64>| -> Points {
            let sides = (0..4).flat_map(|side| {
                let (from, to) = (corners[side], corners[(side + 1) % 4]);
                let at = move |i: usize| from + (to - from) * (i as f64 / PER_SIDE as f64);
                (0..PER_SIDE).map(at)
            });
            let frame = sides.chain([corners[0]]).map(|point| transfer(h, point));
            frame
                .filter(|p| p.x.is_finite() && p.y.is_finite())
                .collect()
        };
        EpipolarLines {
            a: corners[0],
            b: transfer(&self.truth, corners[0]),
            truth: along(&self.truth),
            estimate: self.estimate.as_ref().map_or_else(Vec::new, along),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWICE: Matrix3<f64> = Matrix3::new(2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0);

    #[test]
    fn matches_are_judged_where_they_should_be_in_b() {
        let pair = PairHomographies {
            truth: TWICE,
            estimate: Some(Matrix3::identity()),
        };
        let a = [Point2::new(4.0, 3.0), Point2::new(1.0, 1.0)];
        let b = [Point2::new(8.0, 6.0), Point2::new(2.0, 5.0)];
        let views = pair.match_views(&a, &b);
        assert_eq!(
            views.iter().map(|v| v.distance).collect::<Vec<_>>(),
            [Some(0.0), Some(3.0)]
        );
        assert!(!views[0].agrees && !views[1].agrees);
        let right = PairHomographies {
            estimate: Some(TWICE),
            ..pair
        };
        assert!(right.match_views(&a, &b)[0].agrees);
    }

    #[test]
    fn the_frame_of_a_is_closed_and_goes_through_its_corners() {
        let pair = PairHomographies {
            truth: TWICE,
            estimate: None,
        };
        let outline = pair.outline((4, 5));
        for corner in [[0.0, 0.0], [6.0, 0.0], [6.0, 8.0], [0.0, 8.0]] {
            assert!(outline.truth.contains(&Point2::from(corner)), "{corner:?}");
        }
        assert_eq!(outline.truth.first(), outline.truth.last());
        assert!(outline.estimate.is_empty());
    }
}
