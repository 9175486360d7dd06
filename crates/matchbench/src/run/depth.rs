//! What depth says of a pair: how much both images show, which matches are right, and which keypoints could be found again.
//!
//! A pixel of one image whose depth is known is a point of the scene, and the true pose says where the other camera
//! has it.
//!
//! - *Overlap*: the share of the pixels of an image that the other image sees. A pixel is seen if it lies
//!   on the other image, and if the depth there equals that of the point within [`CONSISTENT`], so that
//!   nothing stands before it. Pixels without depth, and those whose place in the other image has none, do
//!   not count. Of the two directions the smaller value is the overlap of the pair. (Sarlin, DeTone,
//!   Malisiewicz, Rabinovich, "SuperGlue: Learning Feature Matching with Graph Neural Networks", CVPR 2020,
//!   take the mean of both.)
//! - *Matches*: the distance of one end from where the depth of the other takes it, in pixels: from a to b, or from b
//!   to a where a has no depth.
//! - *Keypoints* that could be found again: those that the other image sees, as above. (Mikolajczyk, Schmid, "A
//!   Performance Evaluation of Local Descriptors", PAMI 27(10), 2005; DeTone, Malisiewicz, Rabinovich, "SuperPoint",
//!   CVPRW 2018: matching score.)

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use blake3::Hash;
use matchbench_vision::features::Features;
use matchbench_vision::geometry::{Camera, MatchedPoints};
use nalgebra::{Isometry3, Point2, Point3};

use super::guard::Broken;
use super::repeatability::{found_again, is_inside, places};
use super::trial::counts_within;
use crate::datasets::{Depth, Pair, Sequence};
use crate::records::{ByDepth, Repeated};

/// How much the depths of a point in two views may differ, as a share of one.
const CONSISTENT: f64 = 0.05;
/// Pixels of an image that its overlap is measured at: so many columns and rows.
const SAMPLES: (u32, u32) = (80, 60);
/// Bytes of depth that are kept in memory, of each matcher at work.
const KEPT: usize = 64 << 20;

/// The depth of frames, as far as there is room for it.
#[derive(Debug, Default)]
pub(super) struct DepthMaps(Mutex<VecDeque<(u32, Arc<Depth>)>>);

impl DepthMaps {
    /// What depth says of a pair; `None` where one of its images has none, or its pose is not known.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub(super) fn of_pair<'a>(
        &self,
        sequence: &'a Sequence,
        pair: &Pair,
    ) -> Result<Option<PairDepth<'a>>, Broken> {
        let Some(b_from_a) = pair.pose() else {
            return Ok(None);
        };
        let (Some(a), Some(b)) = (self.of(sequence, pair.a)?, self.of(sequence, pair.b)?) else {
            return Ok(None);
        };
        let camera = |frame: u32| &sequence.frames[frame as usize].camera;
        let cameras = [camera(pair.a), camera(pair.b)];
        Ok(Some(PairDepth::new([a, b], cameras, b_from_a)))
    }

    fn of(&self, sequence: &Sequence, frame: u32) -> Result<Option<Arc<Depth>>, Broken> {
        // Nothing is left half done by a thread that panics.
        let kept = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, depth)) = kept().iter().find(|(other, _)| *other == frame) {
            return Ok(Some(Arc::clone(depth)));
        }
        let read = sequence.frames[frame as usize].read_depth();
        let Some(depth) = read.map_err(|error| Broken::for_now(error.to_string()))? else {
            return Ok(None);
        };
        let depth = Arc::new(depth);
        let mut kept = kept();
        kept.push_back((frame, Arc::clone(&depth)));
        while kept.iter().map(|(_, depth)| depth.bytes()).sum::<usize>() > KEPT {
            kept.pop_front();
        }
        Ok(Some(depth))
    }
}

/// The depth of both images of a pair, and the true pose.
#[derive(Debug)]
pub(super) struct PairDepth<'a> {
    /// From a to b, and from b to a.
    views: [View<'a>; 2],
    overlap: Option<f64>,
}

