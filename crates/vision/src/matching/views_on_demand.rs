//! Views on demand: features of simulated views are compared only where the features of the images themselves
//! do not match well.
//!
//! D. Mishkin, J. Matas, M. Perdoch: "MODS: Fast and Robust Method for Two-View Matching", Computer Vision and Image
//! Understanding 141, 2015: detectors and views from the cheapest to the dearest, until enough matches are verified. Here, of
//! two images described by [`ImageAndViews`](crate::features::ImageAndViews):
//!
//! 1. The features of the images as they are are compared, and [`Adalam`] selects.
//! 2. Where it keeps at least `enough` matches, these are the matches: they are located more precisely than those of
//!    views, and no view can add a wrong one.
//! 3. Elsewhere all features are compared, those of views included, and AdaLAM selects of these, by parameters of its own.
//!
//! A pair that needs no views takes the time of the images alone. Where many views agree on something that is not there
//! (repeated structure looks the same from the side) they outvote the image, so this is not only faster.
//!
//! *Differs from MODS*: two steps and not four; what verifies is AdaLAM, not an epipolar geometry; matches of
//! the first step are found again in the second, not kept from it.

use super::{
    Adalam, Correspondences, NearestNeighbours, PlacewiseNeighbours, Search, Selector, View,
};
use crate::features::{Features, features_of_image};
use crate::seed::Seed;

/// Search and selection for features of [`ImageAndViews`](crate::features::ImageAndViews). Features of views
/// are used only if they are needed.
#[derive(Clone, Copy, Debug)]
pub struct ViewsOnDemand {
    /// If the images themselves give at least this many matches, views are not compared. `None`: views are
    /// always compared.
    pub enough: Option<u32>,
    /// Compares all features.
    pub search: PlacewiseNeighbours,
    /// Selects matches if `enough` is set and all matches are of features of the images themselves.
    pub of_images: Adalam,
    /// Selects all other matches.
    pub of_views: Adalam,
}

impl ViewsOnDemand {
    /// Keeps what the selection by the features of the images themselves keeps.
    fn select_of_images(&self, images: [&Features; 2], matches: &mut Correspondences, seed: Seed) {
        let [a, b] = images.map(|features| View {
            features,
            image: None,
            camera: None,
        });
        self.of_images.select(a, b, matches, seed);
    }
}

impl Search for ViewsOnDemand {
    fn search(&self, a: &Features, b: &Features) -> Correspondences {
        if let Some(enough) = self.enough {
            let [image_a, image_b] = [a, b].map(features_of_image);
            let putative = NearestNeighbours.search(&image_a, &image_b);
            let mut kept = putative.clone();
            // AdaLAM draws nothing at random.
            self.select_of_images([&image_a, &image_b], &mut kept, Seed(0));
            if kept.len() >= enough as usize {
                return putative;
            }
        }
        self.search.search(a, b)
    }
}

