//! AdaLAM: the matches around a clear match are kept if more of them than chance allows follow one affine
//! map.
//!
//! L. Cavalli, V. Larsson, M. R. Oswald, T. Sattler, M. Pollefeys: "Handcrafted Outlier Detection Revisited",
//! ECCV 2020; as a preprint "AdaLAM: Revisiting Handcrafted Outlier Detection", arXiv:2006.04250, 2020.
//!
//! 1. Seeds are the clearest matches (nearest over second nearest distance) within a radius R in image a, of those
//!    that are each other's nearest and pass a ratio test. A circle of radius R covers 1 / r_a of the image.
//! 2. To the neighbourhood of a seed belong the matches within lambda R of it in both images whose keypoints turn
//!    and grow from a to b as those of the seed do.
//! 3. In each neighbourhood a linear map about the seed is looked for by sample consensus (see `neighbourhood`): two
//!    matches determine it, pairs of the clearest are drawn first, and always the same number of them.
//! 4. There is no threshold in pixels. Suppose that all N matches except the sample were wrong and spread
//!    evenly over the neighbourhood, whose radius is 1. Then N r^2 of them would come within r of where the
//!    map says. So the k nearest matches are inliers, for the largest k with k / (N r_k^2) >= t_c, where r_k is
//!    the residual of the k-th nearest match: t_c times as many as chance brings.
//! 5. The map with most inliers is fitted to them, and they are chosen again. If they are fewer than t_n more
//!    than chance brings, the neighbourhood is dropped. A match that any neighbourhood keeps is kept.
//!
//! With `keep_clear`, a match that may be a seed (by ratio, and mutual) is kept even if nothing around it
//! agrees: in an image of few features a neighbourhood holds too few matches to tell. This is ours.
//!
//! Step 4 is the rule of Benjamini and Hochberg (JRSS B 57(1), 1995), where r^2 is the probability that a
//! wrong match comes as near. The expected share of wrong matches among the inliers is at most 1 / t_c.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | r_a | `area_ratio` | 100 | the authors' program |
//! | lambda | `expansion` | 4 | the authors' program |
//! | | `seed_ratio` | 0.8 | the authors' program |
//! | | `mutual_seeds` | true | the authors' program |
//! | | `keep_clear` | false | the paper |
//! | t_alpha | `max_turn_deg` | 30 | the authors' program |
//! | t_sigma | `max_growth` | 1.5 | the authors' program |
//! | | `samples` | 128 | the authors' program |
//! | t_c | `confidence` | 200 | the authors' program |
//! | t_n | `min_inliers` | 6 | the authors' program |
//! | | `max_stretch` | 5 | the authors' program |
//! | | `refit` | true | the authors' program |
//!
//! *Choices the paper leaves open*: of equally clear matches near each other the first is the seed, unless a clearer one is
//! near it; then the next. (In the authors' program all of them are.) A keypoint without an
//! orientation or of size 0 agrees with every seed in it. Nothing is random: pairs are drawn in a fixed order.
//!
//! *Differs from the authors' program*: (1) The seed and the sample are kept together with the inliers that
//! they have. The program keeps as many matches as there are inliers without them, and so loses the farthest.
//! (2) Where no seed has a neighbourhood, nothing is kept; the program keeps what passes a ratio test. (3)
//! Duplicates count fully; the program lowers their weight where residuals agree in half precision. (4) Maps
//! that stretch too much are dropped as soon as they are drawn.

mod neighbourhood;

use nalgebra::Point2;

use super::correspondence::{clearest_first, retain_masked};
use super::mutual::keep_mutual;
use super::{Correspondence, Correspondences, Selector, View};
use crate::features::{Features, Keypoint};
use crate::image::Size;
use crate::params::ParamError;
use crate::seed::Seed;
use neighbourhood::Neighbourhood;