/// One image as seen from the other.
#[derive(Debug)]
struct View<'a> {
    depths: [Arc<Depth>; 2],
    cameras: [&'a Camera; 2],
    other_from_this: Isometry3<f64>,
}

impl<'a> PairDepth<'a> {
    fn new(
        [a, b]: [Arc<Depth>; 2],
        [of_a, of_b]: [&'a Camera; 2],
        b_from_a: &Isometry3<f64>,
    ) -> Self {
        let views = [
            View {
                depths: [Arc::clone(&a), Arc::clone(&b)],
                cameras: [of_a, of_b],
                other_from_this: *b_from_a,
            },
            View {
                depths: [b, a],
                cameras: [of_b, of_a],
                other_from_this: b_from_a.inverse(),
            },
        ];
        let [there, back] = views.each_ref().map(View::share_seen);
        let overlap = there.zip(back).map(|(there, back)| there.min(back));
        Self { views, overlap }
    }

    /// Hashes of the two files of depth.
    pub(super) fn hashes(&self) -> [Hash; 2] {
        self.views[0].depths.each_ref().map(|depth| depth.hash())
    }

    /// What it says of the selected matches.
    pub(super) fn judge(&self, points: &MatchedPoints) -> ByDepth {
        let errors = (points.a.iter().zip(&points.b)).filter_map(|(&a, &b)| {
            let [there, back] = &self.views;
            there.error(a, b).or_else(|| back.error(b, a))
        });
        let (judged, within) = counts_within(errors);
        ByDepth {
            overlap: self.overlap,
            judged,
            within,
            repeated: None,
        }
    }

    /// Which keypoints of a are found again among those of b.
    pub(super) fn repeated(&self, a: &Features, b: &Features) -> Repeated {
        let [there, back] = &self.views;
        let in_b: Vec<Point2<f64>> = (places(a).into_iter())
            .filter_map(|place| there.sight(place).place())
            .filter(|place| is_inside(place, b.size))
            .collect();
        let of_b: Vec<Point2<f64>> = (places(b).into_iter())
            .filter(|place| {
                back.sight(*place)
                    .place()
                    .is_some_and(|place| is_inside(&place, a.size))
            })
            .collect();
        found_again(&in_b, &of_b, b.size)
    }
}

/// What the depth of two images says of a pixel of one.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sight {
    /// The other image shows the same here.
    At(Point2<f64>),
    /// It does not: the point is beside it, behind the camera or behind something else.
    Hidden,
    /// One depth is not known.
    Unknown,
}

impl Sight {
    fn place(self) -> Option<Point2<f64>> {
        match self {
            Self::At(place) => Some(place),
            Self::Hidden | Self::Unknown => None,
        }
    }
}

