//! The export of matches: the selected matches of a run, or those that agree with the estimated pose or homography.
//!
//! The matches that agree with an estimate are as many as its record says that the estimator counted, and those
//! nearest to it: with the least Sampson distances from a pose, or the least symmetric transfer distances from a
//! homography. An estimator counts the matches within some distance of its model, and the model is the estimate. So
//! these are its own inliers, also where only the estimator knew the distance, because it was estimated from the
//! matches of the pair. Distances from poses are between the points that the estimator saw: a protocol may have moved
//! them. Which matches they are is known less exactly in two cases: where the model was a fundamental matrix, which
//! a pose only approximates, and with `tangent_sampson`, which measures distances in the image.
//!
//! Formats that share keypoints among pairs (COLMAP's and hloc's) need a list of keypoints for each image.
//! It is made from the matched points: points at the same place are one keypoint, unless one pair matches
//! the place more than once. hloc stores the matches of a pair in the order of the first image's keypoints.
//! So keypoints are numbered such that the order of every pair is kept, wherever the orders of all pairs
//! allow it; those of feature matchers do.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap};
use std::path::{Component, Path, PathBuf};

use matchbench_vision::geometry::{
    Camera, MatchedPoints, PointPairs, RelativePose, essential_from_pose,
    squared_sampson_distances, squared_transfer_distances,
};
use matchbench_vision::image::Size;
use nalgebra::{Matrix3, Point2};

use super::ExchangeError;
use crate::datasets::{Frame, Sequence};
use crate::records::{DatasetPlan, FolderError, MatchesFile, RunFolder, RunRecord};

/// Matches of one matcher on one dataset, to be written.
#[derive(Debug)]
pub struct Export<'a> {
    /// The dataset.
    pub sequence: &'a Sequence,
    /// Size of each image.
    pub sizes: Vec<Size>,
    /// The pairs that have matches, in the order of the dataset.
    pub pairs: Vec<PairExport>,
}

/// Matches of a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct PairExport {
    /// Frames a and b.
    pub frames: (u32, u32),
    /// The matches, in pixels of the original images, the first pixel's centre at (0, 0); written
    /// with single precision, in which a run keeps them.
    pub points: MatchedPoints,
    /// How the images stand to each other, where that was estimated.
    pub two_view: Option<TwoView>,
}

/// How an estimator saw the matched points of two images with these cameras and sizes: points and cameras in the
/// pixels of its protocol.
pub type Seen<'a> =
    &'a dyn Fn([&Camera; 2], [Size; 2], &MatchedPoints) -> (MatchedPoints, [Camera; 2]);

/// What was estimated of two images.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoView {
    /// The estimate.
    pub b_from_a: Model,
    /// For each match whether it agrees with the estimate.
    pub inliers: Vec<bool>,
}

/// An estimate from matches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Model {
    /// A relative pose.
    Pose(RelativePose),
    /// A homography: it takes pixels of a, the first one's centre at (0, 0), to those of b.
    Homography(Matrix3<f64>),
}

/// Refuses a sequence that is not the `dataset` of the run any more: its matches would come to other images, and
/// inliers would be those of other cameras.
///
/// # Errors
/// If cameras, pairs, true poses or images are others, or if what the run has noted cannot be read.
pub fn check_dataset(
    run: &RunFolder,
    dataset: &DatasetPlan,
    sequence: &Sequence,
) -> Result<(), FolderError> {
    if dataset.fingerprint != sequence.fingerprint() {
        return Err(FolderError::OtherDataset {
            folder: run.path().into(),
            dataset: dataset.name.clone(),
        });
    }
    let image = |frame: u32| Some(&*sequence.frames.get(frame as usize)?.image);
    run.images_of(&dataset.name)?.verify(image)
}

