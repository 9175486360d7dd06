//! The method section of a paper, written from what was run: Markdown with citations in pandoc's form
//! (`[@key]`), and LaTeX with `\cite`. The keys are those of `cite.bib`.

use std::fmt::Write as _;

use serde_json::Value;

use crate::counted::counted;
use crate::metrics::{Model, Portion, Summary};
use crate::records::{MatcherPlan, Plan};

use super::citations::{BENCHMARK, CORNER_AUC, CORNER_ERROR, INTERVALS, TOOL, citations};
use super::command_line::Origin;
use super::content::{Content, THIS_VERSION, TUNED};
use super::dataset_facts::DatasetFacts;
use super::latex;
use super::markdown;
use super::names::{defaults, references, title};
use super::pair_words::{when_pairs_fail, when_rows_fail};
use super::score_words::{protocol_notes, protocols};

/// A piece of text, or keys of papers.
enum Piece {
    Text(String),
    Cite(Vec<String>),
}

/// The paragraph while it is written.
#[derive(Default)]
struct Paragraph {
    pieces: Vec<Piece>,
}

impl Paragraph {
    fn say(&mut self, text: impl Into<String>) {
        self.pieces.push(Piece::Text(text.into()));
    }

    fn cite_key(&mut self, key: &str) {
        self.pieces.push(Piece::Cite(vec![key.to_owned()]));
    }

    /// Cites papers, and says first what those have to do with it that are not the method itself.
    fn cite<'p>(&mut self, papers: impl IntoIterator<Item = &'p str>) {
        let (others, own): (Vec<_>, Vec<_>) = (papers.into_iter())
            .flat_map(citations)
            .partition(|paper| paper.role.is_some());
        for other in others {
            self.say(format!(" ({}", other.role.unwrap_or_default()));
            self.cite_key(&other.key);
            self.say(")");
        }
        if !own.is_empty() {
            let keys = own.into_iter().map(|paper| paper.key);
            self.pieces.push(Piece::Cite(keys.collect()));
        }
    }

    /// Lists names, each with its papers.
    fn list(&mut self, names: Vec<(String, Vec<&str>)>) {
        let count = names.len();
        for (i, (name, papers)) in names.into_iter().enumerate() {
            let between = match i {
                0 => "",
                _ if i + 1 == count => " and ",
                _ => ", ",
            };
            self.say(format!("{between}{name}"));
            self.cite(papers);
        }
    }
}

/// The paragraph as Markdown.
pub(super) fn markdown(content: &Content) -> String {
    let piece = |piece: &Piece| match piece {
        // An @ would begin a citation.
        Piece::Text(text) => markdown::escape(text).replace('@', "\\@"),
        Piece::Cite(keys) => {
            let keys: Vec<String> = keys.iter().map(|key| format!("@{key}")).collect();
            format!(" [{}]", keys.join("; "))
        }
    };
    pieces(content).iter().map(piece).collect::<String>() + "\n"
}

/// The paragraph as plain text, to be read on a page.
pub(super) fn plain(content: &Content) -> String {
    let piece = |piece: &Piece| match piece {
        Piece::Text(text) => text.clone(),
        Piece::Cite(keys) => format!(" [{}]", keys.join("; ")),
    };
    pieces(content).iter().map(piece).collect()
}

/// The paragraph as LaTeX.
pub(super) fn latex(content: &Content) -> String {
    let piece = |piece: &Piece| match piece {
        Piece::Text(text) => latex::escape(text),
        Piece::Cite(keys) => format!("~\\cite{{{}}}", keys.join(",")),
    };
    pieces(content).iter().map(piece).collect::<String>() + "\n"
}

fn pieces(content: &Content) -> Vec<Piece> {
    let mut paragraph = Paragraph::default();
    if content.summaries.is_empty() {
        paragraph.say("Nothing was scored.");
        return paragraph.pieces;
    }
    let plan = content.plan();
    task(content, &mut paragraph);
    paragraph.say(". The data are ");
    data(content, &mut paragraph);
    paragraph.say(". The matchers are ");
    paragraph.list(matchers(content, plan.as_ref()));
    let of = |model| content.summaries.iter().any(|s| s.model == model);
    let estimated = match (of(Model::Pose), of(Model::Homography)) {
        (_, false) => "pose",
        (false, true) => "homography",
        (true, true) => "pose or homography",
    };
    paragraph.say(format!(". The {estimated} is estimated by "));
    paragraph.list(estimators(content, plan.as_ref()));
    paragraph.say(". ");
    scores(content, plan.as_ref(), &mut paragraph);
    random_choices(content, plan.as_ref(), &mut paragraph);
    paragraph.pieces
}

