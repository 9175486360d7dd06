//! Learning BinBoost: bit after bit, each a boosted combination of weak learners.
//!
//! T. Trzcinski, M. Christoudias, V. Lepetit: "Learning Image Descriptors with Boosting", IEEE
//! Transactions on Pattern Analysis and Machine Intelligence 37(3), 2015, sections 3 to 5.
//!
//! Given are pairs of patches with labels l = 1 (same point) or -1. One bit after the other is learned. Bit d
//! is to agree with the labels where the bits before it do not. This is expressed by weights W of the pairs,
//! which follow from the bits before:
//!
//! 1. Weak learners are chosen by boosting. Out of some random features and all thresholds, the pair is taken
//!    that maximises `sum_n W_n l_n h(x_n) h(y_n)`. Then the weights are updated as in AdaBoost, for this bit
//!    only (section 3, the boosting trick). All thresholds of a feature are tried at once: h(x) and h(y) differ
//!    exactly if the threshold lies between the two responses. So the sum is the prefix sum of a histogram of
//!    where these intervals begin and end.
//! 2. The weights b of the weak learners start as the leading eigenvector of `sum_n W_n l_n h(x_n) h(y_n)^T`,
//!    made symmetric. Some steps of gradient ascent follow, on the objective with tanh instead of the sign
//!    (section 5). An offset is learned together with them.
//! 3. The new W is the slope of the logistic loss at the margin `l_n (a s_n - b)`. Here s_n is the sum of
//!    `C_d(x_n) C_d(y_n)` so far, the step `a` is the same for all bits, and b is chosen such that both kinds
//!    of pairs have the same total weight.
//!
//! *Differs from the paper*, where a_d and W are those of AdaBoost. In the descriptor all bits count the same,
//! so they do in the margin too. Pairs are told apart by a threshold of their distance, and this threshold is
//! b. With the logistic loss, pairs with wrong labels cannot outweigh all others. On the validation scenes this
//! more than halves the false positives.
//!
//! BGM, from which BinBoost was developed, is the same with one weak learner per bit and no combination.

use anyhow::{Context, Result, ensure};
use indicatif::ProgressBar;
use matchbench_vision::features::binboost::{
    BinBoostTable, BoxResponses, INNER, SIDE, WeakLearner,
};
use matchbench_vision::seed::Seed;
use nalgebra::{DMatrixView, DVector, SymmetricEigen};
use serde::Serialize;

use crate::pairs::{PatchPair, logistic_weights, training_pairs};
use crate::patches::PatchSet;
use crate::resume::Checkpoint;

const DIRECTIONS: usize = 8;
/// The state is saved after this many bits.
const CHECKPOINT: usize = 8;

/// Parameters of the training of BinBoost.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BoostParams {
    /// Number of bits. What was learned does not depend on it, so bits can be added later.
    #[serde(skip)]
    pub(crate) bits: usize,
    pub(crate) learners_per_bit: usize,
    pub(crate) boxes: usize,
    /// Number of features tried for each weak learner.
    pub(crate) tries: usize,
    /// Number of pairs of patches; half of them show one point.
    pub(crate) pairs: usize,
    /// Weight of a bit in the margin of a pair; above 0.
    pub(crate) step: f64,
    pub(crate) seed: u64,
}

