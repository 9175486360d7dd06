//! The candidates (labels) of a feature: the features of the other image that may show the same point.
//!
//! They are the nearest descriptors of 50 different places. Features are compared in blocks of at most 16,
//! each of which gives its nearest one. The nearest of these are taken, except those whose place is already
//! among the taken ones. A candidate is missed only if a nearer one shares its block.

use std::collections::HashMap;

use nalgebra::{Matrix2, Point2};

use super::super::{Correspondence, Correspondences, Search, two_nearest};
use crate::features::{Features, strongest};
use crate::params::ParamError;

/// Largest number of features in a block, and least number of blocks per label if there are that many features.
const BLOCK: usize = 16;
const BLOCKS_PER_LABEL: usize = 16;
/// Most features of the first image.
const MAX_NODES: usize = 20_000;
/// Most candidates per feature.
const MAX_LABELS: usize = 10_000;
/// So many places are compared faster than a grid is asked.
const FEW: usize = 64;

/// Search for several candidates per feature, for features that were found without simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct CandidateLabels {
    /// Largest number of features of the first image, those with the strongest response; 1 to 20,000, since each is
    /// compared with every other.
    pub nodes: usize,
    /// Largest number of candidates per feature; 1 to 10,000.
    pub labels: usize,
    /// Least distance between candidates of one feature, in thousandths of the diagonal of their image; at
    /// least 0.
    pub apart_px: f64,
}

impl Default for CandidateLabels {
    fn default() -> Self {
        Self {
            nodes: 1500,
            labels: 50,
            apart_px: 5.0,
        }
    }
}

/// A thousandth of the diagonal of the image of `features`, which is a pixel of the paper.
pub(super) fn pixel(features: &Features) -> f64 {
    let (width, height) = (features.size.width as f64, features.size.height as f64);
    (width * width + height * height).sqrt() / 1000.0
}

impl CandidateLabels {
    /// A search with at most so many nodes, and labels of each, at least `apart_px` from each other.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(nodes: usize, labels: usize, apart_px: f64) -> Result<Self, ParamError> {
        let search = Self {
            nodes,
            labels,
            apart_px,
        };
        search.check()?;
        Ok(search)
    }

    /// Refuses parameters out of range.
    pub(super) fn check(&self) -> Result<(), ParamError> {
        let allowed = (1..=MAX_NODES).contains(&self.nodes);
        ParamError::unless(allowed, "nodes", self.nodes, "1 to 20000")?;
        let allowed = (1..=MAX_LABELS).contains(&self.labels);
        ParamError::unless(allowed, "labels", self.labels, "1 to 10000")?;
        let fine = self.apart_px >= 0.0 && self.apart_px.is_finite();
        ParamError::unless(fine, "apart_px", self.apart_px, "at least 0 and finite")
    }

    /// Candidates in `b` of the features `nodes` of `a`, in the order of `nodes`, nearest first.
    /// [`Correspondence::second`] is the distance to the nearest descriptor at another place.
    pub(super) fn of(&self, nodes: &[usize], a: &Features, b: &Features) -> Correspondences {
        let queries = a.descriptors.select(nodes.iter().copied());
        let mut nearest = vec![Vec::new(); nodes.len()];
        // With no labels, which `new` refuses, none is found.
        let blocks = BLOCKS_PER_LABEL.saturating_mul(self.labels.max(1));
        let block = (b.len() / blocks).clamp(1, BLOCK);
        for first in (0..b.len()).step_by(block) {
            let rows = b.descriptors.select(first..(first + block).min(b.len()));
            for found in two_nearest(&queries, &rows) {
                nearest[found.a as usize].push((found.distance, first as u32 + found.b));
            }
        }
        let apart = (self.apart_px * pixel(b)) as f32;
        let mut candidates = Correspondences::new();
        for (&node, nearest) in nodes.iter().zip(&mut nearest) {
            nearest.sort_by(|i, j| i.0.total_cmp(&j.0).then(i.1.cmp(&j.1)));
            let own = candidates.len();
            let mut taken = Taken::new(apart);
            for &(distance, index) in nearest.iter() {
                if candidates.len() - own == self.labels {
                    break;
                }
                if taken.add(b.keypoints[index as usize].at) {
                    candidates.push(Correspondence {
                        a: node as u32,
                        b: index,
                        distance,
                        second: f32::INFINITY,
                    });
                }
            }
            let own = &mut candidates[own..];
            if let [first, second, ..] = *own {
                for m in own.iter_mut() {
                    m.second = first.distance;
                }
                own[0].second = second.distance;
            }
        }
        candidates
    }

    /// The strongest features that were found without simulation, in their order. Their frames are circles, or
    /// the ellipses that circles became when the image was resampled.
    fn unsimulated(&self, features: &Features) -> Vec<usize> {
        let [across, down] = features.stretch();
        let is_unsimulated = |&index: &usize| {
            let [xx, xy, yx, yy] = features.frame(index);
            is_circle([xx / across, xy / across, yx / down, yy / down])
        };
        let found: Vec<usize> = (0..features.len()).filter(is_unsimulated).collect();
        let response = |place: usize| features.keypoints[found[place]].response;
        let kept = strongest(found.len(), self.nodes, response);
        kept.into_iter().map(|place| found[place]).collect()
    }
}

impl Search for CandidateLabels {
    fn search(&self, a: &Features, b: &Features) -> Correspondences {
        self.of(&self.unsimulated(a), a, b)
    }
}

/// Places of candidates of one feature, none of which is near another.
struct Taken {
    /// Distance below which a place is near another.
    apart: f32,
    /// The first [`FEW`], which are compared with all.
    first: Vec<Point2<f32>>,
    /// The others, in those cells of a grid that have some. Places that are near each other are in the same cell or in
    /// cells that touch, so that few are compared, however many there are.
    cells: HashMap<[i64; 2], Vec<Point2<f32>>>,
}

impl Taken {
    /// None yet.
    fn new(apart: f32) -> Self {
        Self {
            apart,
            first: Vec::new(),
            cells: HashMap::new(),
        }
    }

    /// Takes a place, unless it is near one of those before.
    fn add(&mut self, at: Point2<f32>) -> bool {
        // Without a distance nothing is near.
        if self.apart == 0.0 {
            return true;
        }
        let is_near = |other: &Point2<f32>| (other - at).norm_squared() < self.apart * self.apart;
        if self.first.iter().any(is_near) {
            return false;
        }
        if self.first.len() < FEW {
            self.first.push(at);
            return true;
        }
        // A little wider than the distance, which is rounded. What is no number is near nothing, in whichever cell.
        let side = 1.001 * f64::from(self.apart);
        let cell = [at.x, at.y].map(|v| (f64::from(v) / side).floor() as i64);
        let is_free = (-1..=1).all(|across| {
            (-1..=1).all(|down| {
                let beside = [cell[0].saturating_add(across), cell[1].saturating_add(down)];
                let there = self.cells.get(&beside);
                !there.is_some_and(|places| places.iter().any(is_near))
            })
        });
        if is_free {
            self.cells.entry(cell).or_default().push(at);
        }
        is_free
    }
}

/// Whether a frame is a rotation and a scale, as for features that were found without simulation.
fn is_circle([xx, xy, yx, yy]: [f32; 4]) -> bool {
    let frame = Matrix2::new(xx, xy, yx, yy);
    // r + 1 / r for the ratio r of the axes; this one is 1.05, and rounding sizes makes 1.002.
    frame.norm_squared() < 2.0024 * frame.determinant().abs()
}
