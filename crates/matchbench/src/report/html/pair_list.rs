//! The list of pairs as data for the script of the page: columns of small numbers, and pictures of a sample.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::Serialize;

use crate::metrics::{Angle, Model, PairResult, ResultSet};
use crate::protocols::PROTOCOLS;
use crate::records::Plan;

use super::super::command_line::show;
use super::super::content::Content;
use super::super::figures::is_measured;
use super::super::file_names::file_names;
use super::super::overview::Overview;
use super::super::pair_words::{FAILURES, NOT_RECORDED, name, reason};
use super::super::svg::{DISTANCES, Target, data_url, pair};
use super::Extent;

/// Most pairs of a dataset that have pictures in the page.
const MAX_PICTURED: usize = 4;
/// Most matches of a pair that are drawn.
const MAX_MATCHES: usize = 80;

/// What the script reads.
#[derive(Serialize)]
struct Data<'a> {
    datasets: Vec<Listed<'a>>,
    /// Short names of the failures, in the order of their numbers, and last that a pair is not recorded.
    failures: Vec<&'static str>,
    /// Sentences for them, under each protocol.
    reasons: Vec<Vec<String>>,
    /// Colours and names of the distances to the true epipolar line.
    distances: [(&'static str, &'static str); 4],
    /// Images as data URLs.
    images: Vec<String>,
    /// The file with the pairs that are not listed; absent if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    all_pairs: Option<&'static str>,
}

/// The pairs of one dataset, column by column; angles are in hundredths of a degree.
#[derive(Default, Serialize)]
struct Listed<'a> {
    name: &'a str,
    /// How many pairs are not listed.
    left_out: usize,
    a: Vec<u32>,
    b: Vec<u32>,
    repetition: Vec<u32>,
    /// Empty where the geometry is not known.
    baseline: Vec<f32>,
    angle: Vec<f32>,
    overlap: Vec<f32>,
    /// Whether the overlap of all was measured; else it is an upper bound.
    measured: bool,
    methods: Vec<Method<'a>>,
    /// Folder of the pictures beside the page, and the numbers of the pairs that have one there.
    folder: String,
    pages: Vec<usize>,
}

#[derive(Serialize)]
struct Method<'a> {
    label: &'a str,
    matcher: &'a str,
    estimator: &'a str,
    /// The number of its protocol.
    protocol: usize,
    /// The command that draws a pair, without the numbers of its frames; absent if no command can do it.
    #[serde(skip_serializing_if = "Option::is_none")]
    show: Option<[String; 2]>,
    /// -1 if there is no estimate.
    rotation: Vec<i32>,
    /// For homographies: the corner error in hundredths of a pixel, instead of angles.
    #[serde(skip_serializing_if = "Option::is_none")]
    corner: Option<Vec<Hundredths>>,
    translation: Vec<i32>,
    /// -1 if they were not counted.
    correspondences: Vec<i64>,
    /// The same.
    selected: Vec<i64>,
    /// -1 if there is an estimate, else the number of the failure; the one after them if the pair is not recorded.
    failure: Vec<i8>,
    /// Pictures, by the number of the pair.
    pictures: BTreeMap<usize, Picture>,
}

/// An error in hundredths, as a whole number where one can hold it: such a number takes fewer bytes. -1 if there is none.
#[derive(Serialize)]
#[serde(untagged)]
enum Hundredths {
    Whole(i32),
    Large(f64),
}

impl Hundredths {
    fn of(error: Option<f64>) -> Self {
        match error.map(|error| (error * 100.0).round()) {
            None => Self::Whole(-1),
            Some(large) if large > f64::from(i32::MAX) => Self::Large(large.min(f64::MAX)),
            Some(whole) => Self::Whole(whole as i32),
        }
    }
}

#[derive(Serialize)]
struct Picture {
    images: [usize; 2],
    /// Width divided by height of each image.
    sizes: [(usize, usize); 2],
    /// How many matches are drawn, of all of them; how many agree, and how many are how near.
    drawn: usize,
    matches: usize,
    agree: usize,
    by_distance: Option<[usize; 4]>,
    drawing: String,
}