/// Learns a table; continues from the state in `checkpoint`.
pub(crate) fn learn(
    set: &PatchSet,
    params: &BoostParams,
    checkpoint: &Checkpoint,
    bar: &ProgressBar,
) -> Result<BinBoostTable> {
    ensure!(
        params.boxes <= 8192 && params.learners_per_bit <= 256,
        "too many boxes or learners"
    );
    ensure!(!set.triplets.is_empty(), "the set has no triplets");
    let seed = Seed(params.seed).child("binboost");
    let mut table = BinBoostTable {
        boxes: random_boxes(params.boxes, seed),
        learners_per_bit: params.learners_per_bit,
        learners: Vec::new(),
        offsets: Vec::new(),
    };
    if let Some(state) = checkpoint.load()? {
        table = BinBoostTable::from_bytes(&state).with_context(|| checkpoint.damaged())?;
        // The training may be stopped with more bits than are asked for now. The first ones are the same.
        table.offsets.truncate(params.bits);
        (table.learners).truncate(params.bits * params.learners_per_bit);
    }
    bar.set_message("responses");
    bar.set_length(params.bits as u64);
    let data = Data::new(set, params, &table.boxes, seed);
    let mut similarities = vec![0.0; data.labels.len()];
    for (learners, &offset) in table.bit_by_bit() {
        data.compare(&mut similarities, learners, offset);
        bar.inc(1);
    }
    while table.bits() < params.bits {
        let bit = table.bits();
        let seed = seed.child("bit").number(bit as u64);
        let (weights, wrong) = data.weights(&similarities);
        let (learners, offset) = data.learn_bit(&weights, params, seed);
        data.compare(&mut similarities, &learners, offset);
        table.learners.extend(learners);
        table.offsets.push(offset);
        bar.set_message(format!("mean weight {wrong:.3}"));
        bar.inc(1);
        if (bit + 1).is_multiple_of(CHECKPOINT) {
            checkpoint.save(&table.to_bytes())?;
        }
    }
    Ok(table)
}

/// Random boxes with sides of 3 to 15 anywhere in the patch.
fn random_boxes(count: usize, seed: Seed) -> Vec<[u8; 4]> {
    let mut rng = seed.child("boxes").rng();
    (0..count)
        .map(|_| {
            let mut side = || {
                let length = 3 + rng.below(13);
                let first = rng.below(INNER as u32 - length + 1);
                (first as u8, (first + length) as u8)
            };
            let ((left, right), (top, bottom)) = (side(), side());
            [left, top, right, bottom]
        })
        .collect()
}

/// The responses of the patches of all pairs.
struct Data {
    /// For each feature, the responses of the first and of the second patch of each pair.
    responses: Vec<[Vec<u8>; 2]>,
    /// 1 or -1.
    labels: Vec<f32>,
    step: f32,
}

/// The answers of the weak learners of a bit, one patch after the other: 1 or -1.
type Answers = Vec<f32>;

impl Data {
    fn new(set: &PatchSet, params: &BoostParams, boxes: &[[u8; 4]], seed: Seed) -> Self {
        let pairs = training_pairs(set, params.pairs, seed);
        let features = DIRECTIONS * boxes.len();
        let column = || Vec::with_capacity(pairs.len());
        let mut responses: Vec<[Vec<u8>; 2]> =
            (0..features).map(|_| [column(), column()]).collect();
        let mut computer = BoxResponses::default();
        let mut row = vec![[0; DIRECTIONS]; boxes.len()];
        for PatchPair { first, second, .. } in &pairs {
            for (end, &patch) in [first, second].into_iter().enumerate() {
                debug_assert_eq!(set.small(patch).len(), SIDE * SIDE);
                computer.compute(set.small(patch), boxes, &mut row);
                for (columns, &response) in responses.iter_mut().zip(row.as_flattened()) {
                    columns[end].push(response);
                }
            }
        }
        let labels = pairs.iter().map(|pair| if pair.same { 1.0 } else { -1.0 });
        Self {
            responses,
            labels: labels.collect(),
            step: params.step as f32,
        }
    }

    /// Adds a bit to the similarities of the pairs: 1 if both ends have the same value, else -1.
    fn compare(&self, similarities: &mut [f32], learners: &[WeakLearner], offset: i16) {
        let [first, second] = [0, 1].map(|end| self.bits(learners, offset, end));
        for ((similarity, x), y) in similarities.iter_mut().zip(&first).zip(&second) {
            *similarity += if x == y { 1.0 } else { -1.0 };
        }
    }

    /// The weights of the pairs. A pair weighs more if the similarities say less clearly what it is, and all
    /// pairs of one point together weigh as much as all others. Also returns the loss.
    fn weights(&self, similarities: &[f32]) -> (Vec<f32>, f64) {
        let scores: Vec<f32> = similarities.iter().map(|s| self.step * s).collect();
        let (mut weights, _) = logistic_weights(&self.labels, &scores);
        let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
        for weight in &mut weights {
            *weight *= (1.0 / total) as f32;
        }
        (weights, total / self.labels.len() as f64)
    }

