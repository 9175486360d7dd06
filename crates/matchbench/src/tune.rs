//! Finds the best value of one parameter of an estimator, on scenes that are not reported.
//!
//! Each value becomes a variant of the estimator. All variants run as estimators of one run: on the same
//! matches and with the same random draws. The run shows its progress and can be resumed. The chosen value is
//! the one with the highest AUC, averaged over datasets and matchers with equal weight. If several values are
//! equal, the first is chosen.

use std::path::Path;

use serde_json::{Map, Value};

use crate::cache::FeatureCache;
use crate::config::{Changes, ConfigError};
use crate::estimators;
use crate::matchers::BuiltPointSource;
use crate::metrics::{ResultsError, load_run, ranking_auc};
use crate::protocols::MATCHBENCH;
use crate::records::images::ImageNotes;
use crate::records::{DatasetPlan, FolderError, RunFolder, RunSettings, Tuned, TunedOn};
use crate::run::{
    Cancel, Contender, ContenderError, Dataset, Observer, Outside, Run, RunError, RunSummary,
    Variant, built_in,
};

/// What is tuned, and on what.
#[derive(Clone, Copy, Debug)]
pub struct Tuning<'a> {
    /// The datasets. None of them may be reported on later.
    pub datasets: &'a [Dataset],
    /// The matchers whose matches are used: ids, manifests of matchers from outside, or `all`.
    pub matchers: &'a [String],
    /// The parameter, `ESTIMATOR.NAME`.
    pub parameter: &'a str,
    /// The values to try, at least two.
    pub values: &'a [Value],
    /// Changes of other parameters.
    pub changes: &'a Changes,
    /// Seed, repetitions and limit of the run.
    pub settings: RunSettings,
    /// The folder of the run. The choice is written to `tuned.json` in it.
    pub folder: &'a Path,
    /// The cache of features that were extracted before.
    pub cache: &'a FeatureCache,
}

/// The result of a tuning.
#[derive(Clone, Debug, PartialEq)]
pub struct TuningDone {
    /// The progress of the run.
    pub summary: RunSummary,
    /// The choice; `None` if the run was stopped before its end.
    pub tuned: Option<Tuned>,
}

