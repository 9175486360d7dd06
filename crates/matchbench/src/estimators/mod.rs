//! All estimators that a run can name, of poses and of homographies: one file each, and the list of them.

mod adaptive;
mod best;
mod best_h;
mod lmeds_e;
mod lmeds_f;
mod lo_ransac_e;
mod magsac_e;
mod mlesac_e;
mod prosac_e;
mod ransac_e;
mod ransac_e_inliers;
mod ransac_f;
mod ransac_h;
mod rich;
mod usac_f;

use matchbench_vision::ParamError;
use matchbench_vision::robust::{
    HomographyConsensus, HomographyEstimator, HomographyParams, PoseEstimator, SampleConsensus,
    SampleConsensusParams, Settings,
};
use serde::Serialize;
use serde_json::Value;

use crate::config::{self, ConfigError, Parameter, UnknownName, parameters, parse_params, to_json};

/// The entry of an estimator: its name, what it is, and how to build it.
pub trait EstimatorEntry: Sync {
    /// The name in commands, records and tables; lower case, words joined by `-`.
    fn id(&self) -> &'static str;

    /// What it is, in one sentence.
    fn summary(&self) -> &'static str;

    /// The paper that it implements.
    fn reference(&self) -> &'static str;

    /// Every parameter and its default, as a JSON object.
    fn defaults(&self) -> Value;

    /// Every parameter and what it means, by name.
    fn parameters(&self) -> Vec<Parameter>;

    /// The estimator with the given parameters, a JSON object; the others keep their defaults.
    ///
    /// # Errors
    /// If a parameter is unknown, would do nothing, or is of another type or out of range.
    fn build(&self, params: Option<&Value>) -> Result<BuiltEstimator, ConfigError>;

    /// Converts the parameters `written` in the plan of an earlier version to the form that
    /// [`BuiltEstimator::params`] has now: parameters that had no effect are removed, and what that version could not
    /// do is off.
    fn modernized(&self, written: &Value) -> Value {
        written.clone()
    }
}

/// An estimator ready to be run, and everything that its results depend on.
#[derive(Debug)]
pub struct BuiltEstimator {
    /// Id of its entry.
    pub id: String,
    /// Every parameter, including those at their defaults.
    pub params: Value,
    /// The estimator.
    pub estimator: Estimator,
}

/// An estimator, by what it estimates.
#[derive(Debug)]
pub enum Estimator {
    /// The relative pose of two cameras.
    Pose(Box<dyn PoseEstimator>),
    /// The homography between two images.
    Homography(Box<dyn HomographyEstimator>),
}

/// All estimators, in the order of tables. To add one, write a file in this folder and add a line here.
pub const ESTIMATORS: &[&dyn EstimatorEntry] = &[
    &ransac_e::RansacE,
    &ransac_e_inliers::RANSAC_E_INLIERS,
    &lmeds_e::LMEDS_E,
    &ransac_f::RANSAC_F,
    &lmeds_f::LMEDS_F,
    &usac_f::USAC_F,
    &prosac_e::PROSAC_E,
    &mlesac_e::MLESAC_E,
    &lo_ransac_e::LO_RANSAC_E,
    &magsac_e::MAGSAC_E,
    &rich::RICH,
    &best::BEST,
    &adaptive::ADAPTIVE,
    &ransac_h::RANSAC_H,
    &best_h::BEST_H,
];

/// An entry for an estimator by sample consensus that has its own defaults.
struct Preset<P = SampleConsensusParams> {
    id: &'static str,
    summary: &'static str,
    reference: &'static str,
    defaults: fn() -> P,
}

/// Parameters of an estimator by sample consensus.
trait PresetParams: Serialize {
    /// These parameters, with the `changes`.
    fn changed(self, changes: Settings) -> Result<Self, ParamError>
    where
        Self: Sized;

    /// The estimator with these parameters.
    fn estimator(&self) -> Result<Estimator, ParamError>;

    /// Converts settings `written` by an earlier version for defaults like these: settings that had no effect
    /// are removed, and what that version could not do is off.
    fn of_earlier_version(&self, written: Settings) -> Settings {
        written
    }
}

impl PresetParams for SampleConsensusParams {
    fn changed(self, changes: Settings) -> Result<Self, ParamError> {
        self.with(changes)
    }

    fn estimator(&self) -> Result<Estimator, ParamError> {
        Ok(Estimator::Pose(Box::new(SampleConsensus::new(*self)?)))
    }

    fn of_earlier_version(&self, written: Settings) -> Settings {
        written.of_earlier_version(self)
    }
}