impl<'a> Export<'a> {
    /// The `pairs` of a dataset.
    ///
    /// # Errors
    /// If the dataset turns an image, or the size of one cannot be read.
    pub fn new(sequence: &'a Sequence, pairs: Vec<PairExport>) -> Result<Self, ExchangeError> {
        if let Some(frame) = sequence.turned() {
            return Err(ExchangeError::new(
                &frame.image,
                "the dataset turns the image, and other tools read it as it is stored",
                "store the images turned and import them again",
            ));
        }
        let sizes = (sequence.frames.iter())
            .map(Frame::size)
            .collect::<Result<_, _>>()?;
        Ok(Self {
            sequence,
            sizes,
            pairs,
        })
    }

    /// The selected matches in `matches`, of the first repetition, with the poses or homographies in `records` that
    /// one estimator left, and the matches that it counted as inliers, judged by what it has `seen`.
    ///
    /// # Errors
    /// If the matches or the size of an image cannot be read.
    pub fn of_run(
        sequence: &'a Sequence,
        matches: &MatchesFile,
        records: &[RunRecord],
        seen: Seen<'_>,
    ) -> Result<Self, ExchangeError> {
        let mut export = Self::new(sequence, Vec::new())?;
        let models: BTreeMap<_, _> = (records.iter())
            .filter(|record| record.task.repetition == 0)
            .filter_map(|record| {
                let outcome = &record.outcome;
                let model = (outcome.pose().map(Model::Pose))
                    .or_else(|| outcome.homography().map(Model::Homography));
                let frames = (record.task.a, record.task.b);
                Some((frames, (model?, outcome.inliers()?)))
            })
            .collect();
        for pair in &sequence.pairs {
            let key = (pair.a, pair.b, 0);
            let selected = matches
                .read(key)
                .map_err(|error| ExchangeError::new("matches of the run", error, "run it again"))?;
            let Some(selected) = selected else {
                continue;
            };
            let frames = [pair.a, pair.b].map(|frame| frame as usize);
            let cameras = frames.map(|frame| &sequence.frames[frame].camera);
            let sizes = frames.map(|frame| export.sizes[frame]);
            let two_view = models.get(&(pair.a, pair.b)).map(|&(b_from_a, counted)| {
                let squared = match &b_from_a {
                    Model::Pose(pose) => {
                        to_epipolar_lines(pose, &seen(cameras, sizes, &selected.points))
                    }
                    Model::Homography(h) => to_homography(h, &selected.points),
                };
                let inliers = nearest(&squared, counted as usize);
                TwoView { b_from_a, inliers }
            });
            export.pairs.push(PairExport {
                frames: (pair.a, pair.b),
                points: selected.points,
                two_view,
            });
        }
        Ok(export)
    }

    /// The same with nothing but the matches that agree with the estimates; pairs without an estimate are left out.
    ///
    /// # Panics
    /// If a pair has not one entry of [`TwoView::inliers`] for each match.
    #[must_use]
    pub fn inliers_alone(mut self) -> Self {
        self.pairs.retain(|pair| pair.two_view.is_some());
        for pair in &mut self.pairs {
            if let Some(TwoView { inliers, .. }) = &mut pair.two_view {
                pair.points = pair.points.masked(inliers);
                inliers.retain(|&inlier| inlier);
            }
        }
        self
    }

    /// [`Self::image_names`], where a file tells images apart by what it has `written` for each.
    ///
    /// # Errors
    /// If the same is written for two images.
    pub(super) fn distinct_names(
        &self,
        written: impl Fn(&str) -> String,
    ) -> Result<Vec<String>, ExchangeError> {
        let names = self.image_names();
        let mut seen = HashMap::new();
        for (name, frame) in names.iter().zip(&self.sequence.frames) {
            if let Some(first) = seen.insert(written(name), &frame.image) {
                return Err(ExchangeError::new(
                    &frame.image,
                    format!("its name would be that of {} too", first.display()),
                    "leave one of the two frames out of the dataset, or export in another format",
                ));
            }
        }
        Ok(names)
    }

