//! The result of a pair, in words.

use std::collections::BTreeSet;

use super::numbers::fixed;
use crate::counted::counted;
use crate::metrics::{
    Angle, Detail, Deviation, Difference, Failure, Interval, Lead, Model, PairResult, ScoreKind,
    Summary,
};
use crate::protocols::{PROTOCOLS, Protocol};

/// The result in a word or two, for tables.
pub(super) fn outcome(pair: &PairResult) -> &'static str {
    match pair.outcome {
        Ok(Deviation::Pose(_) | Deviation::Larger(_)) => "pose",
        Ok(Deviation::Corners(_)) => "homography",
        Err(failure) => name(failure),
    }
}

/// All failures, in the order of their numbers in the page.
pub(super) const FAILURES: [Failure; 5] = [
    Failure::TooFewMatches,
    Failure::NoSupport,
    Failure::Broken,
    Failure::Unexplained,
    Failure::Missing,
];

/// A failure in a word or two.
pub(super) fn name(failure: Failure) -> &'static str {
    match failure {
        Failure::TooFewMatches => "too few matches",
        Failure::NoSupport => "no support",
        Failure::Broken => "broken",
        Failure::Unexplained => "unexplained",
        Failure::Missing => "missing",
    }
}

/// A failure in a sentence, under the protocol by which the pose was estimated.
pub(super) fn reason(failure: Failure, protocol: &Protocol) -> String {
    match failure {
        Failure::TooFewMatches => format!(
            "Too few selected matches: at least {} are needed for a pose, 4 for a homography.",
            protocol.min_matches
        ),
        Failure::NoSupport => {
            let in_front = format!("at least {} must lie in front of both cameras", protocol.min_support);
            let least = match protocol.min_inliers {
                0 => in_front,
                inliers => format!("it must have at least {}, and {in_front}", counted(inliers, "inlier")),
            };
            format!("No estimate that enough matches agree with: for a pose {least}.")
        }
        Failure::Broken => {
            "A stage broke: an image that cannot be read, an error of the matcher, or a pair that files of matches do not \
             have. The record says which."
                .into()
        }
        Failure::Unexplained => "No estimate, and the results do not say why.".into(),
        Failure::Missing => "The dataset lists this pair, but the results do not have it.".into(),
    }
}

/// When a pair fails for want of matches, a sentence for each of these protocols.
pub(super) fn when_pairs_fail<'p>(protocols: impl IntoIterator<Item = &'p Protocol>) -> String {
    let sentence = |protocol: &Protocol| {
        let pair = if protocol.is_ours() {
            "A pair".to_owned()
        } else {
            format!("With the protocol {} a pair", protocol.id)
        };
        let inliers = match protocol.min_inliers {
            0 => String::new(),
            inliers => format!("fewer than {}, ", counted(inliers, "inlier")),
        };
        format!(
            "{pair} fails with fewer than {}, {inliers}or fewer than {} in front of both cameras.",
            counted(protocol.min_matches, "selected match"),
            protocol.min_support
        )
    };
    let sentences: Vec<String> = protocols.into_iter().map(sentence).collect();
    sentences.join(" ")
}

/// The number of correspondences, after a comma, if it is known.
fn correspondences(pair: &PairResult) -> String {
    (pair.correspondences).map_or_else(String::new, |number| {
        format!(", {}", counted(number, "correspondence"))
    })
}

/// The result of a pair in a sentence, under the protocol by which its pose was estimated.
pub fn sentence(pair: &PairResult, protocol: &Protocol) -> String {
    match (&pair.outcome, pair.error(Angle::Pose)) {
        (Err(failure), _) => reason(*failure, protocol),
        (Ok(Deviation::Corners(Some(error))), _) => {
            format!("corners off by {error:.2} px{}", correspondences(pair))
        }
        (Ok(Deviation::Corners(None)), _) => "a corner goes to infinity".to_owned(),
        (Ok(Deviation::Larger(error)), _) => format!("pose off by {error:.2}°"),
        (Ok(Deviation::Pose(error)), None) => {
            format!("rotation off by {:.2}°; no true direction", error.rotation)
        }
        (Ok(Deviation::Pose(error)), Some(pose)) => {
            let stated = (pair.confidence)
                .map(|probability| format!(", right with probability {probability:.2}"))
                .unwrap_or_default();
            let no_overlap = (pair.overlap_probability)
                .filter(|_| pair.has_no_overlap())
                .map(|probability| {
                    format!("; no overlap seen (probability of one {probability:.2})")
                })
                .unwrap_or_default();
            format!(
                "pose off by {pose:.2}° (rotation {:.2}°, translation {:.2}°){}{stated}{no_overlap}",
                error.rotation,
                error.translation.unwrap_or(f64::NAN),
                correspondences(pair)
            )
        }
    }
}