    /// Whether the weighted answers plus the offset are above 0, for one end of each pair.
    fn bits(&self, learners: &[WeakLearner], offset: i16, end: usize) -> Vec<bool> {
        let mut sums = vec![i32::from(offset); self.labels.len()];
        for learner in learners {
            let responses = &self.responses[usize::from(learner.feature)][end];
            let weight = i32::from(learner.weight);
            for (sum, &response) in sums.iter_mut().zip(responses) {
                *sum += if response <= learner.threshold {
                    weight
                } else {
                    -weight
                };
            }
        }
        sums.into_iter().map(|sum| sum > 0).collect()
    }

    fn learn_bit(
        &self,
        weights: &[f32],
        params: &BoostParams,
        seed: Seed,
    ) -> (Vec<WeakLearner>, i16) {
        let count = params.learners_per_bit;
        let mut rng = seed.rng();
        let mut inner = weights.to_vec();
        let mut chosen: Vec<(usize, u8)> = Vec::with_capacity(count);
        for _ in 0..count {
            let signed: Vec<f32> = inner.iter().zip(&self.labels).map(|(w, l)| w * l).collect();
            let total: f32 = signed.iter().sum();
            let (_, feature, threshold) = (0..params.tries)
                .map(|_| {
                    let feature = rng.below(self.responses.len() as u32) as usize;
                    let (apart, threshold) = best_threshold(&self.responses[feature], &signed);
                    (total - 2.0 * apart, feature, threshold)
                })
                .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
                .expect("at least one try");
            let [x, y] = &self.responses[feature];
            let products: Vec<f32> = (x.iter().zip(y).zip(&self.labels))
                .map(|((x, y), l)| {
                    if (*x <= threshold) == (*y <= threshold) {
                        *l
                    } else {
                        -l
                    }
                })
                .collect();
            reweigh(&mut inner, &products);
            chosen.push((feature, threshold));
        }
        if let [(feature, threshold)] = chosen[..] {
            let alone = WeakLearner {
                feature: feature as u16,
                threshold,
                weight: 127,
            };
            return (vec![alone], 0);
        }
        let answers = [0, 1].map(|end| self.answers(&chosen, end));
        let signed: Vec<f32> = weights
            .iter()
            .zip(&self.labels)
            .map(|(w, l)| w * l)
            .collect();
        let combination = ascend(&answers, &signed, eigenvector(&answers, &signed, count));
        let (offset, combination) = combination.split_last().expect("an offset");
        let largest = combination
            .iter()
            .fold(f32::MIN_POSITIVE, |most, b| most.max(b.abs()));
        let learners = (chosen.iter().zip(combination))
            .map(|(&(feature, threshold), b)| WeakLearner {
                feature: feature as u16,
                threshold,
                weight: (127.0 * b / largest).round() as i8,
            })
            .collect();
        (learners, (127.0 * offset / largest).round() as i16)
    }

    fn answers(&self, chosen: &[(usize, u8)], end: usize) -> Answers {
        let count = chosen.len();
        let mut answers = vec![0.0; count * self.labels.len()];
        for (k, &(feature, threshold)) in chosen.iter().enumerate() {
            for (n, &response) in self.responses[feature][end].iter().enumerate() {
                answers[n * count + k] = if response <= threshold { 1.0 } else { -1.0 };
            }
        }
        answers
    }
}

/// The threshold that separates pairs of the smallest total weight, and that weight.
fn best_threshold([x, y]: &[Vec<u8>; 2], signed: &[f32]) -> (f32, u8) {
    // Four histograms in turn, so that no addition waits for the one before.
    let mut changes = [[0.0_f32; 256]; 4];
    for (n, ((&x, &y), &weight)) in x.iter().zip(y).zip(signed).enumerate() {
        changes[n & 3][usize::from(x.min(y))] += weight;
        changes[n & 3][usize::from(x.max(y))] -= weight;
    }
    let mut apart = 0.0;
    let mut best = (f32::INFINITY, 0);
    for threshold in 0..=255_u8 {
        let at = usize::from(threshold);
        apart += (changes[0][at] + changes[1][at]) + (changes[2][at] + changes[3][at]);
        if apart < best.0 {
            best = (apart, threshold);
        }
    }
    best
}