    /// Names of the images: their paths below the deepest folder that holds them all, with `/`.
    pub fn image_names(&self) -> Vec<String> {
        let images: Vec<&Path> = (self.sequence.frames.iter())
            .map(|frame| &*frame.image)
            .collect();
        let root = self.image_root();
        (images.iter())
            .map(|image| {
                let parts = image.strip_prefix(&root).unwrap_or(image).components();
                let parts = parts.filter_map(|part| match part {
                    Component::Normal(name) => Some(name.to_string_lossy()),
                    _ => None,
                });
                parts.collect::<Vec<_>>().join("/")
            })
            .collect()
    }

    /// The deepest folder that holds all images.
    pub fn image_root(&self) -> PathBuf {
        let mut folders = (self.sequence.frames.iter()).filter_map(|frame| frame.image.parent());
        let mut root = folders.next().unwrap_or(Path::new("")).to_path_buf();
        for folder in folders {
            while !folder.starts_with(&root) && root.pop() {}
        }
        root
    }
}

impl PairExport {
    /// Points of image a and of image b as they are written: x, y, x, y ...
    pub(super) fn coordinates(&self) -> [Vec<f32>; 2] {
        [&self.points.a, &self.points.b]
            .map(|points| (points.iter().flat_map(|p| [p.x as f32, p.y as f32])).collect())
    }

    /// Ambiguities of the matches as they are written, from 0 to 1: a match whose second candidate was nearer, as
    /// selectors choose that do not ask for the nearest, is as ambiguous as can be.
    pub(super) fn ambiguities(&self) -> impl Iterator<Item = f32> {
        let most = |&ambiguity: &f32| if ambiguity > 1.0 { 1.0 } else { ambiguity };
        self.points.ambiguity.iter().map(most)
    }

    /// Scores of the matches, higher is better: 1 - ambiguity. In double precision nothing is lost.
    pub fn scores(&self) -> impl Iterator<Item = f64> {
        (self.ambiguities()).map(|ambiguity| 1.0 - f64::from(ambiguity))
    }
}

/// Squared Sampson distances of matches from the epipolar geometry of a pose.
fn to_epipolar_lines(
    pose: &RelativePose,
    (points, [camera_a, camera_b]): &(MatchedPoints, [Camera; 2]),
) -> Vec<f64> {
    let pairs = points.at_depth_1(camera_a, camera_b);
    let mut squared = vec![0.0; pairs.len()];
    let essential = essential_from_pose(pose);
    squared_sampson_distances(&essential, &pairs, 0..pairs.len(), &mut squared);
    squared
}

/// Squared symmetric transfer distances of matches from a homography.
fn to_homography(homography: &Matrix3<f64>, points: &MatchedPoints) -> Vec<f64> {
    let pairs: PointPairs =
        std::iter::zip(points.a.iter().copied(), points.b.iter().copied()).collect();
    let mut squared = vec![0.0; pairs.len()];
    squared_transfer_distances(homography, &pairs, 0..pairs.len(), &mut squared);
    squared
}

/// Which matches have the `count` least distances.
fn nearest(squared: &[f64], count: usize) -> Vec<bool> {
    let mut order: Vec<usize> = (0..squared.len()).collect();
    // In the total order NaN is the largest, if it has no sign.
    order.sort_by(|&i, &j| squared[i].abs().total_cmp(&squared[j].abs()));
    let mut inliers = vec![false; squared.len()];
    for &i in order.iter().take(count) {
        inliers[i] = true;
    }
    inliers
}

/// Keypoints of each image, and matches as indices of them.
pub(super) struct Numbered {
    /// By frame.
    pub(super) keypoints: Vec<Vec<Point2<f32>>>,
    /// By pair of the export, in the order of its matches: keypoint of a, keypoint of b.
    pub(super) matches: Vec<Vec<[u32; 2]>>,
}

/// A place in an image and how many matches of the same pair were there before.
type Node = (u32, u32, u32);

