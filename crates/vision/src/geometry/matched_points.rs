//! Matched points of two images, in pixels: the result of selection and the input of estimation.

use nalgebra::Point2;

use super::{Camera, Covariances, PointPairs};

/// Matched points of two images: `a[i]` and `b[i]` are assumed to show the same scene point.
///
/// All lists must have the same length. Every estimator first calls [`MatchedPoints::at_depth_1`] or
/// [`MatchedPoints::in_pixels`], and these panic if the lengths differ.
///
/// ```
/// use matchbench_vision::geometry::MatchedPoints;
/// use matchbench_vision::nalgebra::Point2;
///
/// let mut matches = MatchedPoints::default();
/// matches.push(Point2::new(10.0, 20.0), Point2::new(14.5, 20.0), 0.6);
/// assert_eq!(matches.len(), 1);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MatchedPoints {
    /// Positions in image `a`, in pixels.
    pub a: Vec<Point2<f64>>,
    /// Positions in image `b`, in pixels.
    pub b: Vec<Point2<f64>>,
    /// How ambiguous each match is, from 0 (certain) to 1 (a second candidate is as good): the ratio of the
    /// nearest to the second nearest distance of descriptors, or one minus a learned confidence. It is above 1 if
    /// a selector chose another candidate than the nearest. Samplers that try certain matches first use the order of
    /// these values. A search that uses `turns` multiplies `1 - ambiguity` by its trust in the match, and so uses the
    /// values too.
    pub ambiguity: Vec<f32>,
    /// The angle by which the keypoint of `b` is turned relative to that of `a`, in radians; `None` if it is
    /// not known for every match. Scores that use it trust a match less if its angle differs from that of most
    /// matches (see [`Score`](crate::robust::Score)).
    pub turns: Option<Vec<f32>>,
    /// The natural logarithm of how many times as large the keypoint of `b` is as that of `a`, in pixels of each
    /// image; `None` if it is not known for every match. A search that keeps several
    /// [hypotheses](crate::robust::Geometry::Essential) uses it beside `turns` to choose among them.
    pub growths: Option<Vec<f32>>,
}

impl MatchedPoints {
    /// Matches from their positions in both images and their ambiguities.
    ///
    /// # Panics
    /// If the lists have different lengths.
    pub fn new(a: Vec<Point2<f64>>, b: Vec<Point2<f64>>, ambiguity: Vec<f32>) -> Self {
        let points = Self {
            a,
            b,
            ambiguity,
            turns: None,
            growths: None,
        };
        points.check();
        points
    }

    /// The same matches, with the angles by which their keypoints are turned, in radians; `None` if they are
    /// not known for every match.
    ///
    /// # Panics
    /// If the numbers of angles and of matches differ.
    #[must_use]
    pub fn with_turns(self, turns: Option<Vec<f32>>) -> Self {
        let points = Self { turns, ..self };
        points.check();
        points
    }

    /// The same matches, with the logarithms of how many times as large their keypoints are in `b`; `None` if they
    /// are not known for every match.
    ///
    /// # Panics
    /// If the numbers of logarithms and of matches differ.
    #[must_use]
    pub fn with_growths(self, growths: Option<Vec<f32>>) -> Self {
        let points = Self { growths, ..self };
        points.check();
        points
    }

    /// Number of matches.
    pub fn len(&self) -> usize {
        self.a.len()
    }

    /// Whether there are no matches.
    pub fn is_empty(&self) -> bool {
        self.a.is_empty()
    }

    /// Appends a match of which no more is known, so [`turns`](Self::turns) and [`growths`](Self::growths) become
    /// `None`.
    pub fn push(&mut self, a: Point2<f64>, b: Point2<f64>, ambiguity: f32) {
        self.a.push(a);
        self.b.push(b);
        self.ambiguity.push(ambiguity);
        self.turns = None;
        self.growths = None;
    }

    /// The matches whose entry in `mask` is `true`, in their order.
    ///
    /// # Panics
    /// If the mask has another length.
    #[must_use]
    pub fn masked(&self, mask: &[bool]) -> Self {
        assert_eq!(mask.len(), self.a.len(), "one entry for each match");
        let kept = (0..self.a.len()).filter(|&i| mask[i]);
        let indices: Vec<u32> = kept.map(|i| i as u32).collect();
        self.chosen(&indices)
    }

