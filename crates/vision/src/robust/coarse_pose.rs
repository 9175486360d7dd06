//! The pose that a coarse one leads to.
//!
//! A pose that was read off a fundamental matrix, or that a few matches determine, can be right within degrees and still pass
//! most right matches by more pixels than matches that agree with it may be off. Such a pose looks like one of matches that
//! agree by chance. But a refinement over all matches, with a loss that bounds the influence of wrong ones, leads from
//! it to a pose that the right matches are near, if there are some. From a pose that was refined it leads nowhere else, and
//! from one of wrong matches to another of wrong matches.
//!
//! | constant | value | source |
//! | --- | --- | --- |
//! | `SCALES_PX` | 8, 4 and 2 pixels | ours: right matches are some pixels off |
//! | `STEPS` | 10 | ours |
//! | `MATCHES` | 500 | ours: enough to determine a pose, so that very many matches cost no more |
//! | `MORE` | 2 | ours; looked at on castle and TUM |

use crate::geometry::{Loss, PointPairs, RelativePose, refine_pose};

/// Scales of the loss, one refinement after the other.
const SCALES_PX: [f64; 3] = [8.0, 4.0, 2.0];
/// Steps of each refinement.
const STEPS: usize = 10;
/// Matches of a refinement, evenly spaced in their list.
const MATCHES: usize = 500;
/// A pose is coarse if the one that it leads to has so many times as many near matches, or more.
pub(super) const MORE: usize = 2;

/// The pose that refinements over all `pairs` lead to from `pose`. They are at depth 1, where `focal` pixels are a unit.
pub(super) fn finer_pose(pose: &RelativePose, pairs: &PointPairs, focal: f64) -> RelativePose {
    let some = pairs.len().min(MATCHES);
    let indices: Vec<u32> = (0..some).map(|i| (i * pairs.len() / some) as u32).collect();
    let some = pairs.chosen(&indices);
    SCALES_PX.iter().fold(*pose, |pose, scale| {
        let scale = scale / focal;
        refine_pose(&pose, &some, Loss::Cauchy, scale * scale, STEPS)
    })
}
