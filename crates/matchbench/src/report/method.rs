//! The method section of a paper, written from what was run: Markdown with citations in pandoc's form
//! (`[@key]`), and LaTeX with `\cite`. The keys are those of `cite.bib`.

use std::fmt::Write as _;

use serde_json::Value;

use crate::counted::counted;
use crate::metrics::{Bootstrap, Model, Portion};
use crate::records::Plan;

use super::citations::{BENCHMARK, TOOL, citations};
use super::content::Content;
use super::latex;
use super::markdown;
use super::names::{defaults, references, title};
use super::words::{protocol_notes, protocols, when_pairs_fail};

/// A piece of text, or keys of papers.
enum Piece {
    Text(String),
    Cite(Vec<String>),
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
    let summaries = &content.summaries;
    let plan = content.plan();
    let planned = || plan.iter().flat_map(|plan| &plan.matchers);
    let mut pieces = Vec::new();
    let mut say = |text: String| pieces.push(Piece::Text(text));
    if summaries.is_empty() {
        say("Nothing was scored.".to_owned());
        return pieces;
    }
    let of = |model| summaries.iter().any(|summary| summary.model == model);
    let judged = match [Model::Pose, Model::Homography].map(of) {
        [true, true] => "the relative poses and homographies",
        [false, true] => "the homographies",
        [_, false] => "the relative poses",
    };
    say(format!(
        "Matchers are judged by {judged} they lead to, as in MatchBench"
    ));
    pieces.push(Piece::Cite(vec![BENCHMARK.to_owned()]));
    pieces.push(Piece::Text(format!(
        ", with matchbench {}",
        env!("CARGO_PKG_VERSION")
    )));
    pieces.push(Piece::Cite(vec![TOOL.to_owned()]));
    pieces.push(Piece::Text(format!(". The data are {}. ", data(content))));