/// Numbers the matched points of each image.
pub(super) fn numbered(export: &Export<'_>) -> Numbered {
    let frames = export.sequence.frames.len();
    let mut images: Vec<Image> = (0..frames).map(|_| Image::default()).collect();
    let mut matches = Vec::new();
    for pair in &export.pairs {
        let (a, b) = (pair.frames.0 as usize, pair.frames.1 as usize);
        let first = images[a].take(&pair.points.a);
        images[a].keep_order(&first);
        let second = images[b].take(&pair.points.b);
        matches.push((first, second));
    }
    let ranks: Vec<Vec<u32>> = images.iter().map(Image::ranks).collect();
    let keypoints = (images.iter().zip(&ranks))
        .map(|(image, ranks)| {
            let mut keypoints = vec![Point2::origin(); ranks.len()];
            for (point, &rank) in image.points.iter().zip(ranks) {
                keypoints[rank as usize] = *point;
            }
            keypoints
        })
        .collect();
    let matches = (export.pairs.iter().zip(matches))
        .map(|(pair, (first, second))| {
            let (a, b) = (
                &ranks[pair.frames.0 as usize],
                &ranks[pair.frames.1 as usize],
            );
            (first.iter().zip(second))
                .map(|(&i, j)| [a[i as usize], b[j as usize]])
                .collect()
        })
        .collect();
    Numbered { keypoints, matches }
}

/// The matched points of an image, in the order in which they are met.
#[derive(Default)]
struct Image {
    points: Vec<Point2<f32>>,
    known: HashMap<Node, u32>,
    /// For each point, those that are to come after it.
    later: Vec<Vec<u32>>,
}

impl Image {
    /// The indices of points of one pair; new points are added.
    fn take(&mut self, points: &[Point2<f64>]) -> Vec<u32> {
        let mut met = HashMap::<(u32, u32), u32>::new();
        (points.iter())
            .map(|point| {
                let point = point.cast::<f32>();
                let place = (point.x.to_bits(), point.y.to_bits());
                let before = met.entry(place).or_default();
                let node = (place.0, place.1, *before);
                *before += 1;
                *self.known.entry(node).or_insert_with(|| {
                    self.points.push(point);
                    self.later.push(Vec::new());
                    self.points.len() as u32 - 1
                })
            })
            .collect()
    }

    fn keep_order(&mut self, indices: &[u32]) {
        for next in indices.windows(2) {
            self.later[next[0] as usize].push(next[1]);
        }
    }

    /// For each point its number, such that orders are kept; the first met comes first where no
    /// order says otherwise. Points whose orders contradict each other come last.
    fn ranks(&self) -> Vec<u32> {
        let mut before = vec![0_u32; self.points.len()];
        for &point in self.later.iter().flatten() {
            before[point as usize] += 1;
        }
        let mut ready: BinaryHeap<Reverse<u32>> = (0..self.points.len() as u32)
            .filter(|&point| before[point as usize] == 0)
            .map(Reverse)
            .collect();
        let mut ranks = vec![u32::MAX; self.points.len()];
        let mut next = 0;
        while let Some(Reverse(point)) = ready.pop() {
            ranks[point as usize] = next;
            next += 1;
            for &later in &self.later[point as usize] {
                let before = &mut before[later as usize];
                *before -= 1;
                if *before == 0 {
                    ready.push(Reverse(later));
                }
            }
        }
        for rank in ranks.iter_mut().filter(|rank| **rank == u32::MAX) {
            *rank = next;
            next += 1;
        }
        ranks
    }
}

#[cfg(test)]
mod tests {
    use matchbench_vision::robust::{PoseEstimator, SampleConsensus, TwoViews, presets};
    use matchbench_vision::seed::Seed;
    use nalgebra::{Point3, UnitQuaternion, UnitVector3, Vector3};

    use super::*;

