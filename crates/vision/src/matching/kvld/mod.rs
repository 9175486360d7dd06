//! KVLD: a match stays if virtual lines to enough of its neighbours look the same in both images.
//!
//! Z. Liu, R. Marlet: "Virtual Line Descriptor and Semi-Local Matching Method for Reliable Feature
//! Correspondence", British Machine Vision Conference (BMVC) 2012.
//!
//! 1. Two matches are compared by geometry: each predicts, by the similarity between its own two
//!    keypoints, where the other lies; the error relative to the length of the line between them
//!    must be below `max_geometry`.
//! 2. And by photometry: the line between the two keypoints is described in both images (see
//!    `virtual_line`); the distance of the descriptors must be below `max_distance`.
//! 3. Neighbours of a match lie within a radius. It is chosen so that `EXPECTED` right matches are expected
//!    in it if a share `inlier_rate` of all matches is right. Neighbours are not nearer than `min_length_px`.
//!    Comparing ends when a match has `max_neighbours` consistent ones.
//! 4. Until nothing changes, matches are dropped by three rules. A match with fewer than `least_neighbours`
//!    consistent neighbours is dropped. Of several matches at one place, only the one with most of them
//!    stays; among equals, that of most similar lines. A match is dropped if less than `least_share` of its
//!    neighbours are consistent.
//! 5. If a smaller share than `inlier_rate` is kept, all is done again with half the rate, so with
//!    sqrt(2) times the radius, and `least_neighbours` 2. At most five rates are tried, the first included.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | chi | `max_geometry` | 0.5 | the authors' program |
//! | tau | `max_distance` | 0.35 | the authors' program |
//! | gamma | `inlier_rate` | 0.04 | the authors' program |
//! | | `min_length_px` | 10 | the authors' program |
//! | | `max_neighbours` | 20 | the authors' program |
//! | K | `least_neighbours` | 3 | the authors' program |
//! | | `least_share` | 0.3 | the authors' program, which applies it to another share |
//!
//! *Choices the paper leaves open*: matches are compared in the order of their ratio of nearest to
//! second nearest distance, the clearest first. The geometric error of a pair is the mean over the
//! four predictions (either match, in either direction).
//!
//! *Differences from the authors' program* (KVLD 1.0, Liu and Moulon), from which the values above are taken, though
//! its rules are others in these points:
//!
//! - Geometry: it predicts from a to b alone, takes the better of both matches, and divides by the shorter of the
//!   predicted and the seen line.
//! - Photometry: the distance of dominant directions counts twice as much. A direction weighs by how much stronger it
//!   is than the opposite one. The weight of a pixel falls to exp(-1/4.5) at the edge of a disc (here to exp(-2)), discs
//!   have 5 to 7.1 pixels of their level (here 3 to 4.2), and lines are left out for too much contrast, not for too
//!   little.
//! - Neighbours: near in a or in b (here in a), in a radius for 3 right matches (here 5). They are searched again among
//!   the matches that are left, each time that some were dropped.
//! - `least_share` there is of neighbours that agree in geometry alone, and a match stays all the same if its mean
//!   geometric error is at most 1.2. So it drops fewer matches.
//! - `least_neighbours` becomes 2 only if nothing was kept, and the radius grows by the square root of 2 once more than
//!   the rate alone makes it grow.

mod consistency;
mod gradients;
mod virtual_line;

use super::correspondence::{clearest_first, retain_masked};
use super::{Correspondences, Selector, View};
use crate::params::ParamError;
use crate::seed::Seed;
use consistency::{Graph, Lines, Placed};

/// Parameters of [`Kvld`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct KvldParams {
    /// Largest error when one match is predicted by another, relative to their distance.
    pub max_geometry: f32,
    /// Largest distance between the descriptors of a line in the two images.
    pub max_distance: f32,
    /// Share of right matches that is assumed at first, in `(0, 1]`.
    pub inlier_rate: f64,
    /// Least distance of neighbours, in pixels, in both images.
    pub min_length_px: f32,
    /// Number of consistent neighbours that are searched for.
    pub max_neighbours: u32,
    /// Least number of consistent neighbours of a match, at least 1.
    pub least_neighbours: u32,
    /// Least share of its neighbours with which a match must be consistent, in `[0, 1]`.
    pub least_share: f32,
}

impl Default for KvldParams {
    fn default() -> Self {
        Self {
            max_geometry: 0.5,
            max_distance: 0.35,
            inlier_rate: 0.04,
            min_length_px: 10.0,
            max_neighbours: 20,
            least_neighbours: 3,
            least_share: 0.3,
        }
    }
}

/// Number of inlier rates that are tried.
const ATTEMPTS: usize = 5;

/// Selection by virtual lines.
#[derive(Clone, Copy, Debug)]
pub struct Kvld {
    params: KvldParams,
}

impl Kvld {
    /// A selector with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: KvldParams) -> Result<Self, ParamError> {
        for (name, value) in [
            ("max_geometry", params.max_geometry),
            ("max_distance", params.max_distance),
            ("min_length_px", params.min_length_px),
        ] {
            let fine = value > 0.0 && value.is_finite();
            ParamError::unless(fine, name, value, "positive and finite")?;
        }
        let (rate, share) = (params.inlier_rate, params.least_share);
        ParamError::unless(
            rate > 0.0 && rate <= 1.0,
            "inlier_rate",
            rate,
            "above 0 and at most 1",
        )?;
        ParamError::unless((0.0..=1.0).contains(&share), "least_share", share, "0 to 1")?;
        for (name, count) in [
            ("max_neighbours", params.max_neighbours),
            ("least_neighbours", params.least_neighbours),
        ] {
            ParamError::unless(count > 0, name, count, "at least 1")?;
        }
        let (least, most) = (params.least_neighbours, params.max_neighbours);
        ParamError::unless(
            least <= most,
            "least_neighbours",
            least,
            &format!("at most `max_neighbours`, {most}: comparing ends there"),
        )?;
        Ok(Self { params })
    }

    /// For each match, whether it is kept.
    fn decide(&self, placed: &[Placed], lines: &Lines) -> Vec<bool> {
        let mut kept = vec![false; placed.len()];
        let mut params = self.params;
        for _ in 0..ATTEMPTS {
            let graph = Graph::new(placed, lines, &params);
            kept = graph.prune(placed, &params);
            let count = kept.iter().filter(|&&kept| kept).count();
            if count as f64 >= params.inlier_rate * placed.len() as f64 {
                break;
            }
            params.inlier_rate *= 0.5;
            params.least_neighbours = params.least_neighbours.min(2);
        }
        kept
    }
}

impl Selector for Kvld {
    /// # Panics
    /// If a view has no image.
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, _seed: Seed) {
        let order = clearest_first(matches);
        let placed: Vec<Placed> = (order.iter())
            .map(|&i| Placed::new(a.features, b.features, &matches[i]))
            .collect();
        let asked = "`uses_pixels` says that images are needed";
        let lines = Lines::new(a.image.expect(asked), b.image.expect(asked));
        let decided = self.decide(&placed, &lines);
        let mut kept = vec![false; matches.len()];
        for (&i, decided) in order.iter().zip(decided) {
            kept[i] = decided;
        }
        retain_masked(matches, &kept);
    }

    fn uses_pixels(&self) -> bool {
        true
    }

    fn uses_seed(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests;