/// One step of AdaBoost: `products` are 1 where the answer is right, -1 where it is wrong.
fn reweigh(weights: &mut [f32], products: &[f32]) {
    let edge: f64 = (weights.iter().zip(products))
        .map(|(w, p)| f64::from(w * p))
        .sum();
    let edge = edge.clamp(-0.999, 0.999);
    let alpha = 0.5 * libm::log((1.0 + edge) / (1.0 - edge));
    let (right, wrong) = (libm::exp(-alpha) as f32, libm::exp(alpha) as f32);
    let mut total = 0.0_f64;
    for (weight, &product) in weights.iter_mut().zip(products) {
        *weight *= if product > 0.0 { right } else { wrong };
        total += f64::from(*weight);
    }
    let scale = (1.0 / total) as f32;
    for weight in weights {
        *weight *= scale;
    }
}

/// Projections of all patches on `b`, whose last value is an offset.
fn project(answers: &Answers, b: &[f32]) -> Vec<f32> {
    let (&offset, b) = b.split_last().expect("an offset");
    let dot = |row: &[f32]| {
        let mut sums = [0.0_f32; 8];
        let (rows, rest) = row.as_chunks::<8>();
        let (bs, last) = b.as_chunks::<8>();
        for (row, b) in rows.iter().zip(bs) {
            for i in 0..8 {
                sums[i] += row[i] * b[i];
            }
        }
        sums.iter().sum::<f32>() + rest.iter().zip(last).map(|(x, y)| x * y).sum::<f32>()
    };
    answers
        .chunks_exact(b.len())
        .map(|row| dot(row) + offset)
        .collect()
}

/// Adds `sum_n factors[n] h_n`, and in the last place the sum of the factors.
fn combine(answers: &Answers, factors: impl Iterator<Item = f32>, sums: &mut [f32]) {
    let (last, sums) = sums.split_last_mut().expect("an offset");
    for (row, factor) in answers.chunks_exact(sums.len()).zip(factors) {
        *last += factor;
        for (sum, answer) in sums.iter_mut().zip(row) {
            *sum += factor * answer;
        }
    }
}

/// The leading eigenvector of `sum_n s_n (h(x_n) h(y_n)^T + h(y_n) h(x_n)^T)`, and in the last place the offset
/// that centres its projections. The answers are taken relative to their mean, since many learners nearly
/// always give the same answer, which carries no information.
fn eigenvector([x, y]: &[Answers; 2], signed: &[f32], count: usize) -> Vec<f32> {
    let pairs = signed.len();
    let x = DMatrixView::from_slice(x, count, pairs);
    let y = DMatrixView::from_slice(y, count, pairs);
    let signs = DVector::from_column_slice(signed);
    let mut weighted = y.into_owned();
    for (mut column, &sign) in weighted.column_iter_mut().zip(signed) {
        column *= sign;
    }
    let mean = (x.column_mean() + y.column_mean()) * 0.5;
    let (sum_x, sum_y) = (x * &signs, y * &signs);
    let centred = x * weighted.transpose() - sum_x * mean.transpose() - &mean * sum_y.transpose()
        + &mean * mean.transpose() * signs.sum();
    let eigen = SymmetricEigen::new(&centred + centred.transpose());
    let leading = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let offset = -leading.dot(&mean);
    leading.iter().copied().chain([offset]).collect()
}

