//! From what is to be run to the [`Plan`] that a run is known by.

use std::collections::BTreeSet;

use super::{Contender, Dataset, RunError};
use crate::datasets::Sequence;
use crate::files::check_name;
use crate::matchers::Source;
use crate::records::{DatasetPlan, EstimatorPlan, FORMAT, MatcherPlan, Plan, Settings};

/// The plan to run all `contenders` on all `datasets`.
///
/// # Errors
/// [`RunError::Contradiction`] if two datasets, matchers or estimators of a matcher have one name, a
/// name cannot be that of a file, a matcher has no estimator, a pair names a frame that is not
/// there, or matches from outside would be those of images that the dataset turns.
pub fn plan(
    datasets: &[Dataset],
    contenders: &[Contender],
    settings: Settings,
) -> Result<Plan, RunError> {
    check_names(
        "dataset",
        datasets.iter().map(|dataset| &*dataset.sequence.name),
    )?;
    check_names(
        "matcher",
        contenders.iter().map(|contender| contender.source.id()),
    )?;
    for contender in contenders {
        if contender.estimators.is_empty() {
            let id = contender.source.id();
            return contradiction(format!("matcher `{id}` is given no estimator"));
        }
        check_names(
            "estimator",
            contender.estimators.iter().map(|variant| &*variant.name),
        )?;
    }
    for dataset in datasets {
        check_pairs(&dataset.sequence)?;
        (contenders
            .iter()
            .filter(|one| dataset.runs(one.source.id())))
        .try_for_each(|one| check_turns(&dataset.sequence, one))?;
    }
    Ok(Plan {
        format: FORMAT,
        version: env!("CARGO_PKG_VERSION").into(),
        settings,
        datasets: (datasets.iter())
            .map(|dataset| dataset_plan(dataset, contenders))
            .collect(),
        matchers: contenders.iter().map(matcher_plan).collect(),
        shard: None,
    })
}

fn dataset_plan(dataset: &Dataset, contenders: &[Contender]) -> DatasetPlan {
    let sequence = &dataset.sequence;
    let ids = || contenders.iter().map(|contender| contender.source.id());
    let run = || ids().filter(|id| dataset.runs(id)).map(str::to_owned);
    DatasetPlan {
        name: sequence.name.clone(),
        path: dataset.path.clone(),
        frames: sequence.frames.len(),
        pairs: sequence.pairs.len(),
        fingerprint: sequence.fingerprint(),
        matchers: (!ids().all(|id| dataset.runs(id))).then(|| run().collect()),
    }
}

fn matcher_plan(contender: &Contender) -> MatcherPlan {
    let estimators = (contender.estimators.iter()).map(|variant| EstimatorPlan {
        id: variant.name.clone(),
        variant_of: (variant.name != variant.estimator.id).then(|| variant.estimator.id.clone()),
        params: variant.estimator.params.clone(),
    });
    let (version, params, extraction, notes) = match &contender.source {
        Source::Matcher(matcher) => {
            let extraction = Some(matcher.extraction.clone());
            (None, &matcher.params, extraction, Vec::new())
        }
        Source::Points(source) => {
            let (version, notes) = (source.version.clone(), source.notes.clone());
            (version, &source.params, None, notes)
        }
    };
    MatcherPlan {
        id: contender.source.id().into(),
        version,
        params: params.clone(),
        extraction,
        notes,
        estimators: estimators.collect(),
    }
}

/// Names become names of folders and files, one for each.
fn check_names<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), RunError> {
    let mut seen = BTreeSet::new();
    for name in names {
        if let Err(wrong) = check_name(name) {
            return contradiction(format!(
                "`{name}` cannot be the name of a {what}: it {wrong}"
            ));
        }
        if !seen.insert(name) {
            return contradiction(format!(
                "two of the {what}s are called `{name}`; rename one"
            ));
        }
    }
    Ok(())
}

/// Whether a contender sees the images as the dataset means them: a source of points sees the files,
/// whose pixels are not those of frames that are turned.
///
/// # Errors
/// [`RunError::Contradiction`] if it does not.
pub fn check_turns(sequence: &Sequence, contender: &Contender) -> Result<(), RunError> {
    let outside = contender.source.matcher().is_none();
    if outside && sequence.frames.iter().any(|frame| !frame.turn.is_none()) {
        return contradiction(format!(
            "dataset `{}` turns some of its images, which `{}` would see as they are stored; turn the files \
             themselves and import them again",
            sequence.name,
            contender.source.id(),
        ));
    }
    Ok(())
}

fn check_pairs(sequence: &Sequence) -> Result<(), RunError> {
    let frames = sequence.frames.len();
    let missing = |frame: u32| frame as usize >= frames;
    if let Some(pair) = (sequence.pairs.iter()).find(|pair| missing(pair.a) || missing(pair.b)) {
        return contradiction(format!(
            "dataset `{}` has {frames} frames, but a pair of frames {} and {}; frames are counted from 0",
            sequence.name, pair.a, pair.b
        ));
    }
    match sequence.pairs.iter().find(|pair| pair.pose().is_none()) {
        None => Ok(()),
        Some(pair) => contradiction(format!(
            "dataset `{}` knows a homography but no pose of the pair {} {}, and estimators of poses \
             cannot be judged by it",
            sequence.name, pair.a, pair.b
        )),
    }
}

fn contradiction<T>(reason: String) -> Result<T, RunError> {
    Err(RunError::Contradiction(reason))
}