/// The definitions of the `shown` scores in a table of this detail: the column heads that share a definition,
/// and the definition.
pub(super) fn definitions(
    shown: &[&'static ScoreKind],
    detail: Detail,
) -> Vec<(String, &'static str)> {
    let mut definitions: Vec<(String, &'static str)> = Vec::new();
    for kind in shown.iter().filter(|kind| kind.detail <= detail) {
        match definitions.last_mut() {
            Some((heads, text)) if *text == kind.definition => {
                heads.push_str(", ");
                heads.push_str(kind.heading);
            }
            _ => definitions.push((kind.heading.to_owned(), kind.definition)),
        }
    }
    definitions
}

/// The protocols under which poses were estimated, in the order of [`PROTOCOLS`].
pub(super) fn protocols(summaries: &[Summary]) -> impl Iterator<Item = &'static Protocol> {
    let of =
        |model: Model, id: &str| (summaries.iter()).any(|s| s.model == model && s.protocol == id);
    (PROTOCOLS.iter().copied()).filter(move |protocol| of(Model::Pose, protocol.id))
}

/// What the names of estimators under a protocol mean, one sentence per protocol.
pub(super) fn protocol_notes(summaries: &[Summary]) -> Vec<String> {
    protocols(summaries)
        .filter(|protocol| !protocol.is_ours())
        .map(|protocol| {
            let (id, summary) = (protocol.id, protocol.summary);
            format!(
                "@{id}: poses are estimated by the protocol {id} ({summary}); its own scores: matchbench eval RUN \
                 --protocol {id}"
            )
        })
        .collect()
}

/// Names in a sentence: `a`, `a and b`, `a, b and c`.
pub(super) fn together(names: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => names.concat(),
    }
}

/// A matcher with its estimator, if that is known.
pub(super) fn method(matcher: &str, estimator: &str) -> String {
    if estimator.is_empty() {
        matcher.to_owned()
    } else {
        format!("{matcher} + {estimator}")
    }
}

/// A sentence: which of two is better `on` what, by how much, and whether that is significant. The difference
/// is the score of `one` minus that of `other`, with its paired interval.
pub fn advantage(one: &str, other: &str, on: &str, difference: &Difference) -> String {
    let Some(value) = difference.value else {
        return format!("{one} and {other} have no pairs in common on {on}");
    };
    let (ahead, behind) = if value < 0.0 {
        (other, one)
    } else {
        (one, other)
    };
    if difference.is_zero() {
        let same = format!("{one} and {other} score the same on {on}");
        let moved = (difference.interval).filter(|interval| interval.low != interval.high);
        return match moved {
            Some(Interval { low, high }) => {
                format!(
                    "{same}: {} [{}, {}]",
                    fixed(value, 3),
                    fixed(low, 3),
                    fixed(high, 3)
                )
            }
            None => same,
        };
    }
    let Some(interval) = difference.interval else {
        return format!(
            "{ahead} is ahead of {behind} on {on} by {:.3}; there is no interval with {}",
            value.abs(),
            units(difference.images)
        );
    };
    let (low, high) = if value < 0.0 {
        (-interval.high, -interval.low)
    } else {
        (interval.low, interval.high)
    };
    let range = format!(
        "{} [{}, {}]",
        fixed(value.abs(), 3),
        fixed(low, 3),
        fixed(high, 3)
    );
    match difference.together {
        None if difference.is_certain => {
            format!("{ahead} beats {behind} on {on} by {range}, for this comparison alone")
        }
        Some(_) if difference.is_certain => format!("{ahead} beats {behind} on {on} by {range}"),
        Some(all @ 2..) if difference.leaves_out_zero() => {
            format!(
                "{ahead} is ahead of {behind} on {on} by {range}, not certain among {all} comparisons"
            )
        }
        _ => format!("{ahead} is not certainly better than {behind} on {on}: {range}"),
    }
}

