//! One pair of images, from pixels to outcomes, without a disk: what a run does with a pair.

use matchbench_vision::features::Features;
use matchbench_vision::geometry::Camera;
use matchbench_vision::image::GrayImage;
use matchbench_vision::matching::View;
use matchbench_vision::seed::Seed;

use super::Contender;
use super::guard::{Broken, guard, timed};
use super::matching::{search, select};
use super::sourcing::sourced;
use super::trial::Trial;
use crate::datasets::Truth;
use crate::matchers::{BuiltMatcher, BuiltPointSource, ImageFiles, Source};
use crate::records::{Counts, Outcome, SelectedMatches, StageTimes};

/// Two images with known cameras, and the truth about them.
#[derive(Clone, Copy, Debug)]
pub struct ImagePair<'a> {
    /// The pixels of `a` and `b`.
    pub images: [&'a GrayImage; 2],
    /// The cameras that took them.
    pub cameras: [&'a Camera; 2],
    /// What is known about them, of the kind that the estimators are judged by.
    pub truth: &'a Truth,
    /// The images as files, for sources that read these themselves; matchers need none.
    pub files: Option<ImageFiles<'a>>,
}

/// What a contender came to on a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// The features of `a` and `b`; `None` where the matches came without.
    pub features: Option<[Features; 2]>,
    /// The matched points that the estimators got.
    pub matches: SelectedMatches,
    /// What each estimator of the contender came to, in their order.
    pub outcomes: Vec<Outcome>,
    /// How long the stages took; the estimation is that of the first estimator.
    pub times: StageTimes,
}

/// Why a pair cannot be evaluated: a stage before the estimation broke.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct EvaluationError(String);

/// Does with a pair what a run does; `seed` is that of the pair, see [`pair_seed`](super::pair_seed).
///
/// An estimator that breaks leaves [`Outcome::Failed`].
///
/// # Errors
/// If the extraction, search or selection breaks, or a source has no matches.
pub fn evaluate(
    contender: &Contender,
    pair: &ImagePair<'_>,
    seed: Seed,
) -> Result<Evaluation, EvaluationError> {
    let mut times = StageTimes::default();
    let (features, matches) = match &contender.source {
        Source::Matcher(matcher) => {
            let (features, matches) = matched(matcher, pair, seed, &mut times)?;
            (Some(features), matches)
        }
        Source::Points(source) => (None, from_source(source, pair, seed, &mut times)?),
    };
    let trial = Trial {
        cameras: pair.cameras,
        truth: pair.truth,
        size: &|side| Ok(pair.images[side].size()),
        seed,
        time_budget: None,
    };
    let mut outcomes = Vec::with_capacity(contender.estimators.len());
    for variant in &contender.estimators {
        let mut own = StageTimes::default();
        let outcome = trial.evaluate(&matches.points, variant, &mut own);
        if outcomes.is_empty() {
            times.estimate = own.estimate;
        }
        outcomes.push(outcome.map_or_else(Broken::outcome, |judged| judged.outcome));
    }
    Ok(Evaluation {
        features,
        matches,
        outcomes,
        times,
    })
}

fn matched(
    matcher: &BuiltMatcher,
    pair: &ImagePair<'_>,
    seed: Seed,
    times: &mut StageTimes,
) -> Result<([Features; 2], SelectedMatches), EvaluationError> {
    let matcher = &*matcher.matcher;
    let extract = |image, seconds: &mut Option<f64>| {
        timed(seconds, || guard("extraction", || matcher.extract(image))).map_err(EvaluationError)
    };
    let [image_a, image_b] = pair.images;
    let a = extract(image_a, &mut times.extract_a)?;
    let b = extract(image_b, &mut times.extract_b)?;
    let mut counts = Counts::default();
    let putative = search(matcher, &a, &b, &mut counts, times).map_err(EvaluationError)?;
    let uses_pixels = matcher.uses_pixels();
    let [view_a, view_b] = [(&a, 0), (&b, 1)].map(|(features, side)| View {
        features,
        image: uses_pixels.then_some(pair.images[side]),
        camera: Some(pair.cameras[side]),
    });
    let matches = select(matcher, view_a, view_b, putative, seed, &mut counts, times);
    let matches = matches.map_err(EvaluationError)?;
    Ok(([a, b], matches))
}

fn from_source(
    source: &BuiltPointSource,
    pair: &ImagePair<'_>,
    seed: Seed,
    times: &mut StageTimes,
) -> Result<SelectedMatches, EvaluationError> {
    let id = &source.id;
    let files = (pair.files.as_ref())
        .ok_or_else(|| EvaluationError(format!("{id} reads image files, and none are given")))?;
    let mut counts = Counts::default();
    sourced(source, files, seed, &mut counts, times, &mut None)
        .map_err(|error| EvaluationError(error.to_string()))?
        .map_err(|broken| EvaluationError(broken.reason))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::pair_seed;
    use super::super::testing::{Toy, dataset, decode, records_of};
    use super::*;

    #[test]
    fn a_pair_comes_to_what_a_run_records_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let contender = || Toy::default().contender("bright", &["first", "second"]);
        let records = records_of(folder.path(), &[contender()]);
        let sequence = dataset(folder.path(), "street", 12).sequence;
        let mut evaluated = 0;
        for pair in &sequence.pairs {
            let frames = [pair.a, pair.b].map(|frame| &sequence.frames[frame as usize]);
            let images = frames.map(|frame| decode(&fs::read(&frame.image).unwrap()).unwrap());
            let image_pair = ImagePair {
                images: images.each_ref(),
                cameras: frames.map(|frame| &frame.camera),
                truth: &pair.truth,
                files: None,
            };
            for repetition in 0..2 {
                let seed = pair_seed(0, "street", "bright", (pair.a, pair.b), repetition);
                let evaluation = evaluate(&contender(), &image_pair, seed).unwrap();
                for (name, outcome) in ["first", "second"].iter().zip(&evaluation.outcomes) {
                    let recorded = records.iter().find(|record| {
                        let task = &record.task;
                        (task.a, task.b, task.repetition) == (pair.a, pair.b, repetition)
                            && task.estimator == *name
                    });
                    let recorded = recorded.unwrap();
                    assert_eq!(
                        (&recorded.outcome, recorded.counts),
                        (outcome, evaluation.matches.counts)
                    );
                    evaluated += 1;
                }
            }
        }
        assert_eq!(evaluated, records.len());
    }

    #[test]
    fn variants_of_an_estimator_make_the_same_draws_whatever_they_are_called() {
        let folder = tempfile::tempdir().unwrap();
        let toy = Toy::default();
        let mut contender = toy.contender("bright", &["first", "first", "second"]);
        contender.estimators[0].name = "first@0.5".into();
        contender.estimators[1].name = "first@4".into();
        let records = records_of(folder.path(), &[contender]);
        let of = |name: &str| -> Vec<&Outcome> {
            let named = records
                .iter()
                .filter(|record| record.task.estimator == name);
            named.map(|record| &record.outcome).collect()
        };
        assert!(of("first@0.5").len() > 20);
        assert_eq!(of("first@0.5"), of("first@4"));
        assert_ne!(
            of("first@0.5"),
            of("second"),
            "another estimator draws anew"
        );
    }
}
