//! Matches features that a child has described: nearest neighbours, then the ratio test and the mutual
//! check as the manifest says.

use matchbench_vision::features::Features;
use matchbench_vision::matching::{
    MutualCheck, NearestNeighbours, RatioTest, Search, Selector, View,
};
use matchbench_vision::seed::Seed;

use super::manifest::Matching;

impl Matching {
    /// The matches of two images as x_a, y_a, x_b, y_b and ambiguity, and how many there were before
    /// the ratio test and the mutual check. Descriptors of different kinds have none.
    pub fn matches(&self, a: &Features, b: &Features) -> (Vec<[f32; 5]>, usize) {
        if a.descriptors.kind() != b.descriptors.kind() {
            return (Vec::new(), 0);
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
        let rows = matches.iter().map(|m| {
            let [a, b] = [a.keypoints[m.a as usize].at, b.keypoints[m.b as usize].at];
            [a.x, a.y, b.x, b.y, m.ambiguity()]
        });
        (rows.collect(), putative)
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
            let (rows, putative) = matching.matches(&a, &b);
            assert_eq!(putative, 3);
            rows.iter().map(|row| row[0]).collect::<Vec<_>>()
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
        assert_eq!(Matching::default().matches(&a, &two), (Vec::new(), 0));
    }
}
