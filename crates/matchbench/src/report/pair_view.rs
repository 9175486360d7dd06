//! The view of a pair: both images, the selected matches coloured by their true error, epipolar lines. (What
//! differs for homographies is in `pair_homography`.)
//!
//! The colour of a match shows its distance to the *true* epipolar geometry. How it is drawn also shows whether
//! it agrees with the *estimated* one, since wrong matches that agree with the estimate are what misleads an
//! estimator. Both distances are Sampson's, in pixels.

use std::sync::Arc;

use image::DynamicImage;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::FilterType;
use matchbench_vision::geometry::{
    Camera, PointPairs, RelativePose, essential_from_pose, squared_sampson_distances,
};
use matchbench_vision::image::GrayImage;
use nalgebra::{Isometry3, Matrix3, Point2, Vector3};

use crate::metrics::Model;
use crate::records::Outcome;

/// A match agrees with an estimate if it is nearer than this to the epipolar geometry of the pose, or to the place
/// where the homography takes it, in pixels: the thresholds of `ransac-e` and `ransac-h`. An estimator may count others
/// as its inliers.
pub(crate) fn agrees_below(model: Model) -> f64 {
    match model {
        Model::Pose => 1.0,
        Model::Homography => 3.0,
    }
}

/// Bounds of the classes of matches by Sampson distance from the true epipolar geometry, in pixels. Distances at or above the
/// last bound are a fourth class.
pub(super) const BOUNDS_PX: [f64; 3] = [1.0, 3.0, 10.0];
/// Matches whose epipolar lines are drawn.
const LINES: usize = 6;
/// Points of an epipolar line that is bent by a lens.
const BENT: usize = 24;

/// An image, made small enough to be embedded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thumbnail {
    /// Size of the original image (columns and rows), whose pixels are the unit of the coordinates of matches.
    pub original: (usize, usize),
    /// The small image, as a JPEG file.
    pub jpeg: Vec<u8>,
}

impl Thumbnail {
    /// The image with at most `longest` pixels a side. It is in colour if it has three `planes`: red, green and
    /// blue.
    ///
    /// # Panics
    /// If there are neither one nor three planes, or if their sizes differ.
    pub fn new(planes: &[GrayImage], longest: u32, quality: u8) -> Self {
        let size = planes[0].size();
        let (width, height) = (size.width, size.height);
        let data: Vec<&[u8]> = planes.iter().map(GrayImage::data).collect();
        let pixels = match data[..] {
            [gray] => image::GrayImage::from_raw(width as u32, height as u32, gray.to_vec())
                .map(DynamicImage::from),
            [r, g, b] => {
                let pixels = (0..size.area()).flat_map(|i| [r[i], g[i], b[i]]);
                image::RgbImage::from_raw(width as u32, height as u32, pixels.collect())
                    .map(DynamicImage::from)
            }
            _ => None,
        };
        let pixels = pixels.expect("one plane or three, of as many pixels as the size says");
        let scale = (f64::from(longest) / width.max(height).max(1) as f64).min(1.0);
        let side = |side: usize| ((side as f64 * scale).round() as u32).max(1);
        let small = if scale < 1.0 {
            pixels.resize_exact(side(width), side(height), FilterType::Triangle)
        } else {
            pixels
        };
        let mut jpeg = Vec::new();
        // An image without pixels has no file; it is drawn as an empty box.
        let _ = small.write_with_encoder(JpegEncoder::new_with_quality(&mut jpeg, quality));
        Self {
            original: (width, height),
            jpeg,
        }
    }
}

/// The two cameras, their true relative pose, and the estimated one.
#[derive(Clone, Copy, Debug)]
pub struct PairPoses<'a> {
    /// Camera of image a.
    pub camera_a: &'a Camera,
    /// Camera of image b.
    pub camera_b: &'a Camera,
    /// The true pose; `None` without a baseline, since then there are no epipolar lines.
    pub truth: Option<RelativePose>,
    /// The estimated pose, if there is one.
    pub estimate: Option<RelativePose>,
}

impl<'a> PairPoses<'a> {
    /// The poses of a pair: the true one, and the one in the record of the result.
    pub fn new(
        camera_a: &'a Camera,
        camera_b: &'a Camera,
        truth: &Isometry3<f64>,
        outcome: &Outcome,
    ) -> Self {
        Self {
            camera_a,
            camera_b,
            truth: RelativePose::from_isometry(truth),
            estimate: outcome.pose(),
        }
    }
}

/// One match, in pixels of the original images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchView {
    /// In image a.
    pub a: Point2<f64>,
    /// In image b.
    pub b: Point2<f64>,
    /// Distance to the true epipolar geometry, or to the place where the true homography maps the point, in
    /// pixels; `None` if neither is known.
    pub distance: Option<f64>,
    /// Whether it agrees with the estimate.
    pub agrees: bool,
}

