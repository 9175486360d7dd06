//! GAIM: candidates of all features chosen together, by how their neighbourhoods map.
//!
//! T. Collins, P. Mesejo, A. Bartoli: "An Analysis of Errors in Graph-Based Keypoint Matching and
//! Proposed Solutions", European Conference on Computer Vision, 2014.
//!
//! 1. Nodes are the features of `a` that were seen without simulation; the labels of a node are its
//!    50 nearest descriptors among all features of `b`, simulated views included, at different
//!    places (`labels`).
//! 2. Each node is joined to its 35 nearest ones (`graph`).
//! 3. The cost of a choice of labels is a sum. Each node adds 5 times the distance of descriptors. Each pair
//!    of neighbours adds the error with which the affine frame of one predicts the place of the other, as a
//!    multiple of their distance, at most 0.4. Two nodes must not share a place (`energy`).
//! 4. The choice of least cost is sought by fusion moves (`fusion`, `moves`).
//! 5. Mismatches are removed: the chosen places are clustered, and the reverse problem is solved for the
//!    clusters. A match stays if its cluster leads back to near its node, and if it follows a smooth
//!    deformation of the matches around it (`mismatch`).
//!
//! | field | default | source |
//! | --- | --- | --- |
//! | `labels.nodes` | 1500 | - (bounds the time) |
//! | `labels.labels` | 50 | the paper |
//! | `labels.apart_px` | 5 | the paper |
//! | `neighbours` | 35 | the paper |
//! | `unary_weight` | 5 | the paper |
//! | `truncation` | 0.4 | the paper |
//! | `collision_px` | 1 | the paper |
//! | `rounds` | 2 | - |
//! | `cluster_px` | 10 | the paper |
//! | `consistency_px` | 20 | the paper |
//! | `smooth_neighbours` | 20 | - |
//! | `smooth_px` | 10 | - |
//!
//! Pixels are those of an image with a diagonal of 1000 pixels, as in the paper.
//!
//! *Differs from the paper*: moves are those of `moves`, not alpha expansions over labels; smooth
//! deformations are locally affine.

mod energy;
mod fusion;
mod graph;
mod labels;
mod max_flow;
mod mismatch;
mod moves;
mod quadratic;

pub use labels::CandidateLabels;

use super::correspondence::retain_masked;
use super::{Correspondence, Correspondences, Selector, View};
use crate::features::Features;
use crate::params::ParamError;
use crate::seed::Seed;
use energy::Problem;
use labels::pixel;

/// Parameters of [`Gaim`]. A pixel here is a thousandth of the diagonal of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct GaimParams {
    /// Nodes and their candidates, for both directions.
    pub labels: CandidateLabels,
    /// Number of nodes that each node is connected to, at least 1.
    pub neighbours: usize,
    /// Cost of a descriptor distance of 1, at least 0.
    pub unary_weight: f64,
    /// Largest cost of a pair of neighbours, above 0 and at most 10,000.
    pub truncation: f64,
    /// Least distance that neighbours must keep from each other, in thousandths of the diagonal of their image; at least
    /// 0.
    pub collision_px: f64,
    /// Number of rounds of moves, at least 1.
    pub rounds: usize,
    /// Radius of a cluster of chosen candidates, in thousandths of the diagonal of their image; at least 0.
    pub cluster_px: f64,
    /// A match is kept if the way back from its cluster ends within this distance of its node, in thousandths of the
    /// diagonal of the image of the node; positive.
    pub consistency_px: f64,
    /// Number of matches around a match with which its motion is compared, at least 3.
    pub smooth_neighbours: usize,
    /// Largest distance of a match from the place to which the motion of these maps it, in thousandths of the diagonal of
    /// the image of that place; positive.
    pub smooth_px: f64,
}

impl Default for GaimParams {
    fn default() -> Self {
        Self {
            labels: CandidateLabels::default(),
            neighbours: 35,
            unary_weight: 5.0,
            truncation: 0.4,
            collision_px: 1.0,
            rounds: 2,
            cluster_px: 10.0,
            consistency_px: 20.0,
            smooth_neighbours: 20,
            smooth_px: 10.0,
        }
    }
}

/// Selection among the candidates that [`CandidateLabels`] finds.
#[derive(Clone, Copy, Debug)]
pub struct Gaim {
    params: GaimParams,
}

