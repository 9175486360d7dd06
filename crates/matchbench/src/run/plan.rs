//! Makes the [`Plan`] of a run from its datasets, contenders and settings, and refuses what contradicts
//! itself.

use std::collections::BTreeMap;

use super::{Contender, Dataset, RunError, built_in};
use crate::counted::counted;
use crate::datasets::{Pair, Sequence};
use crate::estimators::Estimator;
use crate::files::check_name;
use crate::front_door::ESTIMATORS;
use crate::matchers::Source;
use crate::records::{DatasetPlan, EstimatorPlan, FORMAT, MatcherPlan, Plan, RunSettings};

/// The plan to run all `contenders` on all `datasets`.
///
/// # Errors
/// [`RunError::Contradiction`] if two datasets, matchers or estimators of a matcher have one name, a
/// name cannot be that of a file, that of a matcher has a `+`, a matcher from outside is called as what is built in, a
/// matcher has no estimator, a pair names a
/// frame that is not there, matches from outside would be those of images that the dataset turns, or a pair
/// lacks the truth that an estimator is judged by.
pub fn plan(
    datasets: &[Dataset],
    contenders: &[Contender],
    settings: RunSettings,
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
        let id = contender.source.id();
        if id.contains('+') {
            return contradiction(format!(
                "`{id}` cannot be the name of a matcher: in names of files a + stands before the estimator"
            ));
        }
        if contender.source.matcher().is_none() && built_in().takes(id) {
            return contradiction(format!(
                "`{id}` is the name of something built in, which a matcher from outside cannot have; choose another"
            ));
        }
        if contender.estimators.is_empty() {
            return contradiction(format!("matcher `{id}` is given no estimator"));
        }
        check_names(
            "estimator",
            contender.estimators.iter().map(|variant| &*variant.name),
        )?;
    }
    for dataset in datasets {
        let sequence = &dataset.sequence;
        check_pairs(sequence)?;
        for contender in contenders {
            if dataset.runs(contender.source.id()) {
                check_turns(sequence, contender)?;
                check_truth(&sequence.name, &sequence.pairs, contender)?;
            }
        }
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
    let whole = dataset.whole.clone();
    let whole = whole.unwrap_or_else(|| sequence.whole());
    DatasetPlan {
        name: sequence.name.clone(),
        path: dataset.path.clone(),
        frames: sequence.frames.len(),
        pairs: whole.pairs,
        fingerprint: whole.fingerprint,
        matchers: (!ids().all(|id| dataset.runs(id))).then(|| run().collect()),
    }
}

fn matcher_plan(contender: &Contender) -> MatcherPlan {
    let estimators = (contender.estimators.iter()).map(|variant| EstimatorPlan {
        id: variant.name.clone(),
        variant_of: (variant.name != variant.estimator.id).then(|| variant.estimator.id.clone()),
        params: variant.estimator.params.clone(),
        protocol: variant.protocol.rules(),
    });
    let (id, estimators) = (contender.source.id().into(), estimators.collect());
    match &contender.source {
        Source::Matcher(matcher) => MatcherPlan {
            id,
            version: None,
            command: None,
            params: matcher.params.clone(),
            extraction: Some(matcher.extraction.clone()),
            notes: Vec::new(),
            estimators,
        },
        Source::Points(source) => MatcherPlan {
            id,
            version: source.version.clone(),
            command: source.command.clone(),
            params: source.params.clone(),
            extraction: None,
            notes: source.notes.clone(),
            estimators,
        },
    }
}

/// Names become names of folders and files, one for each, also where upper and lower case are not distinguished: a run
/// may be copied there.
fn check_names<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), RunError> {
    let mut seen = BTreeMap::new();
    for name in names {
        if let Err(wrong) = check_name(name) {
            return contradiction(format!(
                "`{name}` cannot be the name of a {what}: it {wrong}"
            ));
        }
        match seen.insert(name.to_lowercase(), name) {
            None => {}
            Some(other) if other == name => {
                return contradiction(format!(
                    "two of the {what}s are called `{name}`; name it once, or rename one"
                ));
            }
            Some(other) => {
                return contradiction(format!(
                    "the {what}s `{other}` and `{name}` would be one file where upper and lower case are not \
                     distinguished, as on macOS and Windows; rename one"
                ));
            }
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
    if outside && sequence.turned().is_some() {
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
            "dataset `{}` has {}, but a pair of frames {} and {}; frames are counted from 0",
            sequence.name,
            counted(frames, "frame"),
            pair.a,
            pair.b
        ));
    }
    Ok(())
}

/// Whether these `pairs` of a dataset all have the truth that the estimators of a contender are judged by.
///
/// # Errors
/// [`RunError::Contradiction`] if one does not.
pub fn check_truth<'a>(
    dataset: &str,
    pairs: impl IntoIterator<Item = &'a Pair> + Copy,
    contender: &Contender,
) -> Result<(), RunError> {
    for variant in &contender.estimators {
        let of_poses = matches!(variant.estimator.estimator, Estimator::Pose(_));
        let (known, missing, others) = if of_poses {
            ("a homography", "pose", "homographies (best-h, ransac-h)")
        } else {
            ("a pose", "homography", "poses (best, ransac-e ...)")
        };
        let lacks = |pair: &&Pair| {
            if of_poses {
                pair.pose().is_none()
            } else {
                pair.homography().is_none()
            }
        };
        if let Some(pair) = pairs.into_iter().find(lacks) {
            return contradiction(format!(
                "dataset `{dataset}` knows {known} but no {missing} of the pair {} {}, which the estimator `{}` \
                 would be judged by; choose one of {others} with {ESTIMATORS}, and give datasets that know the other runs of their own",
                pair.a, pair.b, variant.name
            ));
        }
    }
    Ok(())
}

fn contradiction<T>(reason: String) -> Result<T, RunError> {
    Err(RunError::Contradiction(reason))
}
