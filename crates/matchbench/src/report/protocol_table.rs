//! Results in the scores of evaluation protocols of published benchmarks, in every table format: a row for each
//! set of results and protocol, what each protocol is, and where the run departed from it.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use crate::metrics::{ProtocolScore, ProtocolScores, SCORES, ScoreKind, under_protocols};
use crate::protocols;

use super::content::Content;
use super::numbers::{bracketed, score};
use super::score_words;
use super::{Format, csv, latex, markdown, table};

/// The scores as text, ending in a line end. Behind a score stands its standard deviation over repetitions.
pub fn render_protocols(format: Format, scores: &[ProtocolScores]) -> String {
    render_behind(format, scores, Behind::Deviation)
}

/// The same, with the 95 % interval behind each score instead: `0.456 [0.386, 0.528]`. `None` of formats that have both as
/// numbers.
pub fn render_protocols_with_intervals(
    format: Format,
    scores: &[ProtocolScores],
) -> Option<String> {
    match format {
        Format::Csv | Format::Json => None,
        Format::Table | Format::Markdown | Format::Latex => {
            Some(render_behind(format, scores, Behind::Interval))
        }
    }
}

/// What stands behind a score in tables for readers.
#[derive(Clone, Copy)]
enum Behind {
    Deviation,
    Interval,
}

fn render_behind(format: Format, scores: &[ProtocolScores], behind: Behind) -> String {
    match format {
        Format::Table => as_table(scores, behind),
        Format::Csv => as_csv(scores),
        Format::Json => {
            let text = serde_json::to_string_pretty(scores);
            text.expect("names and numbers can be written") + "\n"
        }
        Format::Markdown => as_markdown(scores, behind),
        Format::Latex => as_latex(scores, behind),
    }
}

/// The scores by the protocols that poses were estimated under, those of the paper apart; none where there are no others.
pub(super) fn scores_of(content: &Content) -> Vec<ProtocolScores> {
    let asked: Vec<_> = score_words::protocols(&content.summaries)
        .filter(|protocol| !protocol.is_ours())
        .collect();
    if asked.is_empty() {
        return Vec::new();
    }
    under_protocols(&content.results, content.plan().as_ref(), &asked)
}

/// The scores that any of the protocols has, in the order of the list.
fn kinds(scores: &[ProtocolScores]) -> Vec<&'static ScoreKind> {
    let ids: BTreeSet<&str> = (scores.iter())
        .flat_map(|one| one.scores.iter().map(|score| score.id))
        .collect();
    SCORES.iter().filter(|kind| ids.contains(kind.id)).collect()
}

const NAMES: [&str; 4] = ["dataset", "matcher", "estimator", "protocol"];

fn names(one: &ProtocolScores) -> [&str; 4] {
    [&one.dataset, &one.matcher, &one.estimator, one.protocol]
}

fn of(one: &ProtocolScores, kind: &ScoreKind) -> Option<ProtocolScore> {
    one.scores.iter().find(|score| score.id == kind.id).copied()
}

/// A score for readers; empty if the protocol has no such score.
fn cell(one: &ProtocolScores, kind: &ScoreKind, behind: Behind) -> String {
    let Some(found) = of(one, kind) else {
        return String::new();
    };
    let behind = match behind {
        Behind::Deviation => found.deviation.map_or_else(String::new, |deviation| {
            format!(" ± {}", score(kind.notation, deviation))
        }),
        Behind::Interval => bracketed(&found.score),
    };
    score(kind.notation, found.score.value) + &behind
}

/// The head and the rows of a table for readers.
fn cells(scores: &[ProtocolScores], behind: Behind) -> (Vec<String>, Vec<Vec<String>>) {
    let kinds = kinds(scores);
    let head = NAMES.into_iter().chain(["pairs", "failed"]);
    let head = head
        .chain(kinds.iter().map(|kind| kind.heading))
        .map(str::to_owned);
    let rows = scores.iter().map(|one| {
        let counts = [one.pairs, one.failed].map(|count| count.to_string());
        let values = kinds.iter().map(|kind| cell(one, kind, behind));
        let names = names(one).map(str::to_owned).into_iter();
        names.chain(counts).chain(values).collect()
    });
    (head.collect(), rows.collect())
}