/// The epipolar lines of a match in image b, each as points in pixels. For homographies, the frame of image a.
#[derive(Clone, Debug, PartialEq)]
pub struct EpipolarLines {
    /// The match: its point in image a.
    pub a: Point2<f64>,
    /// And in image b.
    pub b: Point2<f64>,
    /// By the true pose.
    pub truth: Vec<Point2<f64>>,
    /// By the estimated pose; empty if there is none.
    pub estimate: Vec<Point2<f64>>,
}

/// Points of an image, in pixels.
pub type Points = Vec<Point2<f64>>;

/// At most `most` of the items, evenly spread over the list.
pub fn evenly<T: Clone>(items: &[T], most: usize) -> Vec<T> {
    let count = most.min(items.len());
    (0..count)
        .map(|i| items[i * items.len() / count].clone())
        .collect()
}

/// How many of all selected matches are near the truth, and how many agree with the estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// All of them.
    pub matches: usize,
    /// Numbers by distance: below 1, below 3 and below 10 pixels, and farther; `None` if there is no true
    /// distance.
    pub by_distance: Option<[usize; 4]>,
    /// Those that agree with the estimate.
    pub agree: usize,
}

impl Tally {
    /// Counts the matches.
    pub fn of(matches: &[MatchView]) -> Self {
        let distances: Option<Vec<f64>> = matches.iter().map(|m| m.distance).collect();
        Self {
            matches: matches.len(),
            by_distance: distances.map(|distances| {
                let mut counts = [0; 4];
                for distance in distances {
                    counts[class_of(distance)] += 1;
                }
                counts
            }),
            agree: matches.iter().filter(|m| m.agrees).count(),
        }
    }
}

/// Number of the class of a distance. NaN belongs to the last class.
pub(super) fn class_of(distance: f64) -> usize {
    (BOUNDS_PX.iter())
        .position(|bound| distance < *bound)
        .unwrap_or(BOUNDS_PX.len())
}

/// A pair, with the matches of one matcher.
#[derive(Clone, Debug, PartialEq)]
pub struct PairView {
    /// Name of the dataset.
    pub dataset: String,
    /// Id of the matcher.
    pub matcher: String,
    /// Id of the estimator.
    pub estimator: String,
    /// Frames a and b.
    pub frames: (u32, u32),
    /// Both images; pairs share them.
    pub images: [Arc<Thumbnail>; 2],
    /// The selected matches, or some of them, evenly spread over the list.
    pub matches: Vec<MatchView>,
    /// Counts over all selected matches.
    pub tally: Tally,
    /// The kind of model by which the matches are judged.
    pub model: Model,
    /// Epipolar lines of a few of them, or the frame of image a in image b.
    pub lines: Vec<EpipolarLines>,
    /// The estimated homography, if there is one; it maps pixels of image a to image b.
    pub homography: Option<Matrix3<f64>>,
    /// All keypoints of both images, if they were asked for.
    pub keypoints: [Points; 2],
}

impl PairView {
    /// Whether any keypoint is drawn.
    pub(super) fn has_keypoints(&self) -> bool {
        !self.keypoints.iter().all(Vec::is_empty)
    }
}

/// The matches `a[i]`, `b[i]` with their distances from the poses.
pub fn match_views(poses: &PairPoses<'_>, a: &[Point2<f64>], b: &[Point2<f64>]) -> Vec<MatchView> {
    let truth = poses.truth.map(|pose| distances(poses, &pose, a, b));
    let estimate = poses.estimate.map(|pose| distances(poses, &pose, a, b));
    (a.iter().zip(b).enumerate())
        .map(|(i, (a, b))| MatchView {
            a: *a,
            b: *b,
            distance: truth.as_ref().map(|distances| distances[i]),
            agrees: estimate
                .as_ref()
                .is_some_and(|distances| distances[i] < agrees_below(Model::Pose)),
        })
        .collect()
}

/// Sampson distances of matches from a pose, in pixels.
fn distances(
    poses: &PairPoses<'_>,
    pose: &RelativePose,
    a: &[Point2<f64>],
    b: &[Point2<f64>],
) -> Vec<f64> {
    let pairs: PointPairs = (a.iter().zip(b))
        .map(|(a, b)| {
            let normal = |camera: &Camera, at: &Point2<f64>| camera.normalize(*at);
            (normal(poses.camera_a, a), normal(poses.camera_b, b))
        })
        .collect();
    let mut squared = vec![0.0; pairs.len()];
    let everything = 0..pairs.len();
    squared_sampson_distances(&essential_from_pose(pose), &pairs, everything, &mut squared);
    let focal = f64::midpoint(poses.camera_a.mean_focal(), poses.camera_b.mean_focal());
    squared
        .into_iter()
        .map(|squared| squared.sqrt() * focal)
        .collect()
}