/// By what matchers are judged, and with which program.
fn task(content: &Content, paragraph: &mut Paragraph) {
    let of = |model| content.summaries.iter().any(|s| s.model == model);
    paragraph.say("Matchers are judged by ");
    // The paper of the benchmark has no homographies.
    if of(Model::Pose) {
        paragraph.say("the relative poses they lead to, as in MatchBench");
        paragraph.cite_key(BENCHMARK);
    }
    let homographies = match [Model::Pose, Model::Homography].map(of) {
        [true, true] => ", and by the homographies they lead to",
        [false, true] => "the homographies they lead to",
        [_, false] => "",
    };
    let version = content.version();
    paragraph.say(format!("{homographies}, with matchbench {version}"));
    paragraph.cite_key(TOOL);
}

/// The matchers, with their parameters and papers.
fn matchers<'c>(content: &'c Content, plan: Option<&Plan>) -> Vec<(String, Vec<&'c str>)> {
    let planned = || plan.into_iter().flat_map(|plan| &plan.matchers);
    let named = |matcher: &&'c str| {
        let params = planned().map(|planned| (&*planned.id, &planned.params));
        let outside = planned().find(|planned| planned.id == **matcher);
        let outside = outside.and_then(from_outside);
        let name = title(matcher) + &outside.unwrap_or_else(|| changed(params, matcher));
        let [of_matcher, ..] = references(matcher, "");
        (name, of_matcher.into_iter().collect())
    };
    names_of(content).iter().map(named).collect()
}

/// The estimators, each with its parameters and papers, and with its matchers where these are not all.
fn estimators<'c>(content: &'c Content, plan: Option<&Plan>) -> Vec<(String, Vec<&'c str>)> {
    let planned = || plan.into_iter().flat_map(|plan| &plan.matchers);
    let mut estimators: Vec<(&str, Vec<&str>)> = Vec::new();
    for summary in &content.summaries {
        let at = estimators
            .iter()
            .position(|(id, _)| *id == summary.estimator);
        let at = at.unwrap_or_else(|| {
            estimators.push((&summary.estimator, Vec::new()));
            estimators.len() - 1
        });
        if !estimators[at].1.contains(&&*summary.matcher) {
            estimators[at].1.push(&summary.matcher);
        }
    }
    let all = names_of(content).len();
    let named = |(estimator, its): (&'c str, Vec<&str>)| {
        let mut name = if estimator.is_empty() {
            "an estimator that the results do not name".to_owned()
        } else {
            estimator.to_owned()
        };
        // Every matcher lists its own estimators; those with the same name have the same parameters everywhere.
        let params = planned().flat_map(|matcher| &matcher.estimators);
        name += &changed(params.map(|e| (&*e.id, &e.params)), estimator);
        if its.len() < all {
            let its: Vec<String> = its.iter().map(|id| title(id)).collect();
            let _ = write!(name, " (for {})", its.join(", "));
        }
        let [_, papers @ ..] = references("", estimator);
        (name, papers.into_iter().flatten().collect())
    };
    estimators.into_iter().map(named).collect()
}

/// The matchers that were scored, each once.
fn names_of(content: &Content) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for summary in &content.summaries {
        if !names.contains(&&*summary.matcher) {
            names.push(&summary.matcher);
        }
    }
    names
}

/// Where the matches of a planned matcher come from, if it is not built in: ` (from outside: NAME 1.2)`.
fn from_outside(matcher: &MatcherPlan) -> Option<String> {
    let (source, mut facts) = match Origin::of(matcher) {
        Origin::Native => return None,
        // A plan that does not say how a built-in matcher gets its features.
        _ if defaults(&matcher.id).is_some() => return None,
        Origin::Files => ("from files", Vec::new()),
        Origin::Outside => ("from outside", matcher.version.iter().cloned().collect()),
        Origin::Python => (
            "written in Python",
            matcher.version.iter().cloned().collect(),
        ),
    };
    if matches!(Origin::of(matcher), Origin::Outside | Origin::Python) {
        differences("", &matcher.params, &Value::Null, &mut facts);
    }
    let files = matcher.params.get("datasets").and_then(Value::as_array);
    for files in files.into_iter().flatten() {
        let format = files["format"].as_str().map(str::to_owned);
        let notes = files["notes"].as_object().into_iter().flatten();
        let notes = notes.filter_map(|(key, value)| Some(format!("{key} = {}", value.as_str()?)));
        for fact in format.into_iter().chain(notes) {
            if !facts.contains(&fact) {
                facts.push(fact);
            }
        }
    }
    Some(match facts.len() {
        0 => format!(" ({source})"),
        _ => format!(" ({source}: {})", facts.join(", ")),
    })
}