/// Why a parameter could not be tuned.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TuneError {
    /// The parameter or its values.
    #[error("{0}")]
    Parameter(String),
    /// A matcher or a setting.
    #[error(transparent)]
    Contender(#[from] ContenderError),
    /// The run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The scores of the run.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// The folder of the run.
    #[error(transparent)]
    Folder(#[from] FolderError),
}

/// Runs every value that is not run yet, and writes which is best. The matches are those of the matchers and of further
/// `sources`, such as files.
///
/// # Errors
/// If the parameter, a value or a matcher is unknown, if the run cannot start or continue, or if `cancel` is set before a
/// program is ready.
pub fn tune(
    tuning: &Tuning<'_>,
    sources: Vec<BuiltPointSource>,
    observer: &dyn Observer,
    cancel: &Cancel,
) -> Result<TuningDone, TuneError> {
    let contenders = variants(tuning, sources, cancel)?;
    let run = Run {
        settings: tuning.settings,
        cache: tuning.cache.clone(),
        ..Run::new(tuning.datasets, &contenders, tuning.folder)
    };
    let summary = run.execute(observer, cancel)?;
    let mut done = TuningDone {
        summary,
        tuned: None,
    };
    if summary.is_complete() {
        let folder = RunFolder::open(tuning.folder)?;
        let tuned = choose(tuning, &folder, &contenders[0].estimators)?;
        tuned.write(&folder.tuned_file())?;
        done.tuned = Some(tuned);
    }
    Ok(done)
}

/// The matchers and sources, each with one variant of the estimator for each value.
fn variants(
    tuning: &Tuning<'_>,
    sources: Vec<BuiltPointSource>,
    cancel: &Cancel,
) -> Result<Vec<Contender>, TuneError> {
    let parameter = tuning.parameter;
    let (id, name) = parameter.split_once('.').ok_or_else(|| {
        TuneError::Parameter(format!(
            "{parameter}: expected ESTIMATOR.PARAMETER, for example ransac-e.threshold_px"
        ))
    })?;
    if estimators::find(id).is_err() && built_in().matchers.contains(&id) {
        let reason =
            format!("{parameter}: only parameters of estimators are tuned, and {id} is a matcher");
        return Err(TuneError::Parameter(reason));
    }
    if tuning.values.len() < 2 {
        let reason = format!("{parameter}: at least two values are needed");
        return Err(TuneError::Parameter(reason));
    }
    let is_equal = |one: &Value, other: &Value| {
        one == other
            || one
                .as_f64()
                .zip(other.as_f64())
                .is_some_and(|(x, y)| x == y)
    };
    for (index, value) in tuning.values.iter().enumerate() {
        if tuning.values[..index]
            .iter()
            .any(|other| is_equal(value, other))
        {
            let reason =
                format!("{parameter}: the value {value} is there twice; give each value once");
            return Err(TuneError::Parameter(reason));
        }
    }
    let (id, changes) = ([id.to_owned()], tuning.changes);
    let outside = Outside {
        logs: &RunFolder::logs_at(tuning.folder),
        cache: tuning.cache,
        cancel,
    };
    let (matchers, outside) = (tuning.matchers, Some(&outside));
    let (mut contenders, absent) =
        Contender::from_names(matchers, sources, &id, &[], changes, outside)?;
    // If one of them were missing, the mean would be over fewer matchers.
    if let Some(error) = absent.into_iter().next() {
        return Err(ContenderError::from(error).into());
    }
    let [id] = id;
    let mut params = match changes.of(&id) {
        Some(Value::Object(params)) => params.clone(),
        _ => Map::new(),
    };
    if params.contains_key(name) {
        let reason =
            format!("{parameter} is set, and its values are to be tried; leave one of the two out");
        return Err(TuneError::Parameter(reason));
    }
    for contender in &mut contenders {
        contender.estimators = (tuning.values.iter())
            .map(|value| {
                params.insert(name.into(), value.clone());
                let params = Value::Object(params.clone());
                let estimator = (estimators::find(&id).map_err(ContenderError::from))?
                    .build(Some(&params))
                    .map_err(|error: ConfigError| ContenderError::from(error))?;
                Ok::<_, TuneError>(Variant {
                    name: format!("{id}@{}", text(value)),
                    estimator,
                    protocol: &MATCHBENCH,
                })
            })
            .collect::<Result<_, _>>()?;
    }
    Ok(contenders)
}

fn text(value: &Value) -> String {
    let text = value.as_str();
    text.map_or_else(|| value.to_string(), str::to_owned)
}

fn choose(
    tuning: &Tuning<'_>,
    folder: &RunFolder,
    variants: &[Variant],
) -> Result<Tuned, TuneError> {
    let sets = load_run(folder, None)?;
    let mean_auc = |variant: &Variant| {
        let aucs: Vec<f64> = (sets.iter())
            .filter(|set| set.estimator == variant.name && !set.pairs.is_empty())
            .map(|set| ranking_auc(&set.pairs))
            .collect();
        (!aucs.is_empty()).then(|| aucs.iter().sum::<f64>() / aucs.len() as f64)
    };
    let auc: Vec<(Value, f64)> = (tuning.values.iter().zip(variants))
        .map(|(value, variant)| Some((value.clone(), mean_auc(variant)?)))
        .collect::<Option<_>>()
        .ok_or_else(|| TuneError::Parameter("the datasets have no pairs to tune on".into()))?;
    let (best, _) = (auc.iter().rev())
        .max_by(|(_, x), (_, y)| x.total_cmp(y))
        .expect("there are values");
    let plan = folder.plan();
    let on = |dataset: &DatasetPlan| {
        let images = ImageNotes::open(folder.path(), &dataset.name)?;
        let hashes = images
            .known()
            .values()
            .map(|hash| hash.to_hex().to_string());
        Ok::<_, FolderError>(TunedOn {
            name: dataset.name.clone(),
            fingerprint: dataset.fingerprint.clone(),
            images: hashes.collect(),
        })
    };
    Ok(Tuned {
        setting: format!("{}={best}", tuning.parameter),
        datasets: plan.datasets.iter().map(on).collect::<Result<_, _>>()?,
        matchers: (plan.matchers.iter())
            .map(|matcher| matcher.id.clone())
            .collect(),
        auc,
    })
}
