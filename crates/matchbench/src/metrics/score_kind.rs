//! What a score is: a function of results, and everything that is said about it.

use super::intervals::Ratio;
use super::{Interval, PairResult, Term};

/// A score as a function of results, and everything that is said about it.
#[derive(Clone, Copy, Debug)]
pub struct ScoreKind {
    /// Name of its column in CSV and JSON; never changes its meaning.
    pub id: &'static str,
    /// What it is about.
    pub about: Subject,
    /// Head of its column where people read.
    pub heading: &'static str,
    /// What it is, in full sentences. Neighbours in the list with the same text share it.
    pub definition: &'static str,
    /// The score of all pairs of a set of results; `None` or NaN where it is undefined.
    pub value: fn(&[PairResult]) -> Option<f64>,
    /// Where its interval comes from.
    pub spread: Spread,
    /// How the number is written for people.
    pub notation: Notation,
    /// Which tables for people have it; CSV and JSON have every score.
    pub detail: Detail,
}

/// What a score is about, and so what it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// Estimated poses.
    Poses,
    /// Estimated homographies, or a truth that is one.
    Homographies,
    /// Matches and keypoints by the depth of both images.
    Depth,
}

/// Where the interval of a score comes from.
#[derive(Clone, Copy, Debug)]
pub enum Spread {
    /// There is none.
    Unknown,
    /// The score is a ratio of sums over pairs, and this is what one pair adds.
    Terms(fn(&PairResult) -> Term),
    /// The same, where what a pair adds depends on the others.
    TermsOfAll(fn(&[PairResult]) -> Vec<Term>),
}

impl ScoreKind {
    /// Whether the score has an interval where there is enough evidence.
    pub fn has_interval(&self) -> bool {
        !matches!(self.spread, Spread::Unknown)
    }

    /// The 95 % interval of the mean score of these sets of as many pairs; `None` where there is not enough evidence.
    pub(super) fn interval<'a>(
        &self,
        sets: impl IntoIterator<Item = &'a [PairResult]>,
    ) -> Option<Interval> {
        let terms = sets.into_iter().flat_map(|pairs| self.terms(pairs));
        let ratio = Ratio::of(terms)?;
        match self.notation {
            Notation::Ratio => ratio.interval_of_share(),
            Notation::Count => ratio.interval_of_count(),
        }
    }

    /// What each pair adds to the score of these; empty if it has no interval.
    pub(super) fn terms(&self, pairs: &[PairResult]) -> Vec<Term> {
        match self.spread {
            Spread::Unknown => Vec::new(),
            Spread::Terms(term) => pairs.iter().map(term).collect(),
            Spread::TermsOfAll(terms) => terms(pairs),
        }
    }
}

/// How a score is written in tables for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notation {
    /// A share in `[0, 1]`: three decimals.
    Ratio,
    /// A mean number of things: one decimal.
    Count,
}

/// How closely somebody looks who sees a score.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Detail {
    /// In the table of a terminal too.
    Glance,
    /// In the complete tables of the report only.
    Complete,
}

/// A share of a pair: so many of so many, where they are known.
pub(super) fn share_term(pair: &PairResult, known: Option<(u32, u32)>) -> Term {
    Term {
        images: (pair.a, pair.b),
        numerator: known.map_or(0.0, |(found, all)| {
            // Matches of one place with several orientations are several.
            (f64::from(found) / f64::from(all.max(1))).min(1.0)
        }),
        denominator: f64::from(u8::from(known.is_some())),
    }
}

/// The ratio of the sums of what pairs add to a score.
pub(super) fn mean_of_terms(pairs: &[PairResult], term: impl Fn(&PairResult) -> Term) -> f64 {
    let (numerator, denominator) = pairs.iter().map(term).fold((0.0, 0.0), |sums, term| {
        (sums.0 + term.numerator, sums.1 + term.denominator)
    });
    numerator / denominator
}