    const CAMERA: Camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);

    /// Points of a scene that two cameras see with so much `noise` in pixels, and wrong matches.
    fn noisy(right: usize, wrong: usize, noise: f64) -> MatchedPoints {
        let mut rng = Seed(7).rng();
        let mut points = MatchedPoints::default();
        for i in 0..right + wrong {
            let mut at = || rng.uniform() - 0.5;
            let scene = Point3::new(4.0 * at(), 4.0 * at(), 5.0 + 3.0 * at());
            let anywhere = Point2::new(320.0 + 400.0 * at(), 240.0 + 400.0 * at());
            let mut see = |p: Point3<f64>| {
                let off = Vector3::new(rng.normal(), rng.normal(), 0.0).xy() * noise;
                CAMERA.project(Point2::new(p.x / p.z, p.y / p.z)) + off
            };
            let (a, b) = (see(scene), see(scene + Vector3::new(1.0, 0.0, 0.1)));
            points.push(a, if i < right { b } else { anywhere }, 0.5);
        }
        points
    }

    #[test]
    fn inliers_are_those_of_the_estimator_whether_or_not_it_has_a_threshold() {
        let own = [
            ("best", presets::best()),
            ("adaptive", presets::adaptive()),
            ("lmeds-e", presets::lmeds_e()),
        ];
        let mut counts = Vec::new();
        for noise in [0.2, 3.0] {
            let points = noisy(150, 60, noise);
            for (id, params) in own {
                let estimator = SampleConsensus::new(params).expect("a preset");
                let views = TwoViews {
                    points: &points,
                    camera_a: &CAMERA,
                    camera_b: &CAMERA,
                };
                let found = estimator.estimate(views, Seed(1)).expect("most are right");
                let seen = (points.clone(), [CAMERA; 2]);
                let nearest = nearest(
                    &to_epipolar_lines(&found.b_from_a, &seen),
                    found.inliers.len(),
                );
                let nearest: Vec<u32> = (0..).zip(nearest).filter(|x| x.1).map(|x| x.0).collect();
                assert_eq!(nearest, found.inliers, "{id}, noise {noise}");
                counts.push(nearest.len());
            }
        }
        // Where there is more noise, a fixed threshold loses what the others keep.
        assert!(counts[3] < counts[4].min(counts[5]), "{counts:?}");
    }

    #[test]
    fn a_distance_that_is_no_number_is_the_largest() {
        let mut points = noisy(20, 0, 0.0);
        points.a[3].x = -f64::NAN;
        let pose = RelativePose {
            rotation: UnitQuaternion::identity(),
            direction: UnitVector3::new_normalize(Vector3::new(1.0, 0.0, 0.1)),
        };
        let seen = (points, [CAMERA; 2]);
        let squared = to_epipolar_lines(&pose, &seen);
        let inliers = nearest(&squared, 19);
        assert!((0..20).all(|i| inliers[i] == (i != 3)), "{inliers:?}");
        assert_eq!(nearest(&squared, 99), [true; 20]);
    }

    fn points(xs: &[f64]) -> Vec<Point2<f64>> {
        xs.iter().map(|&x| Point2::new(x, 0.0)).collect()
    }

    /// Numbers of the points of each pair.
    fn ranks(pairs: &[&[f64]]) -> Vec<Vec<u32>> {
        let mut image = Image::default();
        let indices: Vec<_> = pairs.iter().map(|xs| image.take(&points(xs))).collect();
        for indices in &indices {
            image.keep_order(indices);
        }
        let ranks = image.ranks();
        let ranked = |indices: &Vec<u32>| indices.iter().map(|&i| ranks[i as usize]).collect();
        indices.iter().map(ranked).collect()
    }

    #[test]
    fn keypoints_keep_the_order_of_every_pair() {
        let numbers = ranks(&[&[3.0, 7.0, 9.0], &[5.0, 7.0], &[1.0, 3.0, 5.0]]);
        for pair in &numbers {
            assert!(pair.is_sorted(), "{numbers:?}");
        }
        assert_eq!(numbers[0][1], numbers[1][1], "one place is one keypoint");
    }

    #[test]
    fn a_place_that_a_pair_matches_twice_is_two_keypoints() {
        let numbers = ranks(&[&[4.0, 4.0], &[4.0]]);
        assert_eq!(numbers, [vec![0, 1], vec![0]]);
    }

    #[test]
    fn contradicting_orders_still_give_every_point_a_number() {
        let mut numbers = ranks(&[&[1.0, 2.0, 3.0], &[2.0, 1.0]])[0].clone();
        numbers.sort_unstable();
        assert_eq!(numbers, [0, 1, 2]);
    }
}