    let mut matchers: Vec<&str> = Vec::new();
    let mut estimators: Vec<(&str, Vec<&str>)> = Vec::new();
    for summary in summaries {
        if !matchers.contains(&&*summary.matcher) {
            matchers.push(&summary.matcher);
        }
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
    pieces.push(Piece::Text("The matchers are ".to_owned()));
    for (i, matcher) in matchers.iter().enumerate() {
        let params = planned().map(|planned| (&*planned.id, &planned.params));
        let name = title(matcher) + &changed(params, matcher);
        push(
            &mut pieces,
            i,
            matchers.len(),
            name,
            &references(matcher, "")[..1],
        );
    }
    let of = |model| summaries.iter().any(|s| s.model == model);
    let estimated = match (of(Model::Pose), of(Model::Homography)) {
        (_, false) => "pose",
        (false, true) => "homography",
        (true, true) => "pose or homography",
    };
    pieces.push(Piece::Text(format!(". The {estimated} is estimated by ")));
    for (i, (estimator, its)) in estimators.iter().enumerate() {
        let mut name = if estimator.is_empty() {
            "an estimator that the results do not name".to_owned()
        } else {
            (*estimator).to_owned()
        };
        // Every matcher lists its own estimators; those with the same name have the same parameters everywhere.
        let params = planned().flat_map(|matcher| &matcher.estimators);
        name += &changed(params.map(|e| (&*e.id, &e.params)), estimator);
        if its.len() < matchers.len() {
            let its: Vec<String> = its.iter().map(|id| title(id)).collect();
            let _ = write!(name, " (for {})", its.join(", "));
        }
        push(
            &mut pieces,
            i,
            estimators.len(),
            name,
            &references("", estimator)[1..],
        );
    }
    pieces.push(Piece::Text(protocol(content, plan.as_ref())));
    pieces
}

/// Adds one of several names, with its papers.
fn push(pieces: &mut Vec<Piece>, i: usize, count: usize, name: String, papers: &[Option<&str>]) {
    let between = match i {
        0 => "",
        _ if i + 1 == count => " and ",
        _ => ", ",
    };
    pieces.push(Piece::Text(format!("{between}{name}")));
    let papers = papers.iter().copied().flatten().flat_map(citations);
    let keys: Vec<String> = papers.map(|paper| paper.key).collect();
    if !keys.is_empty() {
        pieces.push(Piece::Cite(keys));
    }
}

/// Datasets, pairs and sizes: `room (10 pairs of fragments, 640 × 480 pixels)`.
fn data(content: &Content) -> String {
    let mut names: Vec<String> = Vec::new();
    let mut seen: Vec<&str> = Vec::new();
    for summary in &content.summaries {
        if seen.contains(&&*summary.dataset) {
            continue;
        }
        seen.push(&summary.dataset);
        let pairs = counted(summary.pairs / summary.repetitions.max(1) as usize, "pair");
        let portion = match summary.portion {
            Portion::Fragments => " of fragments",
            Portion::Other => "",
        };
        let mut text = format!("{} ({pairs}{portion}", summary.dataset);
        let facts = content
            .datasets
            .iter()
            .find(|facts| facts.name == summary.dataset);
        if let Some((width, height)) = facts.and_then(|facts| facts.resolution) {
            let _ = write!(text, ", {width} × {height} pixels");
        }
        names.push(text + ")");
    }
    names.join(", ")
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

fn protocol(content: &Content, plan: Option<&Plan>) -> String {
    let bootstrap = Bootstrap::default();
    let repetitions = content
        .summaries
        .iter()
        .map(|s| s.repetitions)
        .max()
        .unwrap_or(1);
    let of = |model| content.summaries.iter().any(|s| s.model == model);
    let mut text = String::from(". ");
    if of(Model::Pose) {
        let _ = write!(
            text,
            "{} The pose error is the larger of the angles of rotation and of (signed) translation; SP(k) is the \
             share of pairs below k degrees, and the AUC is the mean of SP(1) to SP(15). ",
            when_pairs_fail(protocols(&content.summaries))
        );
    }
    if of(Model::Homography) {
        text.push_str(
            "The error of a homography is the mean distance at which it and the true one see the four corners \
             of the first image, and its AUC at k pixels the exact area under recall over this error up to k \
             pixels. ",
        );
    }
    let _ = write!(
        text,
        "Failed and missing pairs stay in every denominator. Intervals are {:.0} % percentile intervals \
         of {} bootstrap resamples of the reference images with all of their pairs; differences are paired.",
        bootstrap.level * 100.0,
        bootstrap.resamples
    );
    if repetitions > 1 {
        let _ = write!(
            text,
            " Every pair was run {repetitions} times with other random choices."
        );
    }
    if let Some(plan) = plan {
        let seed = plan.settings.seed;
        let _ = write!(text, " All random choices follow from the seed {seed}.");
    }
    text.push_str(" Parameters are the defaults of this version where none are named.");
    for note in protocol_notes(&content.summaries) {
        let _ = write!(text, " Where an estimator is called {note}.");
    }
    text
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
            "ransac-e (threshold\\_px = 3.0) (for SIFT, mine\\_2) [@nist",
            "rich (for GMS)",
            "the seed 7",
        ] {
            assert!(text.contains(said), "{said}: {text}");
        }
        let bib = super::super::citations::render(&content.summaries);
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
    fn names_are_plain_text() {
        let text = markdown(&content(&[("<b>@a\n*[x](y)", "sift", 6)]));
        assert!(
            text.contains("&lt;b&gt;\\@a \\*\\[x\\](y) (10 pairs"),
            "{text}"
        );
    }

    #[test]
    fn homographies_are_no_poses() {
        let mut content = content(&[("room", "sift", 6)]);
        content.summaries.push(homographies("room", "sift"));
        assert!(markdown(&content).contains("by the relative poses and homographies they lead to"));
        content.summaries.remove(0);
        assert!(markdown(&content).contains("by the homographies they lead to"));
    }

    #[test]
    fn without_results_nothing_is_claimed() {
        assert_eq!(markdown(&content(&[])), "Nothing was scored.\n");
    }
}
