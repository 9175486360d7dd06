//! Scores of files, and the ambiguities that are computed from them.
//!
//! Whether all scores lie in 0..1 is known only after all pairs were read: [`Rating::seen_after`] finds it
//! out, and [`Rating::ambiguities`] uses it.

use super::Scores;
use crate::arrays::Array;
use crate::counted::counted;

/// What a file says about how certain its matches are.
#[derive(Debug)]
pub(super) enum Rating {
    /// Nothing.
    None,
    /// Higher is better.
    Score(Vec<f64>),
    /// 0 is certain, 1 is not.
    Ambiguity(Vec<f64>),
}

impl Rating {
    /// The scores of `count` matches.
    ///
    /// # Errors
    /// If there are not as many.
    pub(super) fn of_scores(scores: &Array, count: usize) -> Result<Self, String> {
        // Checked before the conversion to eight bytes each: a small file can hold very many scores of one byte.
        one_each(scores.len(), count)?;
        Ok(Self::Score(scores.to_vec()))
    }

    /// What the scores of a file look like, with this pair after those that were seen `before`.
    pub(super) fn seen_after(&self, before: Scores) -> Scores {
        match (self, before) {
            (Self::None, before) => before,
            (Self::Ambiguity(_), _) => Scores::Ambiguity,
            (Self::Score(values), Scores::None | Scores::Unit)
                if values.iter().all(|value| (0.0..=1.0).contains(value)) =>
            {
                Scores::Unit
            }
            (Self::Score(_), _) => Scores::Unbounded,
        }
    }

    /// Ambiguities of `count` matches, rated by scores of that kind.
    ///
    /// # Errors
    /// If one is not a number or an ambiguity outside 0..1.
    pub(super) fn ambiguities(&self, count: usize, scores: Scores) -> Result<Vec<f32>, String> {
        let values = match self {
            Self::None => return Ok(vec![0.0; count]),
            Self::Score(values) | Self::Ambiguity(values) => values,
        };
        one_each(values.len(), count)?;
        (values.iter().enumerate())
            .map(|(number, &value)| {
                let ambiguity = match self {
                    Self::Ambiguity(_) => value,
                    _ if scores == Scores::Unit => 1.0 - value,
                    _ if value.is_infinite() => f64::from(value < 0.0),
                    _ => 0.5 - 0.5 * value / (1.0 + value.abs()),
                };
                if (0.0..=1.0).contains(&ambiguity) {
                    Ok(ambiguity as f32)
                } else {
                    let what = match self {
                        Self::Ambiguity(_) => "ambiguity",
                        _ => "score",
                    };
                    Err(format!("match {number} has the {what} {value}"))
                }
            })
            .collect()
    }
}
fn one_each(scores: usize, matches: usize) -> Result<(), String> {
    if scores == matches {
        return Ok(());
    }
    let (scores, matches) = (counted(scores, "score"), counted(matches, "match"));
    Err(format!("{scores} for {matches}"))
}
