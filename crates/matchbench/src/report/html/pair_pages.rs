//! Pictures of pairs beside the main page, which has no room for them: a page for each pair with all matchers,
//! `pairs/<dataset>/<a>-<b>.html`, and its images as files that these pages share.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use minijinja::{Value, context};

use crate::counted::counted;
use crate::metrics::{Model, PairGeometry, PairResult, ResultSet};
use crate::protocols::{Protocol, of_estimator};

use super::super::content::Content;
use super::super::file_names::file_names;
use super::super::numbers::short;
use super::super::overview::Overview;
use super::super::pair_words::sentence;
use super::super::svg::{DISTANCES, Target, pair};
use super::super::words::together;
use super::super::{PairView, Tally};
use super::warp::warp;
use super::{environment, template};
use crate::metrics::method;

/// Most matches of a pair that are drawn.
const MAX_MATCHES: usize = 120;

/// Every file with its path in the folder of the report.
pub(in super::super) fn pair_pages(
    content: &Content,
    overview: &Overview<'_>,
) -> Vec<(String, Vec<u8>)> {
    let environment = environment();
    let template = template(&environment, "pair.html");
    let mut files = Vec::new();
    for (dataset, folder) in overview.datasets.iter().zip(file_names(&overview.datasets)) {
        let mut pairs = BTreeMap::<(u32, u32), Vec<&PairView>>::new();
        for view in content.views.iter().filter(|view| view.dataset == *dataset) {
            pairs.entry(view.frames).or_default().push(view);
        }
        let mut frames = BTreeSet::new();
        for (&(a, b), views) in &pairs {
            for (frame, image) in [a, b].iter().zip(&views[0].images) {
                if frames.insert(*frame) {
                    let path = format!("pairs/{folder}/images/{frame}.jpg");
                    files.push((path, image.jpeg.clone()));
                }
            }
            let facts = (content.geometry.get(*dataset))
                .and_then(|geometry| geometry.get(&(a, b)))
                .map(facts);
            let panels: Vec<Value> = views.iter().map(|view| panel(content, view)).collect();
            let page = template.render(context! {
                title => format!("{dataset}: {a} – {b}"),
                style => include_str!("style.css"),
                facts,
                panels,
                has_keypoints => views.iter().any(|view| view.has_keypoints()),
                colours => colours(),
            });
            let page = page.expect("the template only uses what it is given");
            files.push((format!("pairs/{folder}/{a}-{b}.html"), page.into_bytes()));
        }
    }
    files
}

/// The numbers of matches, in sentences.
fn counts(model: Model, tally: &Tally, drawn: usize, is_estimated: bool) -> String {
    let all = counted(tally.matches, "match");
    if tally.matches == 0 {
        return format!("Drawn: {all}.");
    }
    let mut text = format!("Drawn: {drawn} of {all}.");
    if is_estimated {
        let _ = write!(text, " The estimate agrees with {} of them.", tally.agree);
    }
    if let Some(counts) = tally.by_distance {
        let truth = match model {
            Model::Pose => "epipolar line",
            Model::Homography => "place",
        };
        let classes: Vec<String> = (DISTANCES.iter().zip(counts))
            .filter(|(_, count)| *count > 0)
            .map(|((_, name), count)| format!("{name} for {count}"))
            .collect();
        let _ = write!(
            text,
            " The distance from the true {truth} is {} of them.",
            together(&classes)
        );
    }
    text
}

/// How hard a pair is, judged by its cameras alone, in a sentence.
pub(super) fn facts(known: &PairGeometry) -> String {
    let how = if known.is_measured { "" } else { "at most " };
    let share = format!("{how}{:.2}", known.overlap);
    match (known.baseline, known.view_angle) {
        (Some(baseline), Some(angle)) => format!(
            "Baseline {}, angle between the optical axes {angle:.1}°, overlap {share}.",
            short(baseline)
        ),
        _ => format!("Overlap {share}."),
    }
}

/// What the colours of matches mean.
pub(super) fn colours() -> Vec<Value> {
    DISTANCES
        .map(|(colour, text)| context! { colour, text })
        .to_vec()
}

/// One matcher on the pair.
fn panel(content: &Content, view: &PairView) -> Value {
    let is_its = |set: &&ResultSet| {
        (&set.dataset, &set.matcher, &set.estimator)
            == (&view.dataset, &view.matcher, &view.estimator)
    };
    let result = (content.results.iter().find(is_its)).and_then(|set| {
        let mut pairs = set.pairs.iter();
        pairs.find(|pair| (pair.a, pair.b) == view.frames && pair.repetition == 0)
    });
    let label = method(&view.matcher, &view.estimator);
    let protocol = of_estimator(&view.estimator);
    picture(&label, result.map(|pair| (pair, protocol)), view)
}

/// The images of a pair with the matches of one matcher over them, and its result there if that is known.
pub(super) fn picture(
    label: &str,
    result: Option<(&PairResult, &Protocol)>,
    view: &PairView,
) -> Value {
    let words = result.map(|(pair, protocol)| sentence(pair, protocol));
    let is_estimated = result.is_none_or(|(pair, _)| pair.outcome.is_ok());
    let total: usize = view.images.iter().map(|image| image.original.0).sum();
    let images: Vec<Value> = ([view.frames.0, view.frames.1].iter().zip(&view.images))
        .map(|(frame, image)| {
            let width = 99.2 * image.original.0 as f64 / total.max(1) as f64;
            context! { frame, width => format!("{width:.3}") }
        })
        .collect();
    let drawing = pair(Target::Page, view, "matches", MAX_MATCHES);
    context! {
        label,
        words,
        images,
        drawing => Value::from_safe_string(drawing),
        counts => counts(view.model, &view.tally, view.matches.len().min(MAX_MATCHES), is_estimated),
        warp => warp(view),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_matches_are_sentences() {
        let tally = Tally {
            matches: 443,
            by_distance: Some([440, 0, 2, 1]),
            agree: 430,
        };
        assert_eq!(
            counts(Model::Pose, &tally, 120, true),
            "Drawn: 120 of 443 matches. The estimate agrees with 430 of them. The distance from the true epipolar \
             line is below 1 px for 440, 3 to 10 px for 2 and 10 px and more for 1 of them."
        );
        let unknown = Tally {
            by_distance: None,
            ..tally
        };
        assert!(!counts(Model::Pose, &unknown, 120, true).contains("distance"));
        let failed = counts(Model::Pose, &unknown, 120, false);
        assert_eq!(failed, "Drawn: 120 of 443 matches.");
        assert_eq!(
            counts(Model::Homography, &Tally::default(), 0, true),
            "Drawn: 0 matches."
        );
    }
}