    /// The matches with these indices, in this order.
    ///
    /// # Panics
    /// If there is no match with such an index.
    #[must_use]
    pub fn chosen(&self, indices: &[u32]) -> Self {
        fn chosen<T: Copy>(values: &[T], indices: &[u32]) -> Vec<T> {
            indices.iter().map(|&i| values[i as usize]).collect()
        }
        Self {
            a: chosen(&self.a, indices),
            b: chosen(&self.b, indices),
            ambiguity: chosen(&self.ambiguity, indices),
            turns: (self.turns.as_ref()).map(|turns| chosen(turns, indices)),
            growths: (self.growths.as_ref()).map(|growths| chosen(growths, indices)),
        }
    }

    /// The matches as points at depth 1: calibration and lens distortion of each camera are undone.
    ///
    /// # Panics
    /// If the lists have different lengths.
    pub fn at_depth_1(&self, camera_a: &Camera, camera_b: &Camera) -> PointPairs {
        self.check();
        (self.a.iter().zip(&self.b))
            .map(|(&a, &b)| (camera_a.normalize(a), camera_b.normalize(b)))
            .collect()
    }

    /// As [`MatchedPoints::at_depth_1`], and if a lens distorts, with the [covariances](super::Covariances) of
    /// image noise at depth 1.
    ///
    /// # Panics
    /// If the lists have different lengths.
    pub fn at_depth_1_with_covariances(&self, camera_a: &Camera, camera_b: &Camera) -> PointPairs {
        let mut pairs = self.at_depth_1(camera_a, camera_b);
        let lenses = [camera_a, camera_b].map(|camera| camera.distortion.as_ref());
        pairs.covariances = Covariances::of_lenses(pairs.iter(), lenses[0], lenses[1]);
        pairs
    }

    /// The matches in pixels, unchanged, in one array per coordinate.
    ///
    /// # Panics
    /// If the lists have different lengths.
    pub fn in_pixels(&self) -> PointPairs {
        self.check();
        self.a.iter().copied().zip(self.b.iter().copied()).collect()
    }

    fn check(&self) {
        assert_eq!(self.a.len(), self.b.len(), "each match has two points");
        assert_eq!(
            self.a.len(),
            self.ambiguity.len(),
            "each match has an ambiguity"
        );
        let turns = self.turns.as_ref().map_or(self.a.len(), Vec::len);
        assert_eq!(self.a.len(), turns, "each match has a turn, or none");
        let growths = self.growths.as_ref().map_or(self.a.len(), Vec::len);
        assert_eq!(self.a.len(), growths, "each match has a growth, or none");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three() -> MatchedPoints {
        let at = |x: f64| Point2::new(x, 2.0 * x);
        let mut points = MatchedPoints::default();
        for i in 0..3 {
            points.push(at(f64::from(i)), at(f64::from(i + 5)), i as f32 / 4.0);
        }
        points
    }

    #[test]
    fn a_mask_keeps_the_lists_together() {
        let three = || {
            (three().with_turns(Some(vec![0.1, 0.2, 0.3]))).with_growths(Some(vec![1.0, 0.0, -1.0]))
        };
        let kept = three().masked(&[true, false, true]);
        assert_eq!(kept.turns, Some(vec![0.1, 0.3]));
        assert_eq!(kept.growths, Some(vec![1.0, -1.0]));
        assert_eq!(kept.len(), 2);
        assert_eq!((kept.a[1], kept.b[1]), (three().a[2], three().b[2]));
        assert_eq!(kept.ambiguity, [0.0, 0.5]);
        assert!(three().masked(&[false; 3]).is_empty());
        assert_eq!(three().chosen(&[0, 2]), kept);
        assert_eq!(three().chosen(&[2, 0]).turns, Some(vec![0.3, 0.1]));
    }

    #[test]
    fn a_match_without_turn_and_growth_leaves_all_without() {
        let mut points = three().with_turns(Some(vec![0.1, 0.2, 0.3]));
        points.growths = Some(vec![0.0; 3]);
        points.push(Point2::new(1.0, 1.0), Point2::new(2.0, 2.0), 0.5);
        assert_eq!(
            (points.len(), points.turns, points.growths),
            (4, None, None)
        );
    }

    #[test]
    #[should_panic(expected = "a turn")]
    fn as_many_turns_as_matches_are_needed() {
        let _ = three().with_turns(Some(vec![0.1]));
    }

    #[test]
    #[should_panic(expected = "a growth")]
    fn as_many_growths_as_matches_are_needed() {
        let _ = three().with_growths(Some(vec![0.1; 4]));
    }

    #[test]
    #[should_panic(expected = "an ambiguity")]
    fn lists_of_different_lengths_are_refused() {
        let MatchedPoints { a, b, .. } = three();
        let _ = MatchedPoints::new(a, b, vec![0.0; 2]);
    }
}