/// The notes below a table, one per line: what its scores mean, what each protocol is, and where the run
/// departed from it.
fn notes(scores: &[ProtocolScores], behind: Behind) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut defined = None;
    for kind in kinds(scores) {
        match lines.last_mut() {
            Some(line) if defined == Some(kind.definition) => {
                let (heads, text) = line.split_once(": ").expect("written just now");
                *line = format!("{heads}, {}: {text}", kind.heading);
            }
            _ => lines.push(format!("{}: {}", kind.heading, kind.definition)),
        }
        defined = Some(kind.definition);
    }
    let any = |has: fn(&ProtocolScore) -> bool| {
        let mut all = scores.iter().flat_map(|one| &one.scores);
        all.any(has)
    };
    let meaning = match behind {
        Behind::Deviation => any(|score| score.deviation.is_some())
            .then_some("±: standard deviation over repetitions."),
        Behind::Interval => any(|score| score.score.interval.is_some())
            .then_some("[low, high]: 95 % interval over images."),
    };
    lines.extend(meaning.map(str::to_owned));
    let shown = |id: &str| scores.iter().any(|one| one.protocol == id);
    for protocol in protocols::PROTOCOLS
        .iter()
        .filter(|protocol| shown(protocol.id))
    {
        let words = protocol
            .in_words()
            .into_iter()
            .filter(|(what, _)| *what != "scores");
        let words: Vec<String> = words
            .map(|(what, how)| match what {
                "note" => how.trim_end_matches('.').to_owned(),
                what => format!("{what}: {how}"),
            })
            .collect();
        let (id, summary) = (protocol.id, protocol.summary);
        lines.push(format!("{id}: {summary}. {}.", words.join("; ")));
    }
    lines.extend(departures(scores));
    lines
}

/// Where the run departed from what protocols ask: a sentence for all methods with the same departures.
fn departures(scores: &[ProtocolScores]) -> Vec<String> {
    let method = |one: &ProtocolScores| crate::metrics::method(&one.matcher, &one.estimator);
    let mut said: Vec<(&str, String, Vec<String>)> = Vec::new();
    for one in scores.iter().filter(|one| !one.otherwise.is_empty()) {
        let (protocol, words, name) = (one.protocol, one.otherwise.join("; "), method(one));
        let known = said
            .iter_mut()
            .find(|(id, how, _)| *id == protocol && *how == words);
        match known {
            Some((.., methods)) if methods.contains(&name) => {}
            Some((.., methods)) => methods.push(name),
            None => said.push((protocol, words, vec![name])),
        }
    }
    let sentence = |(protocol, words, its): (&str, String, Vec<String>)| {
        let all: BTreeSet<String> = (scores.iter().filter(|one| one.protocol == protocol))
            .map(method)
            .collect();
        let (who, are) = match its.len() {
            1 => (its.concat(), "is"),
            many if many == all.len() => (format!("all {many} methods"), "are"),
            _ => (super::words::together(&its), "are"),
        };
        format!("{who} {are} not as {protocol} asks: {words}.")
    };
    said.into_iter().map(sentence).collect()
}

fn as_table(scores: &[ProtocolScores], behind: Behind) -> String {
    if scores.is_empty() {
        return "no results\n".to_owned();
    }
    let (head, rows) = cells(scores, behind);
    let mut text = table::aligned(&head, &rows, NAMES.len());
    for note in notes(scores, behind) {
        let _ = write!(text, "\n{}", table::printable(&note));
    }
    text + "\n"
}

fn as_markdown(scores: &[ProtocolScores], behind: Behind) -> String {
    if scores.is_empty() {
        return "No results.\n".to_owned();
    }
    let (head, rows) = cells(scores, behind);
    let mut text = String::new();
    markdown::rule_below(&mut text, &head, NAMES.len());
    for row in rows {
        let (names, numbers) = row.split_at(NAMES.len());
        let names = names.iter().map(|name| markdown::escape(name));
        markdown::line(&mut text, names.chain(numbers.iter().cloned()));
    }
    text.push('\n');
    for note in notes(scores, behind) {
        let _ = writeln!(text, "- {}", markdown::escape(&note));
    }
    text
}

fn as_latex(scores: &[ProtocolScores], behind: Behind) -> String {
    let (head, rows) = cells(scores, behind);
    let mut text = String::from("% Needs \\usepackage{booktabs}.\n");
    for note in notes(scores, behind) {
        let _ = writeln!(text, "% {}", note.replace(char::is_control, " "));
    }
    let numbers = head.len() - NAMES.len();
    let _ = writeln!(
        text,
        "\\begin{{tabular}}{{{}{}}}",
        "l".repeat(NAMES.len()),
        "r".repeat(numbers)
    );
    let line = |cells: &[String]| {
        let cells: Vec<String> = cells.iter().map(|cell| latex::escape(cell)).collect();
        format!("{} \\\\\n", cells.join(" & "))
    };
    let _ = write!(text, "\\toprule\n{}\\midrule\n", line(&head));
    for row in &rows {
        text.push_str(&line(row));
    }
    text + "\\bottomrule\n\\end{tabular}\n"
}

