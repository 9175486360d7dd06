//! Which scores are above which: the one rule for ties of every sentence, table and figure.

/// What sums of thousands of scores may be apart by rounding alone.
pub(super) const ROUNDING: f64 = 1e-12;

/// Whether a score is above another by more than rounding. What is not above and not below is equal, and shares its
/// rank. `None`, of which there is no score, is below every score.
pub fn is_above(one: Option<f64>, other: Option<f64>) -> bool {
    match (one, other) {
        (Some(one), Some(other)) => one - other >= ROUNDING,
        (one, _) => one.is_some(),
    }
}

/// The rank of each score: one more than the number of scores above it.
pub fn ranks(scores: &[Option<f64>]) -> Vec<usize> {
    let above = |&score: &Option<f64>| scores.iter().filter(move |other| is_above(**other, score));
    scores
        .iter()
        .map(|score| 1 + above(score).count())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rounding_sets_apart_shares_a_rank() {
        let third = [0.1 + 0.2, 0.3].map(Some);
        assert_ne!(third[0], third[1]);
        assert_eq!(
            ranks(&[Some(0.2), third[0], None, third[1], Some(0.3 + 1e-9)]),
            [4, 2, 5, 2, 1]
        );
    }
}