/// What there must be enough of for an interval, so many of them; see [`MIN_IMAGES`](crate::metrics::MIN_IMAGES).
pub fn units(count: usize) -> String {
    match count {
        1 => "1 image that is in several pairs, or pair that shares no image".to_owned(),
        _ => format!("{count} images that are in several pairs, or pairs that share no image"),
    }
}

/// The leads of each dataset, in their order, with its name. If a dataset has both poses and homographies, they
/// are separate, and the name says which.
pub(super) fn rounds(leads: &[Lead]) -> Vec<(String, Vec<&Lead>)> {
    let key = |lead: &Lead| (lead.dataset.clone(), lead.model);
    let mut seen = BTreeSet::new();
    let firsts = leads.iter().filter(|lead| seen.insert(key(lead)));
    let round = |first: &Lead| {
        let dataset = &first.dataset;
        let here = || leads.iter().filter(|lead| lead.dataset == *dataset);
        let own: Vec<&Lead> = here().filter(|lead| lead.model == first.model).collect();
        let name = match first.model {
            _ if own.len() == here().count() => dataset.clone(),
            Model::Pose => format!("{dataset} (poses)"),
            Model::Homography => format!("{dataset} (homographies)"),
        };
        (name, own)
    };
    firsts.map(round).collect()
}

/// The best method of each dataset compared with the others, the nearest first, one sentence per line. If there
/// are more than a dozen for a dataset, the rest are summed up in one sentence.
pub fn leads_in_words(leads: &[Lead]) -> String {
    let mut text = String::new();
    for (dataset, mut leads) in rounds(leads) {
        let dataset = &*dataset;
        let behind = |lead: &Lead| lead.difference.value.unwrap_or(f64::INFINITY);
        leads.sort_by(|one, other| behind(one).total_cmp(&behind(other)));
        for lead in leads.iter().take(SENTENCES) {
            let [best, other] = [&lead.best, &lead.other].map(|(m, e)| method(m, e));
            text.push_str(&advantage(&best, &other, dataset, &lead.difference));
            text.push('\n');
        }
        if let Some(next) = leads.get(SENTENCES) {
            let (matcher, estimator) = &next.best;
            let (best, others) = (method(matcher, estimator), leads.len() - SENTENCES);
            let lead = behind(next);
            let rest = if next.difference.is_zero() {
                format!("{best} is level with the other {others} on {dataset}, or ahead of them\n")
            } else {
                format!(
                    "{best} is ahead of the other {others} on {dataset} by {} and more\n",
                    fixed(lead, 3)
                )
            };
            text.push_str(&rest);
        }
    }
    text.replace(|c: char| c.is_control() && c != '\n', "\u{fffd}")
}

/// Most sentences about one dataset. A run of all matchers with all estimators would fill pages.
const SENTENCES: usize = 12;

#[cfg(test)]
mod tests {
    use crate::metrics::SCORES;
    use crate::protocols::of_estimator;

    use super::*;

    #[test]
    fn every_score_that_is_shown_is_defined_once() {
        let all: Vec<&ScoreKind> = SCORES.iter().collect();
        for detail in [Detail::Glance, Detail::Complete] {
            let heads: Vec<String> = (definitions(&all, detail).into_iter())
                .flat_map(|(heads, _)| heads.split(", ").map(str::to_owned).collect::<Vec<_>>())
                .collect();
            let shown = SCORES.iter().filter(|kind| kind.detail <= detail);
            assert_eq!(heads, shown.map(|kind| kind.heading).collect::<Vec<_>>());
        }
        assert!(definitions(&all, Detail::Complete).len() < SCORES.len());
    }