impl Selector for ViewsOnDemand {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, seed: Seed) {
        let [image_a, image_b] = [a, b].map(|view| features_of_image(view.features));
        let of_images = (matches.iter())
            .all(|found| (found.a as usize) < image_a.len() && (found.b as usize) < image_b.len());
        if self.enough.is_some() && of_images {
            self.select_of_images([&image_a, &image_b], matches, seed);
        } else {
            self.of_views.select(a, b, matches, seed);
        }
    }

    fn uses_seed(&self) -> bool {
        self.of_images.uses_seed() || self.of_views.uses_seed()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::features::{Descriptors, FloatRows, Keypoint};
    use crate::image::Size;
    use crate::matching::AdalamParams;

    const SIZE: Size = Size::new(400, 300);
    /// Features of the image itself, and of views.
    const OF_IMAGE: usize = 200;
    const OF_VIEWS: usize = 100;

    /// Features in random places that match those of `b_from_a(place)` where `matches` says so.
    fn pair(matches: impl Fn(usize) -> bool) -> [Features; 2] {
        let mut rng = Seed(8).rng();
        let (mut keypoints, mut rows) = ([vec![], vec![]], [vec![], vec![]]);
        for i in 0..OF_IMAGE + OF_VIEWS {
            let at = Point2::new(380.0 * rng.uniform() as f32, 280.0 * rng.uniform() as f32);
            let row: Vec<f32> = (0..16).map(|_| rng.normal() as f32).collect();
            let other: Vec<f32> = (0..16).map(|_| rng.normal() as f32).collect();
            for (side, shift) in [0.0, 12.0].into_iter().enumerate() {
                keypoints[side].push(Keypoint {
                    at: Point2::new(at.x + shift, at.y + shift / 2.0),
                    size: 4.0,
                    angle: Some(0.5),
                    response: 1.0,
                    octave: 0,
                });
                let agree = side == 0 || matches(i);
                rows[side].extend_from_slice(if agree { &row } else { &other });
            }
        }
        let frame = |i: usize| {
            if i < OF_IMAGE {
                [4.0, 0.0, 0.0, 4.0]
            } else {
                [2.0, 0.0, 0.0, 8.0]
            }
        };
        let mut sides = keypoints.into_iter().zip(rows);
        std::array::from_fn(|_| {
            let (keypoints, rows) = sides.next().expect("two sides");
            let descriptors = Descriptors::Float(FloatRows::from_vec(16, rows));
            Features::new(SIZE, keypoints, descriptors)
                .with_frames((0..OF_IMAGE + OF_VIEWS).map(frame).collect())
        })
    }

    fn on_demand(enough: Option<u32>) -> ViewsOnDemand {
        let adalam = Adalam::new(AdalamParams::default()).expect("its own parameters");
        ViewsOnDemand {
            enough,
            search: PlacewiseNeighbours::default(),
            of_images: adalam,
            of_views: adalam,
        }
    }

    /// The matches of a pair, and how many of them are of views.
    fn matched([a, b]: &[Features; 2], enough: Option<u32>) -> (Correspondences, usize) {
        matched_by(&on_demand(enough), [a, b])
    }

    fn matched_by(stage: &ViewsOnDemand, [a, b]: [&Features; 2]) -> (Correspondences, usize) {
        let mut matches = stage.search(a, b);
        let [a, b] = [a, b].map(|features| View {
            features,
            image: None,
            camera: None,
        });
        stage.select(a, b, &mut matches, Seed(1));
        let of_views = (matches.iter())
            .filter(|found| found.a as usize >= OF_IMAGE)
            .count();
        (matches, of_views)
    }

    #[test]
    fn images_that_match_do_without_views() {
        let pair = pair(|_| true);
        let (matches, of_views) = matched(&pair, Some(150));
        assert!(matches.len() >= 150 && of_views == 0, "{}", matches.len());
        let images = [&pair[0], &pair[1]].map(features_of_image);
        assert_eq!(matched(&images, Some(150)).0, matches);
    }

    #[test]
    fn images_that_do_not_match_are_helped_by_views() {
        let pair = pair(|i| i >= OF_IMAGE || i % 4 == 0);
        let (matches, of_views) = matched(&pair, Some(150));
        assert!(of_views > OF_VIEWS / 2, "{of_views}");
        assert_eq!(matched(&pair, None).0, matches);
    }

    #[test]
    fn features_without_views_are_selected_as_those_of_images() {
        let nothing = AdalamParams {
            min_inliers: 10_000,
            ..AdalamParams::default()
        };
        let stage = ViewsOnDemand {
            of_views: Adalam::new(nothing).expect("in range"),
            ..on_demand(Some(150))
        };
        let images = pair(|i| i % 4 == 0).each_ref().map(features_of_image);
        let (matches, _) = matched_by(&stage, images.each_ref());
        assert!(!matches.is_empty());
    }

    /// The same features without the first ones.
    fn without_first(features: &Features, count: usize) -> Features {
        let Descriptors::Float(rows) = &features.descriptors else {
            panic!("they are real numbers");
        };
        let rows: Vec<f32> = (count..features.len())
            .flat_map(|i| rows.row(i).to_vec())
            .collect();
        let descriptors = Descriptors::Float(FloatRows::from_vec(16, rows));
        Features::new(SIZE, features.keypoints[count..].to_vec(), descriptors)
            .with_frames((count..features.len()).map(|i| features.frame(i)).collect())
    }

    #[test]
    fn images_may_have_unlike_numbers_of_features() {
        const FEWER: u32 = 20;
        for enough in [Some(150), None] {
            let [a, b] = pair(|_| true);
            let fewer = without_first(&b, FEWER as usize);
            let (matches, _) = matched(&[a.clone(), fewer.clone()], enough);
            assert!(matches.len() >= 150 && matches.iter().all(|found| found.a == found.b + FEWER));
            let (matches, _) = matched(&[fewer, a], enough);
            assert!(matches.len() >= 150 && matches.iter().all(|found| found.b == found.a + FEWER));
        }
    }

    #[test]
    fn nothing_matches_nothing() {
        let none = Features::new(SIZE, vec![], Descriptors::Float(FloatRows::new(16)));
        let some = pair(|_| true);
        for [a, b] in [[&none, &some[0]], [&some[0], &none], [&none, &none]] {
            assert!(matched(&[a.clone(), b.clone()], Some(1)).0.is_empty());
        }
    }
}
