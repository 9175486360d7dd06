//! How far an estimated pose can be trusted, by the matches alone.
//!
//! Every set of matches has some best model, even the matches of two images that show nothing in common. Three
//! things tell that a model is right: more matches lie near its epipolar lines than chance brings, they do so all
//! over the images, and they determine the pose. So a pose is right with the probability `overlap * precise`. Both
//! factors are logistic regressions (Cox, "The Regression Analysis of Binary Sequences", Journal of the Royal
//! Statistical Society B 20, 1958). Their inputs are numbers that are computed from the distances of all matches
//! from the pose, whatever estimator and threshold found it:
//!
//! | of | number | meaning |
//! | --- | --- | --- |
//! | overlap | significance | 1 + max(0, -log10 of the number of false alarms) |
//! | overlap | cells | 1 plus the number of cells, of a grid of 10 x 10 over the points, that have a near match; in the view that has fewer |
//! | precise | deviation | how far the pose may be off in degrees, by the noise and the near matches of usual parallax; 0.01 to 180 |
//! | precise | noise | variance of the distances of near matches in square pixels, at least 0.01 |
//!
//! *Near* matches are those whose Sampson distance is at most 2 pixels. The *number of false alarms* is how many
//! models with so many near matches are expected if all matches are wrong and spread evenly (Moisan, Stival, "A
//! Probabilistic Criterion to Detect Rigid Point Matches Between Two Images and Estimate the Fundamental Matrix",
//! IJCV 57(3), 2004, eq. 13). Samples have five matches here. *Differs*: the factor for the number of models that a
//! sample allows (3 there, 10 here) is left out. It would lower every significance by 1, and the weights were fitted
//! without it. *Choice*: the chance is that of a point to be within 2 pixels of a line. At equal scales, a Sampson distance
//! of 2 pixels is 2.8 pixels from the line, so the chance is underestimated; but every line is taken to be as long as the
//! diagonal, which overestimates it. Wrong matches are often crowded in few places, which the cells tell.
//!
//! Where chance alone brings as many near matches, very many wrong matches fill most cells. So without any
//! significance the answer is no overlap, whatever the cells say.
//!
//! The *parallax* of a match is the angle between its two rays, with the rotation undone. It is *usual* if it is at
//! most twice the median plus 0.05 degrees. Wrong matches that are near by chance mostly have a larger parallax.
//! Where the baseline is short, a few of them would seem to determine the direction of translation, which all other
//! matches leave open. So the deviation is computed from matches of usual parallax: it is that of a pose refined
//! over these matches, and how far the given pose is from the refined one.
//!
//! Noise looks like parallax too. Where the camera only turned there is nothing else, and the more matches there are, the
//! better they seem to determine some direction. Noise of both points brings four times its variance into a squared
//! parallax. So of what these matches tell of the direction only the share `1 - 2 (4 v) / p` counts, where v is the
//! variance of the noise, p the mean squared parallax, and 2 a margin: nothing counts where p is at most twice what noise
//! brings. *Choice*: with margins of 1 and 3 the probabilities of turned photographs and of short baselines are about the same.
//!
//! A plane allows two poses. So the product is multiplied by the share of the pose beside the other one, where that explains
//! the near matches as well (`robust/plane_rivals.rs`).
//!
//! A pose can be right within degrees although most right matches are not near it. So a *coarse* pose is judged by the pose that
//! a refinement over all matches leads to, if this one has at least twice as many near matches (`robust/coarse_pose.rs`). It
//! is right if that one is, and if it is within 10 degrees of it.
//!
//! Each regression is `p = 1 / (1 + exp(-(w_0 + sum w_i ln number_i)))`. A low `overlap` says that the images show
//! nothing in common or that the matches do not tell; these two cases cannot be told apart.
//!
//! The weights of both were fitted together to 15,252 poses that SIFT, RootSIFT, ORB, AKAZE, GMS and AdaLAM led to
//! with `ransac-e`, `best` and `adaptive`. The data are KITTI 06 and rendered scenes with short and wide baselines,
//! where each place has the same weight, and five sets of pairs of images of two different places, where `overlap`
//! is known to be 0, with half that weight each. If each place is left out in turn, the Brier score is 0.112 and
//! the calibration error 0.05 in the mean over six places, and no pair of two places has an `overlap` above 0.5.

use super::TwoViews;
use super::coarse_pose::{MORE, finer_pose};
use super::consensus::inliers_within;
use super::grid::{FAR_AT_DEPTH_1, cells_of, span};
use super::plane_rivals::share_beside_rivals;
use crate::geometry::{
    PointPairs, RelativePose, essential_from_pose, pose_deviation, squared_sampson_distances,
};

/// A pose is right if both its rotation and its direction of translation are within this angle of the truth, in
/// degrees.
pub const RIGHT_POSE: f64 = 10.0;