    #[test]
    fn the_same_failure_has_one_name_everywhere() {
        for failure in FAILURES {
            let pair = PairResult::failed(0, 1, failure);
            assert_eq!(outcome(&pair), name(failure));
            let protocol = of_estimator("best");
            assert_eq!(sentence(&pair, protocol), reason(failure, protocol));
        }
    }

    #[test]
    fn reasons_name_what_the_protocol_of_the_estimator_asks_for() {
        let of = |failure: Failure, estimator: &str| reason(failure, of_estimator(estimator));
        let (few, unseen) = (Failure::TooFewMatches, Failure::NoSupport);
        assert!(of(few, "best").contains("at least 20 are needed"));
        assert!(of(few, "ransac-e-inliers@superglue").contains("at least 5 are needed"));
        assert!(of(unseen, "best").contains("at least 10 must lie in front"));
        assert!(
            of(unseen, "best@imc").contains("at least 8 inliers, and at least 1 must lie in front")
        );
        let both = when_pairs_fail(["best", "best@imc"].map(of_estimator));
        assert_eq!(
            both,
            "A pair fails with fewer than 20 selected matches, or fewer than 10 in front of both cameras. With the \
             protocol imc a pair fails with fewer than 8 selected matches, fewer than 8 inliers, or fewer than 1 in \
             front of both cameras."
        );
    }

    #[test]
    fn the_better_one_is_named_first_and_doubt_is_told() {
        let score = |value, low, high| Difference::seen(value, Some([low, high]));
        let words = |difference| advantage("a", "b", "06", &difference);
        assert_eq!(
            words(score(0.03, 0.01, 0.05)),
            "a beats b on 06 by 0.030 [0.010, 0.050], for this comparison alone"
        );
        assert_eq!(
            words(score(-0.03, -0.05, -0.01)),
            "b beats a on 06 by 0.030 [0.010, 0.050], for this comparison alone"
        );
        // Of several that are decided together, one that alone would be certain may not be.
        let of_three = |is_certain| Difference {
            together: Some(3),
            is_certain,
            ..score(-0.03, -0.05, -0.01)
        };
        assert_eq!(
            [true, false].map(|is_certain| words(of_three(is_certain))),
            [
                "b beats a on 06 by 0.030 [0.010, 0.050]",
                "b is ahead of a on 06 by 0.030 [0.010, 0.050], not certain among 3 comparisons",
            ]
        );
        assert_eq!(
            words(score(-0.01, -0.05, 0.02)),
            "b is not certainly better than a on 06: 0.010 [-0.020, 0.050]"
        );
        assert_eq!(words(score(0.0, 0.0, 0.0)), "a and b score the same on 06");
        assert_eq!(
            words(score(-1e-17, -1e-4, 0.02)),
            "a and b score the same on 06: 0.000 [0.000, 0.020]"
        );
        let few = Difference {
            images: 3,
            ..Difference::seen(0.2, None)
        };
        assert_eq!(
            words(few),
            "a is ahead of b on 06 by 0.200; there is no interval with 3 images that are in several pairs, or pairs \
             that share no image"
        );
        let level = Difference::seen(0.0, None);
        assert_eq!(words(level), "a and b score the same on 06");
    }
    #[test]
    fn of_very_many_only_the_nearest_have_a_sentence_of_their_own() {
        let lead = |i: usize| Lead {
            dataset: "06".into(),
            model: Model::Pose,
            best: ("a".into(), "best".into()),
            other: (format!("m{i}"), "best".into()),
            // The farthest come first.
            difference: Difference::seen(0.01 * (20 - i) as f64, None),
        };
        let all: Vec<Lead> = (0..SENTENCES + 3).map(lead).collect();
        let text = leads_in_words(&all);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), SENTENCES + 1);
        assert!(lines[0].starts_with("a + best is ahead of m14 + best on 06 by 0.060;"));
        assert_eq!(
            lines[SENTENCES],
            "a + best is ahead of the other 3 on 06 by 0.180 and more"
        );
        assert_eq!(leads_in_words(&all[..2]).lines().count(), 2);
    }
}
