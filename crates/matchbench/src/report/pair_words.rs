//! The result of a pair, in words.

use crate::counted::counted;
use crate::metrics::{Angle, Deviation, Failure, PairResult};
use crate::protocols::Protocol;

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

/// What is said where a method of an unfinished run has no record of a pair that others have, in a word or two and in a
/// sentence: the pair has not failed.
pub(super) const NOT_RECORDED: [&str; 2] = [
    "not recorded",
    "Others have this pair; the run has not recorded it with this method yet, so it has not failed.",
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
            format!(
                "No estimate that enough matches agree with: for a pose {least}, no farther than `max_depth` of the \
                 estimator (50 baselines for most)."
            )
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

/// When a row of a result file counts as failed, a sentence for each of these protocols. What the program did that wrote it
/// is not known.
pub(super) fn when_rows_fail<'p>(protocols: impl IntoIterator<Item = &'p Protocol>) -> String {
    let sentence = |protocol: &Protocol| {
        let row = if protocol.is_ours() {
            "A row".to_owned()
        } else {
            format!("With the protocol {} a row", protocol.id)
        };
        format!(
            "{row} without a pose, or with fewer than {} in front of both cameras, counts as failed.",
            counted(protocol.min_support, "match")
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
            let stated = (pair.pose_probability)
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

#[cfg(test)]
mod tests {
    use crate::protocols::of_estimator;

    use super::*;

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
}
