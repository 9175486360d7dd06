//! All results of one method on one dataset.

use super::{Failure, Model, PairResult};

/// The results of one matcher with one estimator on one dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultSet {
    /// Name of the dataset.
    pub dataset: String,
    /// Id of the matcher.
    pub matcher: String,
    /// Id of the estimator; empty where the results do not name it.
    pub estimator: String,
    /// How often each pair was run with another seed; at least 1.
    pub repetitions: u32,
    /// One result for each listed pair and repetition.
    pub pairs: Vec<PairResult>,
    /// Results for pairs that the dataset does not list; they are not in `pairs`.
    pub ignored: usize,
    /// Results that other methods of a run have on this dataset and this one has not recorded; they are not in `pairs`. Such
    /// a method is not ranked, and nothing is called certain of it.
    pub lacking: usize,
}

/// A matcher with its estimator, if that is known: `sift + ransac-e`.
pub fn method(matcher: &str, estimator: &str) -> String {
    if estimator.is_empty() {
        matcher.to_owned()
    } else {
        format!("{matcher} + {estimator}")
    }
}

impl ResultSet {
    /// Its [`method`].
    pub fn method(&self) -> String {
        method(&self.matcher, &self.estimator)
    }

    /// Tasks on listed pairs that have no result.
    pub fn missing(&self) -> usize {
        let pairs = self.pairs.iter();
        pairs
            .filter(|pair| pair.outcome == Err(Failure::Missing))
            .count()
    }

    /// What was estimated: those of one kind alone can be compared.
    pub fn model(&self) -> Model {
        Model::of_all(&self.pairs)
    }
}
