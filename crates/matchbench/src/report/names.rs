//! The names of matchers and estimators in publications, and their order in tables. Both come from the lists of
//! what can be run. What is on no list is called by its id and comes last.

use serde_json::Value;

use crate::estimators::ESTIMATORS;
use crate::matchers::MATCHERS;
use crate::protocols::{self, without_protocol};

/// How publications write a matcher: `BinBoost`.
pub(super) fn title(matcher: &str) -> String {
    let entry = MATCHERS.iter().find(|entry| entry.id() == matcher);
    entry.map_or_else(|| matcher.to_owned(), |entry| entry.title())
}

/// The position of a matcher in tables.
pub(super) fn place(matcher: &str) -> usize {
    let place = MATCHERS.iter().position(|entry| entry.id() == matcher);
    place.unwrap_or(MATCHERS.len())
}

/// Every parameter of a matcher or an estimator with its default.
pub(super) fn defaults(id: &str) -> Option<Value> {
    let id = without_protocol(id);
    let matcher = MATCHERS.iter().find(|entry| entry.id() == id);
    let estimator = || ESTIMATORS.iter().find(|entry| entry.id() == id);
    matcher
        .map(|entry| entry.defaults())
        .or_else(|| estimator().map(|entry| entry.defaults()))
}

/// The papers of a matcher, of an estimator and of the protocol that it is under, as their entries give them.
pub(super) fn references(matcher: &str, estimator: &str) -> [Option<&'static str>; 3] {
    let protocol = protocols::of_estimator(estimator);
    let estimator = without_protocol(estimator);
    [
        (MATCHERS.iter().find(|entry| entry.id() == matcher)).map(|entry| entry.reference()),
        (ESTIMATORS.iter().find(|entry| entry.id() == estimator)).map(|entry| entry.reference()),
        (!protocol.is_ours()).then_some(protocol.reference),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_order_are_those_of_the_lists() {
        for (i, entry) in MATCHERS.iter().enumerate() {
            assert_eq!(place(entry.id()), i);
            assert_eq!(title(entry.id()), entry.title());
        }
        assert_eq!(
            (title("mine_2").as_str(), place("mine_2")),
            ("mine_2", MATCHERS.len())
        );
        assert!(
            references("sift", "ransac-e@loftr")
                .iter()
                .all(Option::is_some)
        );
        assert_eq!(references("mine_2", ""), [None; 3]);
    }
}