impl PresetParams for HomographyParams {
    fn changed(self, changes: Settings) -> Result<Self, ParamError> {
        self.with(changes)
    }

    fn estimator(&self) -> Result<Estimator, ParamError> {
        let estimator = HomographyConsensus::new(*self)?;
        Ok(Estimator::Homography(Box::new(estimator)))
    }
}

impl<P: PresetParams> EstimatorEntry for Preset<P> {
    fn id(&self) -> &'static str {
        self.id
    }

    fn summary(&self) -> &'static str {
        self.summary
    }

    fn reference(&self) -> &'static str {
        self.reference
    }

    fn defaults(&self) -> Value {
        to_json(&(self.defaults)())
    }

    fn parameters(&self) -> Vec<Parameter> {
        parameters::<Settings>(&EstimatorEntry::defaults(self))
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltEstimator, ConfigError> {
        let refused = |error| ConfigError::new(self.id, error);
        let changes: Settings = parse_params(self.id, params)?;
        let params = (self.defaults)().changed(changes).map_err(refused)?;
        Ok(BuiltEstimator {
            id: self.id.into(),
            estimator: params.estimator().map_err(refused)?,
            params: to_json(&params),
        })
    }

    fn modernized(&self, written: &Value) -> Value {
        let Ok(settings) = parse_params::<Settings>(self.id, Some(written)) else {
            return written.clone();
        };
        let base = (self.defaults)();
        let settings = base.of_earlier_version(settings);
        let params = base.changed(settings);
        params.map_or_else(|_| written.clone(), |params| to_json(&params))
    }
}

/// The estimator called `id`.
///
/// # Errors
/// If there is none. The error names the most similar one, and lists all.
pub fn find(id: &str) -> Result<&'static dyn EstimatorEntry, UnknownName> {
    config::find("estimator", ESTIMATORS, EstimatorEntry::id, id)
}

