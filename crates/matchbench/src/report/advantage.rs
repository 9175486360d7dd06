//! Which of two methods is better, by how much and how surely, in words.

use std::collections::BTreeSet;

use super::numbers::fixed;
use crate::metrics::{Difference, Interval, Lead, Model, method};

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
        1 => {
            "1 independent unit (an image that is in several pairs, or a pair that shares no image)"
                .to_owned()
        }
        _ => format!(
            "{count} independent units (images that are in several pairs, and pairs that share no image)"
        ),
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
    use super::*;

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
            "a is ahead of b on 06 by 0.200; there is no interval with 3 independent units (images that are \
             in several pairs, and pairs that share no image)"
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