impl View<'_> {
    /// The point that a pixel shows, in the frame of the other camera; `None` where its depth is not known.
    fn point(&self, pixel: Point2<f64>) -> Option<Point3<f64>> {
        let depth = self.depths[0].at(pixel)?;
        let ray = self.cameras[0].normalize(pixel).to_homogeneous();
        Some(self.other_from_this * Point3::from(ray * depth))
    }

    /// Where the other camera has that point; `None` behind it, and beside all that its lens can show.
    fn project(&self, point: &Point3<f64>) -> Option<Point2<f64>> {
        let ahead = (point.z > 0.0).then(|| Point2::new(point.x / point.z, point.y / point.z));
        self.cameras[1].seen_at(ahead?)
    }

    /// How far `other` is from where the other camera has what `pixel` shows; infinite where it has it nowhere, `None` where the
    /// depth is not known.
    fn error(&self, pixel: Point2<f64>, other: Point2<f64>) -> Option<f64> {
        let point = self.point(pixel)?;
        Some(
            self.project(&point)
                .map_or(f64::INFINITY, |place| (place - other).norm()),
        )
    }

    /// Whether and where the other image shows what `pixel` does.
    fn sight(&self, pixel: Point2<f64>) -> Sight {
        let Some(point) = self.point(pixel) else {
            return Sight::Unknown;
        };
        let Some(place) = self.project(&point) else {
            return Sight::Hidden;
        };
        let [width, height] = self.depths[1].image_size().map(|length| length - 0.5);
        // NaN is nowhere.
        let on_image = place.x >= -0.5 && place.y >= -0.5 && place.x < width && place.y < height;
        if !on_image {
            return Sight::Hidden;
        }
        match self.depths[1].at(place) {
            None => Sight::Unknown,
            Some(there) if (point.z - there).abs() <= CONSISTENT * there => Sight::At(place),
            Some(_) => Sight::Hidden,
        }
    }

    /// The share of the pixels that the other image shows too; `None` where nothing is known of any.
    fn share_seen(&self) -> Option<f64> {
        let [width, height] = self.depths[0].image_size();
        let (columns, rows) = SAMPLES;
        let (mut known, mut seen) = (0_u32, 0_u32);
        for sample in 0..columns * rows {
            let at = |index: u32, count: u32, length: f64| {
                (f64::from(index) + 0.5) / f64::from(count) * length - 0.5
            };
            let pixel = Point2::new(
                at(sample % columns, columns, width),
                at(sample / columns, rows, height),
            );
            let sight = self.sight(pixel);
            known += u32::from(sight != Sight::Unknown);
            seen += u32::from(sight.place().is_some());
        }
        (known > 0).then(|| f64::from(seen) / f64::from(known))
    }
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::Distortion;
    use matchbench_vision::image::{Image, Size};

    use super::super::testing::features;
    use super::*;
    use crate::datasets::DepthUnit;

    const CAMERA: Camera = Camera::pinhole(50.0, 50.0, 49.5, 29.5);

    /// A wall 2 m away; in the columns `near` something stands 1 m away.
    fn depth(near: std::ops::Range<usize>) -> Arc<Depth> {
        let size = Size::new(100, 60);
        let stored = Image::from_fn(size, |x, _| if near.contains(&x) { 1000 } else { 2000 });
        Arc::new(Depth::of_image(stored, DepthUnit::MILLIMETRES))
    }

    /// The second camera stands 0.4 m to the right of the first: the wall moves by 10 pixels.
    fn pair(a: Arc<Depth>, b: Arc<Depth>) -> PairDepth<'static> {
        PairDepth::new(
            [a, b],
            [&CAMERA; 2],
            &Isometry3::translation(-0.4, 0.0, 0.0),
        )
    }

    #[test]
    fn overlap_is_what_lies_on_the_other_image_and_is_not_hidden() {
        let plain = pair(depth(0..0), depth(0..0));
        assert!((plain.overlap.unwrap() - 0.9).abs() < 0.02, "{plain:?}");
        // 20 columns of b hide the wall that a sees.
        let hidden = pair(depth(0..0), depth(40..60));
        assert!((hidden.overlap.unwrap() - 0.7).abs() < 0.03, "{hidden:?}");
        let nothing = Image::from_vec(Size::new(100, 60), vec![0; 6000]);
        let nothing = Arc::new(Depth::of_image(nothing, DepthUnit::MILLIMETRES));
        assert_eq!(pair(depth(0..0), nothing).overlap, None);
    }

    #[test]
    fn matches_are_judged_by_the_end_that_of_frame() {
        let half = Image::from_fn(Size::new(100, 60), |x, _| if x < 50 { 2000 } else { 0 });
        let half = Arc::new(Depth::of_image(half, DepthUnit::MILLIMETRES));
        let known = pair(Arc::clone(&half), half);
        let mut points = MatchedPoints::default();
        for (ax, bx) in [
            (30.0, 20.0), // exact
            (30.0, 22.5), // off by 2.5
            (58.0, 48.0), // by the depth of b
            (90.0, 80.0), // without depth
        ] {
            points.push(Point2::new(ax, 7.0), Point2::new(bx, 7.0), 0.5);
        }
        let judged = known.judge(&points);
        assert_eq!(
            (judged.judged, judged.within[0], judged.within[2]),
            (3, 2, 3)
        );
        assert_eq!(known.judge(&MatchedPoints::default()).judged, 0);
    }

    #[test]
    fn what_lies_behind_the_other_camera_is_wrong_and_not_seen() {
        let ahead = Isometry3::translation(0.0, 0.0, -3.0);
        let behind = PairDepth::new([depth(0..0), depth(0..0)], [&CAMERA; 2], &ahead);
        assert_eq!(behind.overlap, Some(0.0));
        let mut points = MatchedPoints::default();
        points.push(Point2::new(49.5, 29.5), Point2::new(49.5, 29.5), 0.5);
        let judged = behind.judge(&points);
        assert_eq!((judged.judged, judged.within), (1, [0; 10]));
    }

    /// What a camera has at 3 baselines to the side and 1 ahead, a lens with k1 = -0.1 would show at 0.3: in the image, at a
    /// depth that is that of the wall.
    #[test]
    fn what_a_lens_folds_back_into_the_image_is_wrong_and_not_seen() {
        let lens = Distortion {
            k1: -0.1,
            ..Distortion::default()
        };
        let bent = Camera {
            distortion: Some(lens.into()),
            ..CAMERA
        };
        let beside = Isometry3::translation(6.0, 0.0, 0.0);
        let folded = PairDepth::new([depth(0..0), depth(0..0)], [&CAMERA, &bent], &beside);
        assert_eq!(folded.overlap, Some(0.0));
        assert_eq!(folded.views[0].share_seen(), Some(0.0));
        let mut points = MatchedPoints::default();
        points.push(Point2::new(49.5, 29.5), Point2::new(64.5, 29.5), 0.5);
        let judged = folded.judge(&points);
        assert_eq!((judged.judged, judged.within), (1, [0; 10]));
    }

    /// The camera in the same place with twice the focal length shows the middle half of the columns and rows.
    #[test]
    fn the_overlap_is_that_of_the_image_that_shows_more_alone() {
        let near = Camera::pinhole(100.0, 100.0, 49.5, 29.5);
        for cameras in [[&CAMERA, &near], [&near, &CAMERA]] {
            let depths = [depth(0..0), depth(0..0)];
            let pair = PairDepth::new(depths, cameras, &Isometry3::identity());
            assert_eq!(pair.overlap, Some(0.25));
        }
    }

    #[test]
    fn keypoints_are_found_again_where_the_other_image_shows_them() {
        // Image b is narrower, and something stands before its columns 50 to 59.
        let (size_a, size_b) = (Size::new(100, 60), Size::new(80, 60));
        let stored = Image::from_fn(
            size_b,
            |x, _| {
                if (50..60).contains(&x) { 1000 } else { 2000 }
            },
        );
        let narrow = Arc::new(Depth::of_image(stored, DepthUnit::MILLIMETRES));
        let both = pair(depth(0..0), narrow);
        // The wall is 10 pixels further to the left in b.
        let a = features(
            size_a,
            &[
                (30.0, 7.0),
                (80.0, 40.0),
                (85.0, 50.0),
                (5.0, 7.0),   // left of b
                (60.0, 20.0), // hidden in b
                (9.8, 30.0),  // on the first pixel of b, left of its centre
                (89.3, 30.0), // on the last, right of its centre
            ],
        );
        let b = features(
            size_b,
            &[
                (20.9, 7.0),  // 0.9 from the first
                (71.9, 40.0), // 1.9 from the second
                (75.0, 57.9), // 7.9 from the third, right of b if it were seen in b
                (10.0, 50.0), // far from all
                (55.0, 20.0), // what stands before the wall, which a does not show
            ],
        );
        let expected = Repeated {
            visible: [3, 4],
            within: [1, 2, 2, 2, 2, 2, 2, 3, 3, 3],
        };
        assert_eq!(both.repeated(&a, &b), expected);
    }
}