/// Steps of gradient ascent on `sum_n s_n tanh(b.h(x_n)) tanh(b.h(y_n))`. The result is the b that is best by
/// the sum with signs in place of tanh.
fn ascend([x, y]: &[Answers; 2], signed: &[f32], start: Vec<f32>) -> Vec<f32> {
    const STEPS: usize = 10;
    const STEP: f32 = 0.15;
    let mut b = start;
    let mut best = (f64::NEG_INFINITY, b.clone());
    for step in 0..=STEPS {
        let (on_x, on_y) = (project(x, &b), project(y, &b));
        let value: f64 = (on_x.iter().zip(&on_y).zip(signed))
            .map(|((x, y), s)| f64::from(if (*x > 0.0) == (*y > 0.0) { *s } else { -s }))
            .sum();
        if value > best.0 {
            best = (value, b.clone());
        }
        if step == STEPS {
            break;
        }
        let squares: f32 = on_x.iter().map(|z| z * z).sum();
        let scale = 1.5 / (squares / on_x.len() as f32).sqrt().max(f32::MIN_POSITIVE);
        let soft = |z: &[f32]| -> Vec<f32> { z.iter().map(|z| libm::tanhf(scale * z)).collect() };
        let (soft_x, soft_y) = (soft(&on_x), soft(&on_y));
        let mut gradient = vec![0.0; b.len()];
        let slope = |own: &[f32], other: &[f32]| -> Vec<f32> {
            (own.iter().zip(other).zip(signed))
                .map(|((o, p), s)| s * (1.0 - o * o) * p)
                .collect()
        };
        combine(x, slope(&soft_x, &soft_y).into_iter(), &mut gradient);
        combine(y, slope(&soft_y, &soft_x).into_iter(), &mut gradient);
        let step = STEP * length(&b) / length(&gradient).max(f32::MIN_POSITIVE);
        for (b, g) in b.iter_mut().zip(&gradient) {
            *b += step * g;
        }
    }
    best.1
}

fn length(v: &[f32]) -> f32 {
    v.iter().map(|v| v * v).sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_threshold_is_that_of_trying_all() {
        let mut rng = Seed(5).rng();
        let mut column = || -> Vec<u8> { (0..500).map(|_| rng.below(256) as u8).collect() };
        let ends = [column(), column()];
        let signed: Vec<f32> = column().iter().map(|&v| f32::from(v) - 140.0).collect();
        let apart = |t: u8| -> f32 {
            (ends[0].iter().zip(&ends[1]).zip(&signed))
                .filter(|((x, y), _)| (**x <= t) != (**y <= t))
                .map(|(_, s)| s)
                .sum()
        };
        let (least, threshold) = best_threshold(&ends, &signed);
        let all = (0..=255).map(apart).fold(f32::INFINITY, f32::min);
        assert_eq!((least, apart(threshold)), (all, all));
    }

    #[test]
    fn boosting_halves_what_was_right() {
        // After a step of AdaBoost the right and the wrong answers weigh the same.
        let mut weights = vec![0.25; 4];
        reweigh(&mut weights, &[1.0, 1.0, 1.0, -1.0]);
        assert!((weights[3] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn both_kinds_of_pairs_weigh_the_same_and_the_doubtful_more() {
        let data = Data {
            responses: Vec::new(),
            labels: vec![1.0, 1.0, -1.0, -1.0, -1.0],
            step: 0.5,
        };
        let (weights, _) = data.weights(&[9.0, 3.0, 5.0, -4.0, -6.0]);
        let [same, different] = [&weights[..2], &weights[2..]].map(|w| w.iter().sum::<f32>());
        assert!(
            (same - 0.5).abs() < 1e-3 && (different - 0.5).abs() < 1e-3,
            "{weights:?}"
        );
        assert!(weights[0] < weights[1] && weights[2] > weights[3] && weights[3] > weights[4]);
    }

    #[test]
    fn the_combination_trusts_the_learner_that_is_right() {
        // Learner 0 gives both ends of a same pair the same answer; learner 1 answers at random.
        let (x, y) = (
            vec![1.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0],
            vec![1.0, -1.0, -1.0, -1.0, -1.0, -1.0, 1.0, -1.0],
        );
        let signed = [0.25, 0.25, -0.25, -0.25];
        let answers = [x, y];
        let b = ascend(&answers, &signed, eigenvector(&answers, &signed, 2));
        assert!(b[0].abs() > 3.0 * b[1].abs(), "{b:?}");
    }
}