/// JSON that can stand in a `script` element.
pub(super) fn data(content: &Content, overview: &Overview<'_>, extent: &Extent) -> String {
    let keys: Vec<Vec<Key>> = (overview.datasets.iter())
        .map(|dataset| keys_of(content, dataset))
        .collect();
    let results = keys.iter().zip(&overview.datasets).map(|(keys, dataset)| {
        let sets = content
            .results
            .iter()
            .filter(|set| set.dataset == **dataset);
        keys.len() * sets.count()
    });
    let share = (extent.results as f64 / results.sum::<usize>().max(1) as f64).min(1.0);
    let mut images = Images::default();
    let budget = extent.pictures / overview.datasets.len().max(1);
    let datasets = (overview
        .datasets
        .iter()
        .zip(file_names(&overview.datasets))
        .enumerate())
    .map(|(column, (dataset, folder))| {
        let count = (keys[column].len() as f64 * share).ceil() as usize;
        let (some, others) = keys[column].split_at(count);
        let mut listed = listed(content, overview, (column, dataset), some);
        listed.left_out = others.len();
        listed.folder = format!("pairs/{folder}");
        if budget > 0 {
            listed.add_pictures(content, budget, &mut images);
        }
        if !extent.files.is_empty() {
            listed.pages.clear();
        }
        listed
    })
    .collect();
    let data = Data {
        datasets,
        failures: FAILURES
            .map(name)
            .into_iter()
            .chain([NOT_RECORDED[0]])
            .collect(),
        reasons: (PROTOCOLS.iter())
            .map(|protocol| {
                let reasons = FAILURES.map(|failure| reason(failure, protocol));
                reasons
                    .into_iter()
                    .chain([NOT_RECORDED[1].to_owned()])
                    .collect()
            })
            .collect(),
        distances: DISTANCES,
        images: images.urls,
        all_pairs: extent.all_pairs(),
    };
    // Inside `script`, HTML only looks for the end tag; `<` is escaped so that there is no such tag in the
    // data.
    serde_json::to_string(&data)
        .expect("names and numbers can be written")
        .replace('<', "\\u003c")
}

/// The images that are used, each stored once.
#[derive(Default)]
struct Images {
    seen: BTreeMap<usize, usize>,
    urls: Vec<String>,
    bytes: usize,
}

impl Images {
    fn index(&mut self, image: &Arc<super::super::Thumbnail>) -> usize {
        *self
            .seen
            .entry(Arc::as_ptr(image) as usize)
            .or_insert_with(|| {
                let url = data_url(image);
                self.bytes += url.len();
                self.urls.push(url);
                self.urls.len() - 1
            })
    }
}

/// The pairs of a dataset that any method has: in the order that all methods have, or, where some lack pairs that others have,
/// by their numbers.
fn keys_of(content: &Content, dataset: &str) -> Vec<Key> {
    let sets = || content.results.iter().filter(|set| set.dataset == dataset);
    let keys = |set: &ResultSet| -> Vec<Key> { set.pairs.iter().map(key).collect() };
    let first = sets().next().map_or_else(Vec::new, keys);
    // Millions of pairs are not sorted where none is lacking.
    if sets().all(|set| set.pairs.iter().map(key).eq(first.iter().copied())) {
        return first;
    }
    let all: BTreeSet<Key> = sets().flat_map(keys).collect();
    all.into_iter().collect()
}

/// The pairs with these `keys`, with all methods of the dataset.
fn listed<'a>(
    content: &'a Content,
    overview: &'a Overview<'_>,
    (column, dataset): (usize, &'a str),
    keys: &[Key],
) -> Listed<'a> {
    let mut listed = Listed {
        name: dataset,
        ..Listed::default()
    };
    let sets = || content.results.iter().filter(|set| set.dataset == dataset);
    let count = keys.len();
    let plan = content.plan();
    let geometry = content.geometry.get(dataset);
    for &(a, b, repetition) in keys {
        listed.a.push(a);
        listed.b.push(b);
        listed.repetition.push(repetition);
        if let Some(known) = geometry.and_then(|geometry| geometry.get(&(a, b))) {
            listed.baseline.extend(known.baseline.map(rounded));
            listed.angle.extend(known.view_angle.map(rounded));
            listed.overlap.push(rounded(known.overlap));
        }
    }
    listed.measured = geometry.is_some_and(is_measured);
    for values in [&mut listed.baseline, &mut listed.angle, &mut listed.overlap] {
        if values.len() < count {
            values.clear();
        }
    }
    for row in &overview.rows {
        let Some(summary) = row.cells[column].as_ref().map(|cell| cell.summary) else {
            continue;
        };
        let of = |matcher: &str, estimator: &str| {
            matcher == summary.matcher && estimator == summary.estimator
        };
        let Some(set) = sets().find(|set| of(&set.matcher, &set.estimator)) else {
            continue;
        };
        let mut method = Method {
            label: &row.label,
            matcher: &set.matcher,
            estimator: &set.estimator,
            protocol: (PROTOCOLS.iter())
                .position(|protocol| protocol.id == summary.protocol)
                .expect("all protocols are listed"),
            show: plan.as_ref().and_then(|plan| shown(plan, set)),
            rotation: Vec::with_capacity(count),
            corner: (summary.model == Model::Homography).then(Vec::new),
            translation: Vec::with_capacity(count),
            correspondences: Vec::with_capacity(count),
            selected: Vec::with_capacity(count),
            failure: Vec::with_capacity(count),
            pictures: BTreeMap::new(),
        };
        let results: BTreeMap<_, _> = set.pairs.iter().map(|pair| (key(pair), pair)).collect();
        for key in keys {
            method.push(results.get(key).copied());
        }
        listed.methods.push(method);
    }
    listed
}