/// Parameters of [`Adalam`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AdalamParams {
    /// Area of an image divided by that of the circle in which a seed is the clearest match.
    pub area_ratio: f64,
    /// Radius of a neighbourhood divided by that of this circle.
    pub expansion: f64,
    /// Largest ratio of nearest and second nearest distance of a seed, itself excluded; sensible in `(0, 1]`. Unlike
    /// [`RatioTest`](super::RatioTest), a match without a second nearest passes.
    pub seed_ratio: f32,
    /// Whether the features of a seed must be each other's nearest.
    pub mutual_seeds: bool,
    /// Largest difference between the turns of a match and its seed, in degrees; 180 allows all.
    pub max_turn_deg: f64,
    /// Largest factor between the ratios of sizes of a match and its seed.
    pub max_growth: f64,
    /// Whether a match that may be a seed is kept in any case.
    pub keep_clear: bool,
    /// Number of pairs of matches that are drawn in each neighbourhood.
    pub samples: u32,
    /// The number of matches that agree with the map must be at least this many times the number expected by
    /// chance.
    pub confidence: f64,
    /// The number of matches that agree with the map must exceed the number expected by chance by at least
    /// this.
    pub min_inliers: u32,
    /// Largest change of lengths by a map, as a factor, relative to the sizes of the images.
    pub max_stretch: f64,
    /// Whether the best map is fitted again to its inliers.
    pub refit: bool,
}

impl Default for AdalamParams {
    fn default() -> Self {
        Self {
            area_ratio: 100.0,
            expansion: 4.0,
            seed_ratio: 0.8,
            mutual_seeds: true,
            keep_clear: false,
            max_turn_deg: 30.0,
            max_growth: 1.5,
            samples: 128,
            confidence: 200.0,
            min_inliers: 6,
            max_stretch: 5.0,
            refit: true,
        }
    }
}

/// Selection by significant local affine maps.
#[derive(Clone, Copy, Debug)]
pub struct Adalam {
    params: AdalamParams,
}

impl Adalam {
    /// A selector with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: AdalamParams) -> Result<Self, ParamError> {
        for (name, value) in [
            ("area_ratio", params.area_ratio),
            ("expansion", params.expansion),
            ("max_turn_deg", params.max_turn_deg),
        ] {
            let fine = value > 0.0 && value.is_finite();
            ParamError::unless(fine, name, value, "positive and finite")?;
        }
        for (name, value) in [
            ("max_growth", params.max_growth),
            ("confidence", params.confidence),
            ("max_stretch", params.max_stretch),
        ] {
            let fine = value > 1.0 && value.is_finite();
            ParamError::unless(fine, name, value, "above 1 and finite")?;
        }
        let ratio = params.seed_ratio;
        let allowed = ratio > 0.0 && ratio <= 1.0;
        ParamError::unless(allowed, "seed_ratio", ratio, "above 0 and at most 1")?;
        for (name, count) in [
            ("samples", params.samples),
            ("min_inliers", params.min_inliers),
        ] {
            ParamError::unless(count > 0, name, count, "at least 1")?;
        }
        Ok(Self { params })
    }

    /// Which of the `matches` between features of `a` and `b` are kept. Seeds are chosen among the matches for
    /// which `may_be_seed` is true, or among all if it is `None`. Descriptors are not used.
    ///
    /// # Panics
    /// If a match names a feature that is not there, or `may_be_seed` has another length.
    pub fn mask(
        &self,
        a: &Features,
        b: &Features,
        matches: &[Correspondence],
        may_be_seed: Option<&[bool]>,
    ) -> Vec<bool> {
        assert!(may_be_seed.is_none_or(|may| may.len() == matches.len()));
        let may_be_seed = |i: usize| may_be_seed.is_none_or(|may| may[i]);
        let order = clearest_first(matches);
        let candidates: Vec<Candidate> = (order.iter())
            .map(|&i| Candidate::new(&a.keypoints, &b.keypoints, &matches[i]))
            .collect();
        let clear = (order.iter())
            .take_while(|&&i| matches[i].ambiguity() < self.params.seed_ratio)
            .count();
        let radii = [a.size, b.size].map(|size| radius(size, self.params.area_ratio));
        let mut seeds = Vec::new();
        let mut kept = vec![false; matches.len()];
        for (at, &i) in order[..clear].iter().enumerate() {
            if may_be_seed(i) {
                seeds.push(at);
                kept[i] = self.params.keep_clear;
            }
        }
        for seed in clearest(&seeds, &candidates, radii[0]) {
            let reach = radii.map(|radius| self.params.expansion * radius);
            let members = self.members(&candidates, seed, reach);
            let around = Neighbourhood::new(&candidates, seed, &members, reach);
            let inliers = around.map(|around| around.inliers(&self.params));
            for inlier in inliers.unwrap_or_default() {
                kept[order[members[inlier]]] = true;
            }
        }
        kept
    }

    /// The candidates within `reach` of a seed that agree with it, including the seed: step 2.
    fn members(&self, candidates: &[Candidate], seed: usize, reach: [f64; 2]) -> Vec<usize> {
        let seed = &candidates[seed];
        let (near_a, near_b) = (reach[0] * reach[0], reach[1] * reach[1]);
        let agrees = |candidate: &Candidate| {
            (candidate.a - seed.a).norm_squared() < near_a
                && (candidate.b - seed.b).norm_squared() < near_b
                && candidate.turns_as(seed, self.params.max_turn_deg.to_radians())
                && candidate.grows_as(seed, self.params.max_growth)
        };
        let all = candidates.iter().enumerate();
        all.filter(|(_, candidate)| agrees(candidate))
            .map(|(at, _)| at)
            .collect()
    }

    /// For each of the `matches`, whether it may be a seed: whether its two features are each other's nearest.
    fn mutual(&self, a: View<'_>, b: View<'_>, matches: &[Correspondence]) -> Vec<bool> {
        let is_clear = |found: &Correspondence| found.ambiguity() < self.params.seed_ratio;
        let mut mutual: Correspondences = matches.iter().copied().filter(is_clear).collect();
        keep_mutual(a, b, &mut mutual, |_| ());
        // The mutual matches keep their order.
        let mut left = mutual.iter().peekable();
        (matches.iter())
            .map(|found| left.next_if(|&next| next == found).is_some())
            .collect()
    }
}