/// One row for each set and protocol; scores that a protocol does not have are empty.
fn as_csv(scores: &[ProtocolScores]) -> String {
    let kinds = kinds(scores);
    let mut text = NAMES.join(",") + ",pairs,failed";
    for kind in &kinds {
        let _ = write!(text, ",{0},{0}_low,{0}_high,{0}_deviation", kind.id);
    }
    text.push_str(",otherwise\n");
    for one in scores {
        let mut row: Vec<String> = names(one).map(csv::field).to_vec();
        row.extend([one.pairs, one.failed].map(|count| count.to_string()));
        for kind in &kinds {
            let found = of(one, kind);
            let interval = found.and_then(|found| found.score.interval);
            row.extend([
                csv::number(found.and_then(|found| found.score.value)),
                csv::number(interval.map(|interval| interval.low)),
                csv::number(interval.map(|interval| interval.high)),
                csv::number(found.and_then(|found| found.deviation)),
            ]);
        }
        row.push(csv::field(&one.otherwise.join("; ")));
        text += &(row.join(",") + "\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::tests::content;
    use super::*;
    use crate::metrics::under_protocols;
    use crate::protocols::{IMC, PROTOCOLS, SUPERGLUE};

    fn scores() -> Vec<ProtocolScores> {
        let results = content(&[("ro_om", "sift", 6), ("hall", "sift", 3)]).results;
        under_protocols(&results, None, PROTOCOLS)
    }

    #[test]
    fn every_form_has_every_row_and_takes_none() {
        let scores = scores();
        assert_eq!(scores.len(), 3 * PROTOCOLS.len());
        for format in Format::ALL {
            let text = render_protocols(format, &scores);
            assert!(
                text.ends_with('\n') && !text.ends_with("\n\n"),
                "{format:?}"
            );
            for protocol in PROTOCOLS {
                assert!(text.contains(protocol.id), "{format:?}: {text}");
            }
            assert!(render_protocols(format, &[]).ends_with('\n'));
        }
        let csv = render_protocols(Format::Csv, &scores);
        let columns = csv.lines().next().map(|line| line.split(',').count());
        assert_eq!(columns, Some(4 + 2 + 4 * 5 + 1));
    }

    #[test]
    fn intervals_stand_behind_the_scores_if_they_are_asked_for() {
        let scores = scores();
        let interval = scores[0].scores[0].score.interval.expect("eleven images");
        let shown = format!("0.600 [{:.3}, {:.3}]", interval.low, interval.high);
        for format in Format::ALL {
            let with = render_protocols_with_intervals(format, &scores);
            assert_eq!(with.is_none(), matches!(format, Format::Csv | Format::Json));
            let Some(with) = with else { continue };
            assert!(with.contains(&shown), "{with}");
            assert!(
                with.contains("95 % interval") || with.contains("95 \\% interval"),
                "{with}"
            );
            assert!(!render_protocols(format, &scores).contains(&shown));
        }
        // A mean over datasets has none.
        let mean = scores.last().expect("the means come last");
        assert_eq!(mean.dataset, "mean");
        assert!(mean.scores.iter().all(|one| one.score.interval.is_none()));
    }

    #[test]
    fn what_a_protocol_does_not_print_is_empty() {
        let results = content(&[("room", "sift", 6)]).results;
        let text = as_csv(&under_protocols(&results, None, &[&SUPERGLUE]));
        assert!(text.starts_with("dataset,matcher,estimator,protocol,pairs,failed,exact_auc_5,"));
        let text = as_table(&under_protocols(&results, None, &[&IMC]), Behind::Deviation);
        assert!(
            text.contains("mAA 10°: Mean share") && !text.contains("Exact AUC"),
            "{text}"
        );
        assert!(
            text.contains("sift + ransac-e is not as imc asks"),
            "{text}"
        );
        let results =
            content(&[("room", "sift", 6), ("room", "orb", 3), ("room", "gms", 3)]).results;
        let mut scores = under_protocols(&results, None, &[&IMC]);
        assert_eq!(departures(&scores).len(), 1);
        assert!(departures(&scores)[0].starts_with("all 3 methods are not as imc asks: "));
        scores[0].otherwise.push("more".to_owned());
        let text = departures(&scores);
        assert!(
            text[0].starts_with("sift + ransac-e is not as imc asks: "),
            "{text:?}"
        );
        assert!(text[1].starts_with("orb + ransac-e and gms + ransac-e are not as imc asks: "));
        let text = as_latex(&self::scores(), Behind::Deviation);
        assert!(
            text.contains("ro\\_om") && !text.contains("ro_om"),
            "{text}"
        );
    }
}