/// Epipolar lines of a few matches, evenly spread over those that agree with the estimate (or over all, if none
/// does).
pub fn epipolar_lines(
    poses: &PairPoses<'_>,
    matches: &[MatchView],
    size_b: (usize, usize),
) -> Vec<EpipolarLines> {
    let Some(truth) = poses.truth else {
        return Vec::new();
    };
    let agreeing: Vec<usize> = (0..matches.len()).filter(|&i| matches[i].agrees).collect();
    let candidates = if agreeing.is_empty() {
        (0..matches.len()).collect()
    } else {
        agreeing
    };
    let count = LINES.min(candidates.len());
    let line =
        |pose: &RelativePose, at| epipolar_line(&essential_from_pose(pose), poses, at, size_b);
    (0..count)
        .map(|i| {
            let MatchView { a, b, .. } = matches[candidates[i * candidates.len() / count]];
            EpipolarLines {
                a,
                b,
                truth: line(&truth, a),
                estimate: (poses.estimate.as_ref()).map_or_else(Vec::new, |pose| line(pose, a)),
            }
        })
        .collect()
}

/// The epipolar line in image b of the point `at` in image a, across the whole width of the image. It may leave
/// the image above and below.
fn epipolar_line(
    essential: &Matrix3<f64>,
    poses: &PairPoses<'_>,
    at: Point2<f64>,
    (width, height): (usize, usize),
) -> Vec<Point2<f64>> {
    let (a, b) = (poses.camera_a, poses.camera_b);
    let line: Vector3<f64> = essential * a.normalize(at).to_homogeneous();
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
        .map(|(x, y)| b.normalize(Point2::new(x * width as f64, y * height as f64)));
    // Along x where the line is flat, along y where it is steep.
    let flat = line.y.abs() >= line.x.abs();
    let along = |p: &Point2<f64>| if flat { p.x } else { p.y };
    let from = corners.iter().map(along).fold(f64::INFINITY, f64::min);
    let to = corners.iter().map(along).fold(f64::NEG_INFINITY, f64::max);
    let count = if b.distortion.is_some() { BENT } else { 2 };
    let points = (0..count).map(|i| {
        let s = from + (to - from) * i as f64 / (count - 1) as f64;
        if flat {
            Point2::new(s, -(line.x * s + line.z) / line.y)
        } else {
            Point2::new(-(line.y * s + line.z) / line.x, s)
        }
    });
    points
        .filter_map(|at_depth_1| b.seen_at(at_depth_1))
        .filter(|p| p.x.is_finite() && p.y.is_finite())
        .collect()
}

#[cfg(test)]
mod tests {
    use matchbench_vision::image::Size;
    use nalgebra::{UnitQuaternion, UnitVector3};

    use super::*;

    const CAMERA: Camera = Camera::pinhole(100.0, 100.0, 50.0, 40.0);

    /// Cameras side by side: epipolar lines are rows.
    fn side_by_side() -> PairPoses<'static> {
        let pose = RelativePose {
            rotation: UnitQuaternion::identity(),
            direction: UnitVector3::new_normalize(Vector3::new(-1.0, 0.0, 0.0)),
        };
        PairPoses {
            camera_a: &CAMERA,
            camera_b: &CAMERA,
            truth: Some(pose),
            estimate: Some(pose),
        }
    }

    #[test]
    fn distance_is_in_pixels_and_decides_about_agreement() {
        let a = [Point2::new(50.0, 40.0), Point2::new(50.0, 40.0)];
        let b = [Point2::new(30.0, 40.0), Point2::new(30.0, 44.0)];
        let matches = match_views(&side_by_side(), &a, &b);
        assert!(matches[0].agrees && !matches[1].agrees);
        let tally = Tally::of(&matches);
        assert_eq!((tally.matches, tally.agree), (2, 1));
        assert_eq!(tally.by_distance, Some([1, 1, 0, 0]));
        // Both points share the correction: 4 px over the square root of two.
        let distance = matches[1].distance.expect("there is a baseline");
        assert!((distance - 4.0 / 2.0_f64.sqrt()).abs() < 1e-9, "{distance}");
        let blind = PairPoses {
            truth: None,
            estimate: None,
            ..side_by_side()
        };
        let matches = match_views(&blind, &a, &b);
        assert!(matches[0].distance.is_none() && !matches[0].agrees);
        assert_eq!(Tally::of(&matches).by_distance, None);
        assert!(epipolar_lines(&blind, &matches, (100, 80)).is_empty());
    }

    #[test]
    fn lines_cross_the_image_through_the_match() {
        let a = [Point2::new(70.0, 25.0)];
        let matches = match_views(&side_by_side(), &a, &[Point2::new(10.0, 25.0)]);
        let lines = epipolar_lines(&side_by_side(), &matches, (100, 80));
        let [from, to] = lines[0].truth[..] else {
            panic!("{lines:?}")
        };
        assert!((from - Point2::new(0.0, 25.0)).norm() < 1e-9, "{from}");
        assert!((to - Point2::new(100.0, 25.0)).norm() < 1e-9, "{to}");
        assert_eq!(lines[0].truth, lines[0].estimate);
    }

    #[test]
    fn thumbnails_are_small_and_remember_their_size() {
        let image = GrayImage::from_vec(Size::new(40, 20), (0..800).map(|i| i as u8).collect());
        let small = Thumbnail::new(&[image], 10, 60);
        assert_eq!(small.original, (40, 20));
        let file = image::load_from_memory(&small.jpeg).expect("a JPEG file");
        assert_eq!((file.width(), file.height()), (10, 5));
    }
}