impl Selector for Adalam {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, _seed: Seed) {
        let mutual = (self.params.mutual_seeds).then(|| self.mutual(a, b, matches));
        let kept = self.mask(a.features, b.features, matches, mutual.as_deref());
        retain_masked(matches, &kept);
    }

    fn uses_seed(&self) -> bool {
        false
    }
}

/// Radius of the circle that covers `1 / area_ratio` of an image, in pixels.
fn radius(size: Size, area_ratio: f64) -> f64 {
    let area = size.width as f64 * size.height as f64;
    (area / (area_ratio * core::f64::consts::PI)).sqrt()
}

/// Those of `seeds`, sorted by clarity, that have within `radius` in image a neither a clearer one nor an equally clear one
/// that was taken: step 1.
fn clearest(seeds: &[usize], candidates: &[Candidate], radius: f64) -> Vec<usize> {
    let near =
        |i: usize, j: usize| (candidates[i].a - candidates[j].a).norm_squared() < radius * radius;
    let mut taken: Vec<usize> = Vec::new();
    // The place of the first of the equally clear ones.
    let mut first = 0;
    for (at, &seed) in seeds.iter().enumerate() {
        if candidates[seeds[first]].ambiguity < candidates[seed].ambiguity {
            first = at;
        }
        // Matches that are equally clear, as those of unmistakable features are, would rule each other out in a chain
        // across the image, if those counted that were not taken.
        let mut others = seeds[..first].iter().chain(&taken);
        if !others.any(|&other| near(other, seed)) {
            taken.push(seed);
        }
    }
    taken
}

/// A match, with the data that neighbourhoods use.
struct Candidate {
    a: Point2<f64>,
    b: Point2<f64>,
    ambiguity: f32,
    /// From the orientation in a to that in b, in radians.
    turn: Option<f64>,
    /// Size in b over size in a.
    growth: Option<f64>,
}

impl Candidate {
    fn new(a: &[Keypoint], b: &[Keypoint], found: &Correspondence) -> Self {
        let (a, b) = (&a[found.a as usize], &b[found.b as usize]);
        let has_size = a.size > 0.0 && b.size > 0.0;
        Self {
            a: a.at.cast(),
            b: b.at.cast(),
            ambiguity: found.ambiguity(),
            turn: a
                .angle
                .zip(b.angle)
                .map(|(a, b)| f64::from(b) - f64::from(a)),
            growth: has_size.then(|| f64::from(b.size) / f64::from(a.size)),
        }
    }

    /// Whether the two turns differ by less than `most` radians.
    fn turns_as(&self, seed: &Self, most: f64) -> bool {
        const TURN: f64 = core::f64::consts::TAU;
        self.turn.zip(seed.turn).is_none_or(|(turn, of_seed)| {
            let between = (turn - of_seed).abs() % TURN;
            between.min(TURN - between) < most
        })
    }

    /// Whether the two ratios of sizes differ by a factor below `most`.
    fn grows_as(&self, seed: &Self, most: f64) -> bool {
        self.growth
            .zip(seed.growth)
            .is_none_or(|(growth, of_seed)| {
                let rate = of_seed / growth;
                rate < most && rate * most > 1.0
            })
    }
}

#[cfg(test)]
mod tests;