/// Datasets, pairs and sizes, with the papers of their sources:
/// `room (10 of 435 pairs of fragments, 640 × 480 pixels) [...]`.
fn data(content: &Content, paragraph: &mut Paragraph) {
    let mut seen: Vec<&str> = Vec::new();
    for summary in &content.summaries {
        if seen.contains(&&*summary.dataset) {
            continue;
        }
        let between = if seen.is_empty() { "" } else { ", " };
        seen.push(&summary.dataset);
        let facts = content
            .datasets
            .iter()
            .find(|facts| facts.name == summary.dataset);
        let scored = content.scored_pairs(&summary.dataset).unwrap_or_default();
        let pairs = match facts {
            Some(facts) if facts.pairs != scored => {
                format!("{scored} of {}", counted(facts.pairs, "pair"))
            }
            _ => counted(scored, "pair"),
        };
        let portion = match summary.portion {
            Portion::Fragments => " of fragments",
            Portion::Other => "",
        };
        let mut text = format!("{between}{} ({pairs}{portion}", summary.dataset);
        if let Some((width, height)) = facts.and_then(|facts| facts.resolution) {
            let _ = write!(text, ", {width} × {height} pixels");
        }
        paragraph.say(text + ")");
        paragraph.cite(facts.and_then(DatasetFacts::reference));
    }
}

/// Parameters of the plan that are not the defaults: ` (ratio = 0.7)`.
fn changed<'p>(mut planned: impl Iterator<Item = (&'p str, &'p Value)>, id: &str) -> String {
    let Some(defaults) = defaults(id) else {
        return String::new();
    };
    let mut found = Vec::new();
    if let Some((_, params)) = planned.find(|(other, _)| *other == id) {
        differences("", params, &defaults, &mut found);
    }
    match found.len() {
        0 => String::new(),
        _ => format!(" ({})", found.join(", ")),
    }
}

fn differences(path: &str, value: &Value, default: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let path = match path {
                    "" => name.clone(),
                    _ => format!("{path}.{name}"),
                };
                differences(&path, value, &default[name], found);
            }
        }
        value if value != default => found.push(format!("{path} = {value}")),
        _ => {}
    }
}

/// What is scored, and how certain scores are.
fn scores(content: &Content, plan: Option<&Plan>, paragraph: &mut Paragraph) {
    let of = |model| content.summaries.iter().any(|s| s.model == model);
    if of(Model::Pose) {
        let protocols = protocols(&content.summaries);
        paragraph.say(format!(
            "{} The pose error is the larger of the angles of rotation and of (signed) translation; SP(k) is the \
             share of pairs below k degrees, and the AUC is the mean of SP(1) to SP(15). ",
            match plan {
                Some(_) => when_pairs_fail(protocols),
                None => when_rows_fail(protocols),
            }
        ));
    }
    if of(Model::Homography) {
        paragraph.say(
            "The error of a homography is the mean distance at which it and the true one see the four corners \
             of the first image",
        );
        paragraph.cite([CORNER_ERROR]);
        paragraph.say(
            ", and its AUC at k pixels the exact area under recall over this error up to k pixels",
        );
        paragraph.cite([CORNER_AUC]);
        paragraph.say(". ");
    }
    match &content.lacking {
        None => paragraph.say("Failed and missing pairs stay in every denominator."),
        Some(lacking) => paragraph.say(format!(
            "Failed pairs stay in every denominator, but the run is not finished: {}. Scores are of what each method \
             has recorded.",
            lacking.extent()
        )),
    }
    let has_interval = |summary: &Summary| summary.auc().interval.is_some();
    if content.summaries.iter().any(has_interval) {
        paragraph.say(
            " Intervals are 95 % intervals of Student's t, whose variance takes pairs that share an image as dependent",
        );
        paragraph.cite([INTERVALS]);
        paragraph.say("; differences are paired.");
    }
}

