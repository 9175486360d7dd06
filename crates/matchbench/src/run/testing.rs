//! For tests: a dataset, a matcher and an estimator that are so small that their results can be foreseen.

use std::fs;
use std::num::NonZeroU32;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use matchbench_vision::features::{DescriptorKind, Descriptors, Features, FloatRows, Keypoint};
use matchbench_vision::geometry::{Camera, RelativePose};
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::matching::{Correspondence, Correspondences, Matcher, MatcherError, View};
use matchbench_vision::robust::{NoModel, PoseEstimate, PoseEstimator, TwoViews};
use matchbench_vision::seed::Seed;
use nalgebra::{Isometry3, Point2, Translation3, UnitQuaternion, UnitVector3, Vector3};
use serde_json::json;

use super::{Cancel, Contender, Dataset, Run, Silent};
use crate::cache::FeatureCache;
use crate::datasets::{Frame, Pair, Sequence, Turn};
use crate::estimators::{BuiltEstimator, Estimator};
use crate::matchers::{BuiltMatcher, Extraction};
use crate::records::{RunFolder, RunRecord, RunSettings, StageTimes};

/// Pixels in a row of a test image, whose file is just its pixels.
const WIDTH: usize = 8;

/// Decodes a test image.
pub(super) fn decode(file: &[u8]) -> Result<GrayImage, String> {
    if !file.len().is_multiple_of(WIDTH) {
        return Err("the last row is not complete".into());
    }
    let size = Size::new(WIDTH, file.len() / WIDTH);
    Ok(GrayImage::from_vec(size, file.to_vec()))
}

/// Features at these places of an image of this size.
pub(super) fn features(size: Size, places: &[(f32, f32)]) -> Features {
    let keypoint = |&(x, y): &(f32, f32)| Keypoint {
        at: Point2::new(x, y),
        size: 1.0,
        angle: None,
        response: 1.0,
        octave: 0,
    };
    let keypoints = places.iter().map(keypoint).collect();
    let rows = FloatRows::from_vec(1, vec![0.0; places.len()]);
    Features::new(size, keypoints, Descriptors::Float(rows))
}

/// A dataset of so many frames, the pairs (0, 1), (0, 2), (1, 2), (1, 3) ..., in a `folder`.
pub(super) fn dataset(folder: &Path, name: &str, frames: u32) -> Dataset {
    let images = folder.join(name);
    fs::create_dir_all(&images).unwrap();
    let frame = |index: u32| {
        let image = images.join(format!("{index:04}.raw"));
        let mut rng = Seed(index.into()).rng();
        let pixels: Vec<u8> = (0..64).map(|_| rng.below(256) as u8).collect();
        fs::write(&image, pixels).unwrap();
        Frame {
            image,
            name: None,
            turn: Turn::None,
            camera: Camera::pinhole(8.0, 8.0, 3.5, 3.5),
            world_from_camera: None,
            depth: None,
        }
    };
    let pair = |a, b| {
        let b_from_a = Isometry3::from_parts(
            Translation3::new(1.0, f64::from(b), 0.2),
            UnitQuaternion::from_euler_angles(0.0, 0.1 * f64::from(a), 0.0),
        );
        Pair::with_pose(a, b, b_from_a)
    };
    Dataset {
        path: images.clone(),
        matchers: None,
        whole: None,
        pair_frames: None,
        sequence: Sequence {
            name: name.into(),
            frames: (0..frames).map(frame).collect(),
            pairs: (1..frames)
                .flat_map(|b| [pair(b.saturating_sub(2), b), pair(b - 1, b)])
                .skip(1)
                .collect(),
        },
    }
}

/// All records of a run of these on a dataset of 12 frames called `street`, twice each pair, without
/// the times of stages; the folder holds the dataset and the run.
pub(super) fn records_of(folder: &Path, contenders: &[Contender]) -> Vec<RunRecord> {
    let run_folder = folder.join("run");
    let datasets = [dataset(folder, "street", 12)];
    let run = Run {
        settings: RunSettings {
            repetitions: NonZeroU32::new(2).unwrap(),
            ..RunSettings::default()
        },
        cache: FeatureCache::new(folder.join("cache")),
        decode,
        feature_memory: 20_000,
        ..Run::new(&datasets, contenders, &run_folder)
    };
    run.execute(&Silent, &Cancel::default()).unwrap();
    let mut records = RunFolder::open(&run_folder).unwrap().records().unwrap();
    for record in &mut records {
        record.times = StageTimes::default();
    }
    records
}

/// What a test matcher or estimator does instead of its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trouble {
    None,
    PanicInExtraction,
    ErrorInSearch,
    PanicInSelection,
    MatchOfNothing,
    PanicInEstimation,
    NotANumber,
}