/// w_0, and the weights of significance and cells.
const OVERLAP: [f64; 3] = [-10.537, 0.795, 3.049];
/// w_0, and the weights of deviation and noise.
const PRECISE: [f64; 3] = [1.486, -1.375, -0.963];
/// Upper limit of `overlap` where the near matches are not significant: just below one half, so that the answer is "no
/// overlap".
const BY_CHANCE: f64 = 0.49;
/// Distance of near matches in pixels.
const NEAR_PX: f64 = 2.0;
/// Least noise of a match in pixels.
const NOISE_PX: f64 = 0.1;
/// Cells across and down.
const CELLS: u32 = 10;
/// How many times the parallax that noise brings is taken off.
const MARGIN: f64 = 2.0;
/// Matches in a sample.
const SAMPLE: usize = 5;

/// How far an estimated pose can be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseProbabilities {
    /// The probability that both images show the matches that agree with the pose, and that they do not agree
    /// by chance. Below one half the answer is: no overlap, as far as these matches say.
    pub overlap: f64,
    /// The probability that the pose is right, [within 10 degrees](RIGHT_POSE) of the truth; at most `overlap`.
    pub right: f64,
}

impl TwoViews<'_> {
    /// How far a pose can be trusted, judged by these matches. The probabilities are calibrated on scenes of
    /// many kinds, for poses of estimators of the essential matrix. Coarser ones, as those that come from a fundamental
    /// matrix, are judged by the pose that they lead to.
    ///
    /// # Panics
    /// If the lists of the matches have different lengths.
    pub fn pose_probabilities(&self, b_from_a: &RelativePose) -> PoseProbabilities {
        let (pairs, focal) = (self.at_depth_1(), self.mean_focal());
        let near = NearMatches::of(b_from_a, &pairs, focal);
        let Some((finer, nearer)) = near.of_finer_pose(b_from_a, &pairs, focal) else {
            return near.probabilities_beside_rivals(b_from_a, &pairs, focal);
        };
        let of_finer = nearer.probabilities_beside_rivals(&finer, &pairs, focal);
        let is_close = finer.error(b_from_a).max().to_degrees() < RIGHT_POSE;
        PoseProbabilities {
            right: if is_close { of_finer.right } else { 0.0 },
            ..of_finer
        }
    }
}

/// The matches near a pose.
struct NearMatches {
    pairs: PointPairs,
    /// Their places among all matches.
    indices: Vec<u32>,
    /// The largest squared distance of a near match.
    squared_limit: f64,
    /// Standard deviation of their distances, at least [`NOISE_PX`].
    noise: f64,
}

impl NearMatches {
    fn of(b_from_a: &RelativePose, pairs: &PointPairs, focal: f64) -> Self {
        let mut squared = vec![0.0; pairs.len()];
        let essential = essential_from_pose(b_from_a);
        squared_sampson_distances(&essential, pairs, 0..pairs.len(), &mut squared);
        let squared_limit = (NEAR_PX / focal) * (NEAR_PX / focal);
        let indices = inliers_within(&squared, squared_limit);
        let sum: f64 = indices.iter().map(|&i| squared[i as usize]).sum();
        let freedom = indices.len().saturating_sub(SAMPLE).max(1);
        Self {
            pairs: pairs.chosen(&indices),
            indices,
            squared_limit,
            noise: (sum / freedom as f64).sqrt().max(NOISE_PX / focal),
        }
    }

    /// The pose that a [coarse](super::coarse_pose) one leads to, and the matches near it; none if the given pose, which these
    /// matches of all `pairs` are near, is not coarse.
    fn of_finer_pose(
        &self,
        b_from_a: &RelativePose,
        pairs: &PointPairs,
        focal: f64,
    ) -> Option<(RelativePose, Self)> {
        let least = MORE * self.pairs.len().max(SAMPLE);
        if least > pairs.len() {
            return None;
        }
        let finer = finer_pose(b_from_a, pairs, focal);
        let near = Self::of(&finer, pairs, focal);
        (near.pairs.len() >= least).then_some((finer, near))
    }

    /// The probabilities of the pose that these matches of all `pairs` are near.
    fn probabilities_beside_rivals(
        &self,
        b_from_a: &RelativePose,
        pairs: &PointPairs,
        focal: f64,
    ) -> PoseProbabilities {
        let alone = self.probabilities(b_from_a, pairs, focal);
        let share = share_beside_rivals(
            b_from_a,
            &self.pairs,
            self.squared_limit,
            self.noise * self.noise,
            RIGHT_POSE,
        );
        PoseProbabilities {
            right: alone.right * share,
            ..alone
        }
    }

