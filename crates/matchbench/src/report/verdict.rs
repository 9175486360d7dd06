//! Which method is best on a dataset, and whether that is significant, in one sentence. All pairwise
//! comparisons are in the report.

use crate::front_door::ESTIMATORS;
use crate::metrics::{Difference, Lead, MIN_IMAGES};

use super::advantage::{rounds, units};
use super::words::together;
use crate::metrics::method;

/// Most methods that a sentence names; of more it gives only the number.
const NAMED: usize = 3;

/// A sentence for each dataset on which several methods were run, in the order of the `leads`. If a dataset has
/// both poses and homographies, one sentence for each.
pub fn verdicts(leads: &[Lead]) -> Vec<String> {
    (rounds(leads).iter())
        .map(|(name, leads)| verdict(name, leads))
        .collect()
}

fn verdict(name: &str, leads: &[&Lead]) -> String {
    let first = leads[0];
    let best = method(&first.best.0, &first.best.1);
    let (level, behind): (Vec<&Lead>, Vec<&Lead>) =
        leads.iter().partition(|lead| lead.difference.is_zero());
    let mut doubtful = behind.clone();
    doubtful.retain(|lead| !lead.difference.is_certain);
    let too_few = (doubtful.iter().map(|lead| lead.difference))
        .find(Difference::has_few_images)
        .map(|difference| {
            let (least, found) = (units(MIN_IMAGES), difference.images);
            let are = if found == 1 { "is" } else { "are" };
            format!("nothing is certain below {least}; there {are} {found}")
        });
    let lead = |lead: &Lead| lead.difference.value.unwrap_or(f64::INFINITY);
    doubtful.sort_by(|one, other| lead(one).total_cmp(&lead(other)));
    let is_certain = doubtful.is_empty();
    let others = match (is_certain, behind.len()) {
        (true, many @ 2..) => format!("each of the other {many}"),
        (true, _) => names(&behind),
        (false, _) => names(&doubtful),
    };
    let shared = format!("{} share the highest AUC", equals(&best, &level));
    let text = match (too_few, level.is_empty(), is_certain) {
        (Some(too_few), true, _) => {
            format!("{best} has the highest AUC; {too_few}")
        }
        (Some(too_few), false, _) => format!("{shared}; {too_few}"),
        (None, true, true) => format!("{best} is certainly better than {others}"),
        (None, true, false) => {
            format!("{best} has the highest AUC, but is not certainly better than {others}")
        }
        (None, false, _) if behind.is_empty() => shared,
        (None, false, true) => {
            format!("{shared}, and {best} is certainly better than {others}")
        }
        (None, false, false) => {
            format!("{shared}, but {best} is not certainly better than {others}")
        }
    };
    let strangers = strangers(leads);
    let text = if strangers.is_empty() {
        text
    } else {
        format!(
            "{text}; {} has no estimator in common with {}, so this compares estimators too: give all the same {ESTIMATORS}",
            first.best.0,
            together(&strangers)
        )
    };
    format!("{name}: {text}").replace(char::is_control, "\u{fffd}")
}

/// The matchers that were run with no estimator that the best matcher was run with.
fn strangers(leads: &[&Lead]) -> Vec<String> {
    let best = &leads[0].best;
    let others = leads.iter().map(|lead| &lead.other);
    let methods: Vec<_> = others.chain([best]).collect();
    let has = |matcher: &str, estimator: &str| {
        (methods.iter()).any(|(its, with)| its == matcher && with == estimator)
    };
    let mut strangers: Vec<String> = Vec::new();
    for (matcher, _) in &methods {
        let mut own = methods.iter().filter(|(its, _)| its == matcher);
        if !own.any(|(_, estimator)| has(&best.0, estimator)) && !strangers.contains(matcher) {
            strangers.push(matcher.clone());
        }
    }
    strangers.truncate(NAMED);
    strangers
}

/// The best and those that share its AUC: at most [`NAMED`] names, then the number of the others.
fn equals(best: &str, level: &[&Lead]) -> String {
    let mut names: Vec<String> = (level.iter())
        .map(|lead| method(&lead.other.0, &lead.other.1))
        .collect();
    names.insert(0, best.to_owned());
    if let more @ 2.. = names.len().saturating_sub(NAMED) {
        names.truncate(NAMED);
        names.push(format!("{more} more"));
    }
    together(&names)
}

