//! Matches features that a child has described: nearest neighbours, then the ratio test and the mutual
//! check as the manifest says.

use matchbench_vision::features::Features;
use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::matching::{
    MutualCheck, NearestNeighbours, RatioTest, Search, Selector, View,
};
use matchbench_vision::seed::Seed;

use super::manifest::Matching;

impl Matching {
    /// The matches of two images, with turns and growths where angles and scales are known, and how many there were
    /// before the ratio test and the mutual check. Descriptors of different kinds have none.
    pub fn matches(&self, a: &Features, b: &Features) -> (MatchedPoints, usize) {
        if a.descriptors.kind() != b.descriptors.kind() {
            return (MatchedPoints::default(), 0);
        }
        let view = |features| View {
            features,
            image: None,
            camera: None,
        };
        let ratio = self.ratio.map(|ratio| RatioTest { ratio });
        let first = ratio.as_ref().map(|ratio| ratio as &dyn Selector);
        let mut matches = NearestNeighbours.search_for(a, b, first);
        let putative = matches.len();
        // Neither draws random numbers.
        let mut prune = |selector: &dyn Selector| {
            selector.select(view(a), view(b), &mut matches, Seed(0));
        };
        if let Some(ratio) = &ratio {
            prune(ratio);
        }
        if self.is_mutual() {
            prune(&MutualCheck);
        }
        let points = MatchedPoints::of_matches(&matches, a, b);
        (points.expect("they are of these features"), putative)
    }
}

#[cfg(test)]
mod tests {
    use matchbench_vision::features::{Descriptors, FloatRows, Keypoint};
    use matchbench_vision::image::Size;
    use nalgebra::Point2;

    use super::*;

    /// Features with one value each, at (index, value).
    fn features(values: &[f32]) -> Features {
        let keypoint = |(index, &value): (usize, &f32)| Keypoint {
            at: Point2::new(index as f32, value),
            size: 1.0,
            angle: None,
            response: 0.0,
            octave: 0,
        };
        let rows = FloatRows::from_vec(1, values.to_vec());
        let keypoints = values.iter().enumerate().map(keypoint).collect();
        Features::new(Size::new(9, 99), keypoints, Descriptors::Float(rows))
    }

    #[test]
    fn matches_are_pruned_as_the_manifest_says() {
        let (a, b) = (features(&[1.0, 3.0, 8.0]), features(&[2.5, 9.0, 10.0]));
        let first = |matching: Matching| {
            let (points, putative) = matching.matches(&a, &b);
            assert_eq!(putative, 3);
            points.a.iter().map(|at| at.x).collect::<Vec<_>>()
        };
        let ratio = Some(0.4);
        // 1 and 3 both choose 2.5, which chooses 3; 8 is at 1 from 9 and at 2 from 10.
        assert_eq!(first(Matching::default()), [1.0, 2.0]);
        let lone = |mutual, ratio| Matching {
            ratio,
            mutual,
            hamming: false,
        };
        assert_eq!(first(lone(Some(false), None)), [0.0, 1.0, 2.0]);
        assert_eq!(first(lone(None, ratio)), [0.0, 1.0]);
        assert_eq!(first(lone(Some(true), ratio)), [1.0]);
        let two = Features::new(
            Size::new(9, 9),
            Vec::new(),
            Descriptors::Float(FloatRows::new(2)),
        );
        assert_eq!(
            Matching::default().matches(&a, &two),
            (MatchedPoints::default(), 0)
        );
    }

    #[test]
    fn angles_and_scales_become_turns_and_growths() {
        let (mut a, mut b) = (features(&[1.0, 8.0]), features(&[1.0, 8.0]));
        let points = |a: &Features, b: &Features| Matching::default().matches(a, b).0;
        let unknown = points(&a, &b);
        assert_eq!((unknown.turns, unknown.growths), (None, None));
        for (features, angle, size) in [(&mut a, 0.5, 2.0), (&mut b, 1.5, 4.0)] {
            for keypoint in &mut features.keypoints {
                (keypoint.angle, keypoint.size) = (Some(angle), size);
            }
        }
        let known = points(&a, &b);
        assert_eq!(known.turns, Some(vec![1.0; 2]));
        let growth = known.growths.expect("sizes differ")[0];
        assert!((growth - 2.0_f32.ln()).abs() < 1e-6, "{growth}");
    }
}