    /// As [`Self::probabilities_beside_rivals`], without a look at the other pose that a plane allows.
    fn probabilities(
        &self,
        b_from_a: &RelativePose,
        pairs: &PointPairs,
        focal: f64,
    ) -> PoseProbabilities {
        let (near, noise) = (&self.pairs, self.noise);
        let views = [(&pairs.a_x, &pairs.a_y), (&pairs.b_x, &pairs.b_y)];
        let cells = views.map(|(x, y)| occupied_cells(x, y, &self.indices));
        let chance = views.map(|(x, y)| chance_near(x, y, NEAR_PX / focal));
        let significance = significance(near.len(), pairs.len(), chance[0].max(chance[1]));
        let overlap = probability(
            OVERLAP,
            [
                significance.max(0.0) + 1.0,
                cells[0].min(cells[1]) as f64 + 1.0,
            ],
        );
        let overlap = if significance > 0.0 {
            overlap
        } else {
            overlap.min(BY_CHANCE)
        };
        let (usual, squared_parallax) = of_usual_parallax(b_from_a, near);
        let of_noise = MARGIN * 4.0 * noise * noise;
        // Without parallax, or without a match, the difference is infinite or no number, and the share 0.
        let of_scene = (1.0 - of_noise / squared_parallax).max(0.0);
        let deviation = pose_deviation(b_from_a, &usual, noise, of_scene).to_degrees();
        let noise_px = noise * focal;
        let precise = probability(PRECISE, [deviation.max(1e-2), noise_px * noise_px]);
        PoseProbabilities {
            overlap,
            right: overlap * precise,
        }
    }
}

/// As [`TwoViews::pose_probabilities`], by matches at depth 1, where `focal` pixels are a unit, and without a look at the
/// other pose that a plane allows. Their covariances are not used, whatever the distances of the search are: the
/// probabilities are calibrated on plain Sampson distances.
pub(super) fn pose_probabilities(
    pairs: &PointPairs,
    focal: f64,
    b_from_a: &RelativePose,
) -> PoseProbabilities {
    let pairs = &pairs.without_covariances();
    NearMatches::of(b_from_a, pairs, focal).probabilities(b_from_a, pairs, focal)
}

/// Logistic regression on the logarithms of `numbers`; the first weight is the constant term.
fn probability<const N: usize, const M: usize>(weights: [f64; M], numbers: [f64; N]) -> f64 {
    const { assert!(M == N + 1, "a weight for 1 and one for each number") };
    let weighed = weights[1..].iter().zip(numbers);
    let logit = weighed.fold(weights[0], |sum, (weight, number)| {
        sum + weight * libm::log(number)
    });
    1.0 / (1.0 + libm::exp(-logit))
}

/// Number of cells of a grid over the points of one view, at depth 1, that contain one of the matches `near`.
fn occupied_cells(x: &[f64], y: &[f64], near: &[u32]) -> usize {
    let all = cells_of(x, y, CELLS, FAR_AT_DEPTH_1);
    let mut cells: Vec<u64> = near.iter().map(|&i| all[i as usize]).collect();
    cells.sort_unstable();
    cells.dedup();
    cells.len()
}

/// The probability that a random point, uniform in the rectangle around the points of one view, is within
/// `near` of a line through this rectangle. It is at most the probability for a diagonal, and at most one half.
fn chance_near(x: &[f64], y: &[f64], near: f64) -> f64 {
    let (width, height) = (span(x, FAR_AT_DEPTH_1), span(y, FAR_AT_DEPTH_1));
    let covered = 2.0 * near * libm::hypot(width, height) / (width * height);
    // A single point has no span.
    if covered < 0.5 { covered } else { 0.5 }
}

/// `-log10` of the number of false alarms of a model for which `near` of `all` matches are near, if each is
/// near with probability `chance`.
fn significance(near: usize, all: usize, chance: f64) -> f64 {
    if near <= SAMPLE {
        return 0.0;
    }
    let ln_factorial = |n: usize| libm::lgamma(n as f64 + 1.0);
    let ln_choose = |n: usize, k: usize| ln_factorial(n) - ln_factorial(k) - ln_factorial(n - k);
    let ln_alarms = libm::log((all - SAMPLE) as f64)
        + ln_choose(all, near)
        + ln_choose(near, SAMPLE)
        + (near - SAMPLE) as f64 * libm::log(chance);
    -ln_alarms / core::f64::consts::LN_10
}

/// The matches whose parallax is not far above the median, and its mean square over them in squared radians. The parallax
/// is the angle between the two rays after the rotation is undone.
fn of_usual_parallax(b_from_a: &RelativePose, pairs: &PointPairs) -> (PointPairs, f64) {
    /// Largest parallax over the median.
    const TIMES: f64 = 2.0;
    /// What noise may add, in radians.
    const NOISE: f64 = 0.05 * core::f64::consts::PI / 180.0;
    let parallax = |i: usize| {
        let (a, b) = pairs.get(i);
        (b_from_a.rotation * a.to_homogeneous()).angle(&b.to_homogeneous())
    };
    let all: Vec<f64> = (0..pairs.len()).map(parallax).collect();
    let mut sorted = all.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
    let (mut usual, mut squares) = (Vec::new(), 0.0);
    for (index, parallax) in (0..).zip(all) {
        if parallax <= TIMES * median + NOISE {
            usual.push(index);
            squares += parallax * parallax;
        }
    }
    (pairs.chosen(&usual), squares / usual.len() as f64)
}

#[cfg(test)]
mod tests;
