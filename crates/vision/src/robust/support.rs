//! How well the data agree with one model, computed only as far as it matters.
//!
//! Most models of a search are bad, so residuals are computed in blocks, and a model is given up as soon as the bound of
//! its quality ([`Scoring::upper_bound`]) or the sequential test says so. Data that cannot belong to it are looked for
//! last, since that costs most.

use super::sprt::Sprt;
use super::{Problem, Scoring, Support};

/// Number of residuals that are computed before it is checked again whether the model can still win.
const BLOCK: usize = 64;

/// The support of a model, if its quality is above `limit`.
pub(super) fn support_above<P: Problem>(
    limit: f64,
    problem: &P,
    score: &impl Scoring,
    model: &P::Model,
    residuals: &mut [f64],
) -> Option<Support> {
    let sum = sum_above(limit, problem, score, model, None, residuals)?;
    possible_above(limit, problem, score, model, sum, residuals)
}

/// The support of a model in all data, also in impossible ones, if its quality is above `limit` and `sprt` does not
/// reject it. Leaves the residuals.
pub(super) fn sum_above<P: Problem>(
    limit: f64,
    problem: &P,
    score: &impl Scoring,
    model: &P::Model,
    mut sprt: Option<&mut Sprt>,
    residuals: &mut [f64],
) -> Option<Support> {
    let n = problem.len();
    let mut total: Option<Support> = None;
    if score.upper_bound(0..n).is_some() {
        for start in (0..n).step_by(BLOCK) {
            let range = start..n.min(start + BLOCK);
            let block = &mut residuals[range.clone()];
            problem.squared_residuals(model, range.clone(), block);
            let support = score.support(range.clone(), block);
            let sum = total.map_or(support, |total| Support {
                quality: total.quality + support.quality,
                inliers: total.inliers + support.inliers,
                ..support
            });
            // A model with quality NaN never wins.
            let rest = score.upper_bound(range.end..n).unwrap_or(f64::INFINITY);
            let can_win = sum.quality + rest > limit;
            let mut is_bad = || (sprt.as_mut()).is_some_and(|t| t.gives_up(sum.inliers, range.end));
            if !can_win || is_bad() {
                return None;
            }
            total = Some(sum);
        }
    } else {
        problem.squared_residuals(model, 0..n, residuals);
        total = Some(score.support(0..n, residuals));
    }
    let support = total.filter(|support| support.quality > limit)?;
    if score.upper_bound(0..n).is_none() {
        // Such a score leaves changed values, or another order, in the slice, so residuals are computed again.
        problem.squared_residuals(model, 0..n, residuals);
    }
    Some(support)
}

/// The support of a model without impossible data, if its quality is above `limit`, given its residuals and its
/// support in all data.
pub(super) fn possible_above<P: Problem>(
    limit: f64,
    problem: &P,
    score: &impl Scoring,
    model: &P::Model,
    sum: Support,
    residuals: &mut [f64],
) -> Option<Support> {
    if !problem.exclude_impossible(model, sum.squared_threshold, residuals) {
        return Some(sum);
    }
    Some(score.support(0..problem.len(), residuals)).filter(|support| support.quality > limit)
}
