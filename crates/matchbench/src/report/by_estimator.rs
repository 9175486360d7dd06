//! AUC of matchers by estimators, as a heat map. Poses and homographies have different AUCs, so each has a figure
//! of its own.

use std::collections::BTreeSet;

use crate::metrics::{Model, Summary};

use super::svg::{Target, heat_map};

/// AUC of matchers by the estimators of one model, on one dataset or the mean over all datasets, of those that were
/// run on all of them and lack no results of any. `None` if there is only one estimator, or no AUC.
pub(super) fn estimator_figure(
    summaries: &[Summary],
    dataset: Option<&str>,
    model: Model,
    target: Target,
) -> Option<String> {
    let mut matchers: Vec<&str> = Vec::new();
    let mut estimators: Vec<&str> = Vec::new();
    let of_model = || summaries.iter().filter(|summary| summary.model == model);
    for summary in of_model() {
        if !matchers.contains(&&*summary.matcher) {
            matchers.push(&summary.matcher);
        }
        if !estimators.contains(&&*summary.estimator) {
            estimators.push(&summary.estimator);
        }
    }
    let datasets: BTreeSet<&str> = (of_model().map(|s| &*s.dataset))
        .filter(|name| dataset.is_none_or(|one| one == *name))
        .collect();
    if estimators.len() < 2 || datasets.is_empty() {
        return None;
    }
    let mean = |matcher: &str, estimator: &str| {
        let on = |name: &&str| {
            let of = |s: &&Summary| {
                s.dataset == **name && s.matcher == matcher && s.estimator == estimator
            };
            let is_compared = |s: &&Summary| dataset.is_some() || s.lacking == 0;
            of_model().find(of).filter(is_compared)?.auc().value
        };
        let values: Option<Vec<f64>> = datasets.iter().map(on).collect();
        values.map(|values| values.iter().sum::<f64>() / values.len() as f64)
    };
    let cells: Vec<Vec<Option<f64>>> = (matchers.iter())
        .map(|matcher| {
            estimators
                .iter()
                .map(|estimator| mean(matcher, estimator))
                .collect()
        })
        .collect();
    if cells.iter().flatten().all(Option::is_none) {
        return None;
    }
    let name = dataset.unwrap_or("mean over all datasets");
    let title = format!("{}: {name}", title(model));
    Some(heat_map(target, &title, &matchers, &estimators, &cells))
}

/// What [`estimator_figure`] shows, in words.
pub(super) fn title(model: Model) -> &'static str {
    match model {
        Model::Pose => "AUC by estimator",
        Model::Homography => "AUC at 3 px by estimator",
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{homographies, summary};
    use super::*;

    #[test]
    fn a_mean_over_all_datasets_is_of_all_of_them() {
        let by = |dataset: &str, matcher: &str, tenths, estimator: &str| Summary {
            estimator: estimator.into(),
            ..summary(dataset, matcher, tenths)
        };
        let mut summaries = vec![
            by("wall", "sift", 7, "ransac-e"),
            by("room", "sift", 5, "ransac-e"),
            by("wall", "sift", 9, "best"),
        ];
        let figure = |summaries: &[Summary], dataset| {
            estimator_figure(summaries, dataset, Model::Pose, Target::File)
        };
        let svg = figure(&summaries, None).expect("two estimators");
        assert!(svg.contains("0.600") && !svg.contains("0.900"), "{svg}");
        // What one lacks on a dataset is not in a mean, but the dataset shows what it has.
        summaries[1].lacking = 2;
        assert!(figure(&summaries, None).is_none());
        let svg = figure(&summaries, Some("room")).expect("it has some results");
        assert!(svg.contains("0.500"), "{svg}");
        summaries.remove(1);
        summaries.push(by("room", "orb", 5, "best"));
        assert!(figure(&summaries, None).is_none());
        assert!(figure(&summaries, Some("wall")).is_some());
    }

    #[test]
    fn poses_and_homographies_have_heat_maps_of_their_own() {
        let by = |summary: Summary, estimator: &str| Summary {
            estimator: estimator.into(),
            ..summary
        };
        let mut summaries = vec![
            by(summary("wall", "sift", 7), "ransac-e"),
            by(homographies("wall", "sift"), "best-h"),
        ];
        let figure = |summaries: &[Summary], dataset, model| {
            estimator_figure(summaries, dataset, model, Target::File)
        };
        // One estimator of each model: nothing is compared.
        for model in [Model::Pose, Model::Homography] {
            assert!(figure(&summaries, Some("wall"), model).is_none());
        }
        summaries.push(by(summary("wall", "sift", 9), "best"));
        summaries.push(by(homographies("wall", "sift"), "ransac-h"));
        let svg = figure(&summaries, Some("wall"), Model::Pose).expect("two estimators");
        assert!(svg.contains("0.900") && !svg.contains("best-h"), "{svg}");
        let svg = figure(&summaries, Some("wall"), Model::Homography).expect("two estimators");
        assert!(svg.contains("AUC at 3 px by estimator: wall"), "{svg}");
        assert!(svg.contains("best-h") && !svg.contains("0.900"), "{svg}");
        assert!(figure(&summaries, Some("room"), Model::Pose).is_none());
    }
}