/// Repetitions, seed, time of estimators, and where parameters come from.
fn random_choices(content: &Content, plan: Option<&Plan>, paragraph: &mut Paragraph) {
    let repetitions = content.summaries.iter().map(|s| s.repetitions).max();
    if let Some(repetitions) = repetitions.filter(|&repetitions| repetitions > 1) {
        paragraph.say(format!(
            " Every pair was run {repetitions} times with other random choices."
        ));
    }
    if let Some(plan) = plan {
        let seed = plan.settings.seed;
        paragraph.say(format!(" All random choices follow from the seed {seed}."));
        if let Some(most) = plan.settings.time_budget_ms {
            paragraph.say(format!(
                " Estimators drew samples for at most {most} ms on each pair, so results depend on the machine."
            ));
        }
    }
    // The plan has every parameter. Those are named that the program which writes this would choose otherwise. Of
    // results of other programs none is known.
    if let Some(plan) = plan {
        let whose = match &*plan.version {
            THIS_VERSION => "this version".to_owned(),
            _ => format!("matchbench {THIS_VERSION}"),
        };
        paragraph.say(format!(
            " Parameters are the defaults of {whose} where none are named."
        ));
    }
    for (name, fact) in &content.facts.facts {
        if name == TUNED {
            paragraph.say(format!(" {fact}."));
        }
    }
    for note in protocol_notes(&content.summaries) {
        paragraph.say(format!(" Where an estimator is called {note}."));
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{content, homographies};
    use super::*;

    #[test]
    fn what_was_run_is_said_and_cited() {
        let mut content = content(&[
            ("room", "sift", 6),
            ("room", "gms", 9),
            ("room", "mine_2", 1),
        ]);
        content.summaries[1].estimator = "rich".into();
        content.facts.plan = Some(
            r#"{"version": "0.1.0", "settings": {"seed": 7, "repetitions": 1, "limit": null}, "datasets": [],
                "matchers": [{"id": "sift", "params": {"ratio": 0.7},
                "estimators": [{"id": "ransac-e", "params": {"threshold_px": 3.0}}]}]}"#
                .into(),
        );
        let text = markdown(&content);
        for said in [
            "with matchbench ",
            "room (10 pairs)",
            "SIFT (ratio = 0.7) [@lowe2004",
            "GMS [@bian2017gms] and mine\\_2.",
            "ransac-e (threshold\\_px = 3.0) (for SIFT, mine\\_2) [@nister2004efficient",
            "rich (for GMS) (our substitute for the unpublished estimator of [@lin2016repmatch]) [@lebeda2012fixing]",
            "the seed 7",
        ] {
            assert!(text.contains(said), "{said}: {text}");
        }
        let bib = super::super::citations::render(&content);
        for key in text.split('@').skip(1) {
            let key = key.split([';', ']']).next().expect("a key");
            assert!(bib.contains(&format!("{{{key},")), "{key}");
        }
        let text = latex(&content);
        assert!(
            text.contains("GMS~\\cite{bian2017gms} and mine\\_2"),
            "{text}"
        );
    }

    #[test]
    fn what_results_depend_on_beside_parameters_is_said() {
        let mut content = content(&[("room", "sift", 6)]);
        let said = [
            "for at most 20 ms on each pair",
            "was chosen on hall, among 1, 2.",
        ];
        let plan = |settings: &str| {
            format!(
                r#"{{"version": "0.1.0", "settings": {settings}, "datasets": [], "matchers": []}}"#
            )
        };
        content.facts.plan = Some(plan(r#"{"seed": 7, "repetitions": 1, "limit": null}"#));
        let text = plain(&content);
        assert!(said.iter().all(|said| !text.contains(said)), "{text}");
        let limited = r#"{"seed": 7, "repetitions": 1, "limit": null, "time_budget_ms": 20}"#;
        content.facts.plan = Some(plan(limited));
        let chosen = "best.threshold_px=2 was chosen on hall, among 1, 2".to_owned();
        content.facts.facts = vec![("seed".into(), "7".into()), (TUNED.into(), chosen)];
        let text = plain(&content);
        assert!(said.iter().all(|said| text.contains(said)), "{text}");
    }

    #[test]
    fn the_version_is_that_of_the_run() {
        let mut content = content(&[("room", "sift", 6)]);
        let bib = super::super::citations::render;
        let said = |version: &str| format!("with matchbench {version} [@{TOOL}]");
        let noted = |version: &str| format!("note = {{Version {version}}}");
        assert!(markdown(&content).contains(&said(THIS_VERSION)));
        assert!(bib(&content).contains(&noted(THIS_VERSION)));
        let settings = r#"{"seed": 7, "repetitions": 1, "limit": null}"#;
        content.facts.plan = Some(format!(
            r#"{{"version": "0.0.9}}", "settings": {settings}, "datasets": [], "matchers": []}}"#
        ));
        let text = markdown(&content);
        assert!(text.contains(&said("0.0.9}")), "{text}");
        // Those are left out that this program has as defaults.
        let defaults = format!("defaults of matchbench {THIS_VERSION} where none");
        assert!(text.contains(&defaults), "{text}");
        assert!(bib(&content).contains(&noted("0.0.9")));
    }

    #[test]
    fn of_results_of_other_programs_only_is_said_what_is_known() {
        let mut content = content(&[("room", "sift", 6)]);
        let text = plain(&content);
        let row = "A row without a pose, or with fewer than 10 matches in front of both cameras, counts as failed. The pose error";
        assert!(text.contains(row), "{text}");
        let of_a_run = ["selected match", "Parameters are the defaults"];
        assert!(of_a_run.iter().all(|said| !text.contains(said)), "{text}");
        content.facts.plan = Some(
            r#"{"version": "0.1.0", "settings": {"seed": 7, "repetitions": 1, "limit": null}, "datasets": [], "matchers": []}"#
                .into(),
        );
        let text = plain(&content);
        assert!(
            of_a_run.iter().all(|said| text.contains(said)) && !text.contains(row),
            "{text}"
        );
    }

    #[test]
    fn names_are_plain_text() {
        let text = markdown(&content(&[("<b>@a\n*[x](y)", "sift", 6)]));
        assert!(
            text.contains("&lt;b&gt;\\@a \\*\\[x\\](y) (10 pairs"),
            "{text}"
        );
    }

    #[test]
    fn homographies_are_no_poses_and_not_of_the_paper() {
        let mut content = content(&[("room", "sift", 6)]);
        let error = "see the four corners of the first image [@detone2018superpoint], and its AUC";
        assert!(!markdown(&content).contains(error));
        content.summaries.push(homographies("room", "sift"));
        let both = "by the relative poses they lead to, as in MatchBench [@matchbench-paper], and by the homographies \
                    they lead to, with matchbench ";
        let text = markdown(&content);
        assert!(text.contains(both) && text.contains(error), "{text}");
        content.summaries.remove(0);
        let text = markdown(&content);
        assert!(text.starts_with("Matchers are judged by the homographies they lead to, with"));
        assert!(
            text.contains(error) && text.contains("up to k pixels [@sarlin2020superglue]. Failed")
        );
        assert!(!text.contains("MatchBench"), "{text}");
    }

    #[test]
    fn sources_of_data_and_of_matches_are_named() {
        let mut content = content(&[("room", "loma", 6), ("room", "mine", 9)]);
        content.datasets = vec![DatasetFacts {
            name: "room".into(),
            portion: Portion::Other,
            frames: 30,
            pairs: 435,
            resolution: None,
            origin: "Strecha et al. 2008, castle; pairs all".into(),
            property: String::new(),
            import: Vec::new(),
            thumbnail: None,
        }];
        let plan = serde_json::json!({
            "version": "0.1.0", "settings": {"seed": 7, "repetitions": 1, "limit": null}, "datasets": [],
            "matchers": [
                {"id": "loma", "params": {"datasets": [
                    {"name": "room", "format": "npz", "notes": {"model": "LoMa 1.1"}},
                    {"name": "hall", "format": "npz", "notes": {"model": "LoMa 1.1"}},
                ]}, "estimators": []},
                {"id": "mine", "version": "mine 2.1", "params": {"size": 1024}, "estimators": []},
            ],
        });
        content.facts.plan = Some(plan.to_string());
        let text = plain(&content);
        for said in [
            "The data are room (10 of 435 pairs) [strecha2008benchmarking]. ",
            "loma (from files: npz, model = LoMa 1.1) and mine (from outside: mine 2.1, size = 1024).",
        ] {
            assert!(text.contains(said), "{said}: {text}");
        }
        let bib = super::super::citations::render(&content);
        assert!(
            bib.contains("@inproceedings{strecha2008benchmarking,"),
            "{bib}"
        );
    }

    #[test]
    fn without_results_nothing_is_claimed() {
        assert_eq!(markdown(&content(&[])), "Nothing was scored.\n");
    }
}