/// Whether the estimator called `id` is one of homographies, else of poses; `None` if there is none.
pub(crate) fn is_of_homographies(id: &str) -> Option<bool> {
    let built = find(id).ok()?.build(None).ok()?;
    Some(matches!(built.estimator, Estimator::Homography(_)))
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::{
        Camera, MatchedPoints, RelativePose, corner_error, transfer,
    };
    use matchbench_vision::robust::TwoViews;
    use matchbench_vision::seed::Seed;
    use nalgebra::{Matrix3, Point2, Point3, Rotation3, UnitVector3, Vector3};
    use serde_json::json;

    use super::*;

    #[test]
    fn ids_are_unique_and_well_formed() {
        for (index, entry) in ESTIMATORS.iter().enumerate() {
            let id = entry.id();
            let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
            assert!(!id.is_empty() && id.chars().all(plain), "{id}");
            assert!(
                ESTIMATORS[..index].iter().all(|other| other.id() != id),
                "{id} twice"
            );
            assert_eq!(find(id).map(EstimatorEntry::id).ok(), Some(id));
        }
        assert!(find("ransac").is_err());
    }

    #[test]
    fn every_file_of_the_folder_is_listed() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/estimators");
        let files = std::fs::read_dir(folder)
            .expect("the folder of this file")
            .count();
        assert_eq!(files - 1, ESTIMATORS.len());
    }

    #[test]
    fn defaults_are_what_is_built_without_parameters() {
        let points = matches();
        for entry in ESTIMATORS {
            let explicit = entry.build(Some(&entry.defaults())).unwrap();
            let implicit = entry.build(None).unwrap();
            assert_eq!(implicit.params, explicit.params, "{}", entry.id());
            assert_eq!(implicit.params, entry.defaults(), "{}", entry.id());
            assert_eq!(
                estimate(&implicit, &points, Seed(1)),
                estimate(&explicit, &points, Seed(1)),
                "{}",
                entry.id()
            );
        }
    }

    #[test]
    fn every_parameter_is_explained_and_every_choice_can_be_made() {
        for entry in ESTIMATORS {
            config::check_explained(entry.id(), &entry.parameters(), |params| {
                entry.build(Some(params)).map(|built| built.params)
            });
        }
    }

    #[test]
    fn a_preset_keeps_its_own_defaults_beside_what_is_given() {
        let built = rich::RICH
            .build(Some(&json!({"threshold_px": 2.5})))
            .unwrap();
        let mut expected = rich::RICH.defaults();
        expected["threshold_px"] = json!(2.5);
        assert_eq!(built.params, expected);
        for wrong in [
            json!({"threshold_px": -1.0}),
            json!({"score": "msca"}),
            json!([1]),
        ] {
            assert!(rich::RICH.build(Some(&wrong)).is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_estimator_finds_the_pose_among_wrong_matches() {
        let points = matches();
        let truth = RelativePose {
            rotation: Rotation3::from_euler_angles(0.0, 0.1, 0.02).into(),
            direction: UnitVector3::new_normalize(Vector3::new(1.0, 0.0, 0.1)),
        };
        for entry in ESTIMATORS {
            let Estimator::Pose(estimator) = entry.build(None).unwrap().estimator else {
                continue;
            };
            let found = estimator.estimate(views(&points), Seed(5)).unwrap();
            let degrees = found.b_from_a.error(&truth).max().to_degrees();
            // The scene is shallow, so that wrong matches may pass for right ones if the
            // calibration does not say otherwise.
            let limit = if entry.id().ends_with("-f") {
                15.0
            } else {
                0.01
            };
            assert!(degrees < limit, "{}: {degrees} degrees", entry.id());
            // The least median of exact matches is so small that it is sure of half of them only.
            assert!(found.inliers.len() >= 40, "{}", entry.id());
        }
    }

    #[test]
    fn every_estimator_finds_the_homography_among_wrong_matches() {
        let truth = Matrix3::new(1.1, 0.1, -20.0, -0.1, 0.9, 30.0, 1e-4, 2e-4, 1.0);
        let mut points = matches();
        for (i, (&a, b)) in points.a.iter().zip(&mut points.b).enumerate() {
            if i < 60 {
                *b = transfer(&truth, a);
            }
        }
        for entry in ESTIMATORS {
            let Estimator::Homography(estimator) = entry.build(None).unwrap().estimator else {
                continue;
            };
            let found = estimator.estimate(&points, Seed(5)).unwrap();
            let pixels = corner_error(&found.b_from_a, &truth, (640, 480));
            assert!(pixels < 1e-6, "{}: {pixels} pixels", entry.id());
            assert!(found.inliers.len() >= 60, "{}", entry.id());
        }
    }

    #[test]
    fn unknown_parameters_are_refused_by_name() {
        for entry in ESTIMATORS {
            let refused = entry.build(Some(&json!({"treshold": 1.0}))).err();
            let message = refused.expect("no estimator has it").to_string();
            assert!(
                message.contains("treshold") && message.contains(entry.id()),
                "{message}"
            );
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_on_every_thread() {
        let points = matches();
        for entry in ESTIMATORS {
            let built = entry.build(None).unwrap();
            let estimate = || estimate(&built, &points, Seed(5));
            let here = estimate();
            let there = std::thread::scope(|scope| scope.spawn(estimate).join());
            assert!(!here.starts_with("Err"), "{}", entry.id());
            assert_eq!(there.expect("it does not panic"), here, "{}", entry.id());
        }
    }

    #[test]
    fn nothing_in_is_no_pose_out() {
        for entry in ESTIMATORS {
            let built = entry.build(None).unwrap();
            let nothing = estimate(&built, &MatchedPoints::default(), Seed(1));
            assert!(
                nothing.starts_with("Err(TooFewMatches { found: 0"),
                "{nothing}"
            );
        }
    }

    const CAMERA: Camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);

    /// What the estimator says, every digit of it.
    fn estimate(built: &BuiltEstimator, points: &MatchedPoints, seed: Seed) -> String {
        match &built.estimator {
            Estimator::Pose(estimator) => format!("{:?}", estimator.estimate(views(points), seed)),
            Estimator::Homography(estimator) => format!("{:?}", estimator.estimate(points, seed)),
        }
    }

    fn views(points: &MatchedPoints) -> TwoViews<'_> {
        TwoViews {
            points,
            camera_a: &CAMERA,
            camera_b: &CAMERA,
        }
    }

    /// Sixty points of a scene seen twice, and twenty wrong matches.
    fn matches() -> MatchedPoints {
        let mut rng = Seed(1).rng();
        let rotation = Rotation3::from_euler_angles(0.0, 0.1, 0.02);
        let see = |p: Point3<f64>| CAMERA.project(Point2::new(p.x / p.z, p.y / p.z));
        let (a, b) = (0..80)
            .map(|i| {
                let mut at = || rng.uniform() - 0.5;
                let scene = Point3::new(4.0 * at(), 4.0 * at(), 5.0 + at());
                let wrong = Point2::new(320.0 + 400.0 * at(), 240.0 + 400.0 * at());
                let seen = see(rotation * scene + Vector3::new(1.0, 0.0, 0.1));
                (see(scene), if i < 60 { seen } else { wrong })
            })
            .unzip();
        MatchedPoints::new(a, b, vec![0.5; 80])
    }
}