/// Every pixel not darker than a threshold is a feature; the same grey matches.
#[derive(Clone)]
pub(super) struct Toy {
    pub(super) threshold: u8,
    pub(super) uses_pixels: bool,
    pub(super) uses_seed: bool,
    pub(super) trouble: Trouble,
    pub(super) extractions: Arc<AtomicUsize>,
    pub(super) selections: Arc<AtomicUsize>,
}

impl Default for Toy {
    fn default() -> Self {
        Self {
            threshold: 64,
            uses_pixels: false,
            uses_seed: true,
            trouble: Trouble::None,
            extractions: Arc::default(),
            selections: Arc::default(),
        }
    }
}

impl Toy {
    /// The matcher under the given id, with one estimator for each of the given ids.
    pub(super) fn contender(&self, id: &str, estimators: &[&str]) -> Contender {
        let params = json!({"threshold": self.threshold});
        let matcher = BuiltMatcher {
            id: id.into(),
            params: params.clone(),
            extraction: Extraction {
                extractor: "toy".into(),
                params,
                revision: 1,
            },
            detection: None,
            matcher: Box::new(self.clone()),
        };
        Contender::new(matcher, estimators.iter().map(|id| self.estimator(id)))
    }

    /// The estimator under the given id.
    pub(super) fn estimator(&self, id: &str) -> BuiltEstimator {
        BuiltEstimator {
            id: id.into(),
            params: json!({}),
            estimator: Estimator::Pose(Box::new(self.clone())),
        }
    }
}

impl Matcher for Toy {
    fn extract(&self, image: &GrayImage) -> Result<Features, MatcherError> {
        self.extractions.fetch_add(1, Ordering::Relaxed);
        assert_ne!(
            self.trouble,
            Trouble::PanicInExtraction,
            "as the test wants"
        );
        let mut keypoints = Vec::new();
        let mut rows = FloatRows::new(1);
        for (index, &grey) in image.data().iter().enumerate() {
            if grey >= self.threshold {
                rows.push(&[grey.into()]);
                keypoints.push(Keypoint {
                    at: Point2::new(
                        (index % image.width()) as f32,
                        (index / image.width()) as f32,
                    ),
                    size: 1.0,
                    angle: None,
                    response: grey.into(),
                    octave: 0,
                });
            }
        }
        Ok(Features::new(
            image.size(),
            keypoints,
            Descriptors::Float(rows),
        ))
    }

    fn descriptors(&self) -> Option<DescriptorKind> {
        Some(DescriptorKind::Float { dim: 1 })
    }

    fn search(&self, a: &Features, b: &Features) -> Result<Correspondences, MatcherError> {
        if self.trouble == Trouble::ErrorInSearch {
            return Err(MatcherError("as the test wants".into()));
        }
        let pairs = a.len().min(b.len()) as u32;
        Ok((0..pairs)
            .map(|index| Correspondence {
                a: index,
                b: index,
                distance: 0.0,
                second: 0.0,
            })
            .collect())
    }

    fn select(
        &self,
        a: View<'_>,
        b: View<'_>,
        mut putative: Correspondences,
        seed: Seed,
    ) -> Result<Correspondences, MatcherError> {
        self.selections.fetch_add(1, Ordering::Relaxed);
        assert_ne!(self.trouble, Trouble::PanicInSelection, "as the test wants");
        assert_eq!(
            (a.image.is_some(), b.image.is_some()),
            (self.uses_pixels, self.uses_pixels)
        );
        if self.trouble == Trouble::MatchOfNothing {
            putative[3].b = 1000;
        }
        let mut rng = if self.uses_seed { seed } else { Seed(0) }.rng();
        putative.retain(|_| rng.below(4) > 0);
        Ok(putative)
    }

    fn uses_pixels(&self) -> bool {
        self.uses_pixels
    }

    fn uses_seed(&self) -> bool {
        self.uses_seed
    }
}

impl PoseEstimator for Toy {
    fn estimate_until(
        &self,
        views: TwoViews<'_>,
        seed: Seed,
        _stop: &dyn Fn(usize) -> bool,
    ) -> Result<PoseEstimate, NoModel> {
        self.estimate(views, seed)
    }

    fn estimate(&self, views: TwoViews<'_>, seed: Seed) -> Result<PoseEstimate, NoModel> {
        assert_ne!(
            self.trouble,
            Trouble::PanicInEstimation,
            "as the test wants"
        );
        let mut rng = seed.rng();
        let mut draw = || rng.normal();
        let mut direction = Vector3::new(draw(), draw(), draw()).normalize();
        if self.trouble == Trouble::NotANumber {
            direction.x = f64::NAN;
        }
        Ok(PoseEstimate {
            b_from_a: RelativePose {
                rotation: UnitQuaternion::from_euler_angles(draw(), draw(), draw()),
                direction: UnitVector3::new_unchecked(direction),
            },
            inliers: vec![0, 1, 2],
            // A few pairs of each run have too little.
            support: rng.below(views.points.len() as u32) as usize,
            iterations: 10,
        })
    }
}