impl Listed<'_> {
    /// Pictures of the first pairs that have any, with all matchers, as many as fit into the `budget` of bytes.
    fn add_pictures(&mut self, content: &Content, budget: usize, images: &mut Images) {
        let views = || {
            content
                .views
                .iter()
                .filter(|view| view.dataset == self.name)
        };
        let end = images.bytes + budget;
        let mut pictures = Vec::new();
        let mut pages = Vec::new();
        let place: BTreeMap<_, _> = (self.a.iter().zip(&self.b).enumerate())
            .rev()
            .map(|(at, (&a, &b))| ((a, b), at))
            .collect();
        for view in views() {
            let Some(&at) = place.get(&view.frames) else {
                continue;
            };
            if !pages.contains(&at) {
                pages.push(at);
            }
            let embedded = pages.len() <= MAX_PICTURED && images.bytes <= end;
            let method = (self.methods.iter())
                .position(|m| m.matcher == view.matcher && m.estimator == view.estimator);
            let (true, Some(method)) = (embedded, method) else {
                continue;
            };
            let caption = format!("frames {} and {}", view.frames.0, view.frames.1);
            let drawing = pair(Target::Page, view, &caption, MAX_MATCHES);
            images.bytes += drawing.len();
            let picture = Picture {
                images: view.images.each_ref().map(|image| images.index(image)),
                sizes: view.images.each_ref().map(|image| image.original),
                drawn: view.matches.len().min(MAX_MATCHES),
                matches: view.tally.matches,
                agree: view.tally.agree,
                by_distance: view.tally.by_distance,
                drawing,
            };
            pictures.push((method, at, picture));
        }
        for (method, at, picture) in pictures {
            self.methods[method].pictures.insert(at, picture);
        }
        self.pages = pages;
    }
}

impl Method<'_> {
    /// Adds its result of the next pair, or that there is none.
    fn push(&mut self, pair: Option<&PairResult>) {
        let angle = |angle| {
            let error = pair.and_then(|pair| pair.error(angle));
            error.map_or(-1, |error| (error * 100.0).round() as i32)
        };
        self.rotation.push(angle(Angle::Rotation));
        self.translation.push(angle(Angle::Translation));
        if let Some(corner) = &mut self.corner {
            corner.push(Hundredths::of(pair.and_then(PairResult::corner_error)));
        }
        let counted = |number: Option<u32>| number.map_or(-1, i64::from);
        let correspondences = pair.and_then(|pair| pair.correspondences);
        self.correspondences.push(counted(correspondences));
        let counts = pair.and_then(|pair| pair.counts);
        self.selected
            .push(counted(counts.map(|counts| counts.selected)));
        let number = match pair.map(|pair| pair.outcome) {
            None => Some(FAILURES.len()),
            Some(outcome) => (outcome.err())
                .and_then(|failure| FAILURES.iter().position(|&other| other == failure)),
        };
        self.failure.push(number.map_or(-1, |number| number as i8));
    }
}

/// The command that draws a pair of these results.
fn shown(plan: &Plan, set: &ResultSet) -> Option<[String; 2]> {
    let dataset = (plan.datasets.iter()).find(|dataset| dataset.name == set.dataset)?;
    let matcher = plan.matcher(&set.matcher)?;
    let estimator = (matcher.estimators.iter()).find(|planned| planned.id == set.estimator)?;
    show(plan, dataset, (matcher, estimator))
}