/// The methods that the best is compared with: at most [`NAMED`] names, then the number of the
/// others.
fn names(leads: &[&Lead]) -> String {
    let named = leads.iter().take(NAMED);
    let names: Vec<String> = named
        .map(|lead| method(&lead.other.0, &lead.other.1))
        .collect();
    match leads.len() - names.len() {
        0 => names.join(", "),
        more => format!("{} and {more} more", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Model;

    fn lead(dataset: &str, other: &str, value: f64, low: f64) -> Lead {
        Lead {
            dataset: dataset.into(),
            model: Model::Pose,
            best: ("sift".into(), "best".into()),
            other: (other.into(), "best".into()),
            difference: Difference::seen(value, Some([low, 0.9])),
        }
    }

    #[test]
    fn a_dataset_has_one_sentence_that_tells_doubt() {
        let leads = [
            lead("office", "orb", 0.2, 0.1),
            lead("office", "surf", 0.01, -0.1),
            lead("street", "orb", 0.2, 0.1),
            lead("wall", "orb", 0.2, 0.1),
            lead("wall", "surf", 0.3, 0.2),
        ];
        assert_eq!(
            verdicts(&leads),
            [
                "office: sift + best has the highest AUC, but is not certainly better than surf + best",
                "street: sift + best is certainly better than orb + best",
                "wall: sift + best is certainly better than each of the other 2",
            ]
        );
    }

    #[test]
    fn poses_and_homographies_of_a_dataset_have_a_sentence_each() {
        let of_homographies = Lead {
            model: Model::Homography,
            best: ("orb".into(), "best-h".into()),
            other: ("akaze".into(), "best-h".into()),
            ..lead("wall", "akaze", 0.3, 0.1)
        };
        let leads = [
            lead("wall", "orb", 0.2, 0.1),
            of_homographies,
            lead("street", "orb", 0.2, 0.1),
        ];
        assert_eq!(
            verdicts(&leads),
            [
                "wall (poses): sift + best is certainly better than orb + best",
                "wall (homographies): orb + best-h is certainly better than akaze + best-h",
                "street: sift + best is certainly better than orb + best",
            ]
        );
    }

    #[test]
    fn matchers_without_a_common_estimator_are_told() {
        let of = |matcher: &str, estimator: &str| Lead {
            other: (matcher.into(), estimator.into()),
            ..lead("wall", "", 0.2, 0.1)
        };
        let sentence = |leads: &[Lead]| verdicts(leads).concat();
        let text = sentence(&[of("orb", "ransac-e"), of("surf", "best")]);
        assert!(
            text.ends_with(
                "; sift has no estimator in common with orb, so this compares estimators too: give all the same --estimator"
            ),
            "{text}"
        );
        // One in common is enough, whichever was the best.
        let text = sentence(&[of("orb", "ransac-e"), of("sift", "ransac-e")]);
        assert!(!text.contains("in common"), "{text}");
    }

    #[test]
    fn of_few_images_nothing_is_certain() {
        let mut few = lead("office", "orb", 0.2, 0.1);
        few.difference = Difference {
            images: 3,
            is_certain: false,
            ..few.difference
        };
        let mut fewest = few.clone();
        fewest.difference.images = 1;
        assert_eq!(
            [verdicts(&[few]), verdicts(&[fewest])].concat(),
            [
                "office: sift + best has the highest AUC; nothing is certain below 6 independent units (images that \
                 are in several pairs, and pairs that share no image); there are 3",
                "office: sift + best has the highest AUC; nothing is certain below 6 independent units (images that \
                 are in several pairs, and pairs that share no image); there is 1",
            ]
        );
    }

    #[test]
    fn equal_methods_are_called_equal() {
        let leads = [
            lead("office", "orb", 0.0, 0.0),
            lead("street", "orb", 0.0, -0.1),
            lead("street", "surf", 0.2, 0.1),
            lead("wall", "orb", 1e-17, -0.1),
            lead("wall", "surf", 0.1, -0.1),
        ];
        assert_eq!(
            verdicts(&leads),
            [
                "office: sift + best and orb + best share the highest AUC",
                "street: sift + best and orb + best share the highest AUC, and sift + best is certainly better than \
                 surf + best",
                "wall: sift + best and orb + best share the highest AUC, but sift + best is not certainly better \
                 than surf + best",
            ]
        );
    }

    #[test]
    fn of_many_the_nearest_are_named() {
        let leads: Vec<Lead> = (0..6)
            .map(|i| lead("wall", &format!("m{i}"), 0.1 - 0.01 * f64::from(i), -0.1))
            .collect();
        let [sentence] = &verdicts(&leads)[..] else {
            panic!("one dataset");
        };
        assert!(
            sentence.ends_with("than m5 + best, m4 + best, m3 + best and 3 more"),
            "{sentence}"
        );
    }
}