impl Gaim {
    /// A selector with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: GaimParams) -> Result<Self, ParamError> {
        params.labels.check()?;
        for (name, value, least) in [
            ("neighbours", params.neighbours, 1),
            ("rounds", params.rounds, 1),
            ("smooth_neighbours", params.smooth_neighbours, 3),
        ] {
            ParamError::unless(value >= least, name, value, &format!("at least {least}"))?;
        }
        for (name, value) in [
            ("truncation", params.truncation),
            ("consistency_px", params.consistency_px),
            ("smooth_px", params.smooth_px),
        ] {
            let fine = value > 0.0 && value.is_finite();
            ParamError::unless(fine, name, value, "positive and finite")?;
        }
        for (name, value) in [
            ("unary_weight", params.unary_weight),
            ("collision_px", params.collision_px),
            ("cluster_px", params.cluster_px),
        ] {
            let fine = value >= 0.0 && value.is_finite();
            ParamError::unless(fine, name, value, "at least 0 and finite")?;
        }
        // Energies are whole numbers, and sums of very many.
        let (weight, truncation) = (params.unary_weight, params.truncation);
        ParamError::unless(weight <= 1e4, "unary_weight", weight, "0 to 10000")?;
        let range = "above 0 and at most 10000";
        ParamError::unless(truncation <= 1e4, "truncation", truncation, range)?;
        Ok(Self { params })
    }

    /// The best of `candidates` for each node, ordered by node.
    fn choose(&self, a: &Features, b: &Features, candidates: &[Correspondence]) -> Correspondences {
        let problem = Problem::new(a, b, candidates, &self.params, pixel(b));
        let choice = moves::solve(&problem, self.params.rounds);
        (problem.labels.iter().zip(choice))
            .map(|(labels, label)| candidates[labels[label].index])
            .collect()
    }

    /// Keeps matches that are found again in the direction from `b` to `a`.
    fn keep_consistent(&self, a: &Features, b: &Features, matches: &mut Correspondences) {
        let place = |m: &Correspondence| b.keypoints[m.b as usize].at;
        // The most certain matches represent those around them.
        matches.sort_by(|i, j| i.distance.total_cmp(&j.distance).then(i.a.cmp(&j.a)));
        let places: Vec<_> = matches.iter().map(place).collect();
        let founders = mismatch::clusters(&places, self.params.cluster_px * pixel(b));
        let mut nodes: Vec<usize> = founders.iter().map(|&f| matches[f].b as usize).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let candidates = self.params.labels.of(&nodes, b, a);
        let mut back = vec![None; b.len()];
        for m in self.choose(b, a, &candidates) {
            back[m.a as usize] = Some(a.keypoints[m.b as usize].at);
        }
        let radius = (self.params.consistency_px * pixel(a)) as f32;
        let consistent = (matches.iter().zip(&founders)).map(|(m, &founder)| {
            let back: Option<nalgebra::Point2<f32>> = back[matches[founder].b as usize];
            back.is_some_and(|back| (back - a.keypoints[m.a as usize].at).norm() < radius)
        });
        let consistent: Vec<bool> = consistent.collect();
        retain_masked(matches, &consistent);
        matches.sort_by_key(|m| m.a);
    }

    /// Keeps matches that move as the matches around them do.
    fn keep_smooth(&self, a: &Features, b: &Features, matches: &mut Correspondences) {
        let places = |features: &Features, index: fn(&Correspondence) -> u32| -> Vec<_> {
            let at = |m: &Correspondence| features.keypoints[index(m) as usize].at;
            matches.iter().map(|m| at(m).cast::<f64>().coords).collect()
        };
        let smooth = mismatch::smooth(
            &places(a, |m| m.a),
            &places(b, |m| m.b),
            self.params.smooth_neighbours,
            self.params.smooth_px * pixel(b),
            SMOOTH_ROUNDS,
        );
        retain_masked(matches, &smooth);
    }
}

/// Number of times that outliers are removed.
const SMOOTH_ROUNDS: usize = 3;

impl Selector for Gaim {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, _seed: Seed) {
        let (a, b) = (a.features, b.features);
        *matches = self.choose(a, b, matches);
        self.keep_consistent(a, b, matches);
        self.keep_smooth(a, b, matches);
    }

    fn uses_seed(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests;