/// Both frames of a pair, and its repetition.
type Key = (u32, u32, u32);

fn key(pair: &PairResult) -> Key {
    (pair.a, pair.b, pair.repetition)
}

/// Rounded to three decimals, which is as much as the page shows.
fn rounded(value: f64) -> f32 {
    ((value * 1e3).round() / 1e3) as f32
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::content;
    use super::*;
    use crate::metrics::{Deviation, Summary};

    #[test]
    fn names_cannot_end_the_script_and_columns_are_as_long() {
        let mut content = content(&[("</script>", "sift", 6), ("</script>", "orb", 2)]);
        // Of the first pair nobody told how many there are; of the last, that there are none.
        content.results[0].pairs[0].correspondences = None;
        let overview = Overview::new(&content.summaries);
        let text = data(&content, &overview, &Extent::default());
        assert!(!text.contains('<'));
        let value: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
        let listed = &value["datasets"][0];
        assert_eq!(listed["name"], "</script>");
        for method in 0..2 {
            for column in [
                "rotation",
                "translation",
                "correspondences",
                "selected",
                "failure",
            ] {
                let column = listed["methods"][method][column].as_array().map(Vec::len);
                assert_eq!(column, Some(10));
            }
        }
        assert_eq!(listed["methods"][0]["failure"][0], -1);
        assert_eq!(listed["methods"][0]["failure"][9], 1);
        assert_eq!(listed["methods"][0]["translation"][0], 20);
        let correspondences = &listed["methods"][0]["correspondences"];
        assert_eq!(correspondences[0], -1);
        assert!(correspondences[1].as_i64() > Some(0), "{correspondences}");
        assert_eq!(correspondences[9], 0);
    }

    #[test]
    fn corner_errors_of_any_size_are_what_they_are() {
        let mut content = content(&[("room", "sift", 6)]);
        let errors = [Some(0.25), Some(3e7), Some(1e20), Some(f64::MAX), None];
        content.results[0].pairs.truncate(errors.len());
        for (pair, error) in content.results[0].pairs.iter_mut().zip(errors) {
            pair.model = Model::Homography;
            pair.outcome = Ok(Deviation::Corners(error));
        }
        let summaries = [Summary::new(&content.results[0])];
        let text = data(&content, &Overview::new(&summaries), &Extent::default());
        let value: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
        let corner = &value["datasets"][0]["methods"][0]["corner"];
        assert_eq!(*corner, serde_json::json!([25, 3e9, 1e22, f64::MAX, -1]));
    }

    #[test]
    fn pairs_that_any_method_has_are_listed_and_not_recorded_is_no_failure() {
        let mut content = content(&[("room", "sift", 6), ("room", "orb", 2)]);
        // Both were stopped, the second one later.
        content.results[0].pairs.drain(2..9);
        content.results[1].pairs.remove(9);
        let overview = Overview::new(&content.summaries);
        let value = |extent: &Extent| -> serde_json::Value {
            let text = data(&content, &overview, extent);
            serde_json::from_str(&text).expect("it is JSON")
        };
        let whole = value(&Extent::default());
        let listed = &whole["datasets"][0];
        assert_eq!(
            listed["a"],
            serde_json::json!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9])
        );
        assert_eq!(listed["left_out"], 0);
        let none = FAILURES.len();
        assert_eq!(whole["failures"][none], "not recorded");
        for protocol in 0..PROTOCOLS.len() {
            let reason = whole["reasons"][protocol][none].as_str();
            assert!(reason.is_some_and(|reason| reason.contains("has not failed")));
        }
        let failures = |method: usize| &listed["methods"][method]["failure"];
        assert_eq!(failures(0)[0], -1);
        for pair in 2..9 {
            assert_eq!(failures(0)[pair], none);
            assert_ne!(failures(1)[pair], none);
        }
        assert_eq!([&failures(0)[9], &failures(1)[9]], [1, none]);
        assert_eq!(listed["methods"][0]["rotation"][4], -1);
        // Half of the results of two methods.
        let half = value(&Extent {
            results: 10,
            ..Extent::default()
        });
        assert_eq!(half["datasets"][0]["a"].as_array().map(Vec::len), Some(5));
        assert_eq!(half["datasets"][0]["left_out"], 5);
    }
}
