//! Poses that the plane of a scene allows, as rivals of one that was found.
//!
//! Matches on one plane allow two poses ([`essentials_of_plane`]), and only the matches off the plane decide
//! between them. Where nearly everything is on the plane, samples of five with enough matches off it are rare. With
//! noise, many other poses between and around the two agree with most matches too, and the search ends at one of
//! them. So at its end
//!
//! 1. a homography is looked for among the matches that agree with the best pose, by sample consensus with local
//!    optimisation;
//! 2. if half of them agree with the homography, its two poses are refined like a new best model, and the best of
//!    the three poses is kept.
//!
//! The idea to look for planes is from Chum, Werner, Matas, "Two-View Geometry Estimation Unaffected by a Dominant
//! Plane", CVPR 2005. They need it for fundamental matrices, which a plane leaves undetermined (see
//! [`degensac`](super::degensac)). An essential matrix is determined by a plane up to the choice of two, so matches
//! off the plane need not be sampled.
//!
//! | symbol | constant | value | source |
//! | --- | --- | --- | --- |
//! | | `ON_THE_PLANE` | 0.5 of the inliers | tuned: 0.3 does as well, with 0.7 half of the gain is lost |
//! | | `SAMPLES` | 50 at most | ours: where half are on the plane, 96 % sure |
//! | | `SQUARED_SLACK` | 4 | as for fundamental matrices |
//! | | `SQUARED_ROUNDING` | 1e-24 at depth 1 | ours: what rounding leaves; the threshold of a least median may be 0 |

use nalgebra::Matrix3;

use super::{ConsensusParams, Extras, HomographyProblem, Msac, Problem, Uniform, consensus_until};
use crate::geometry::{PointPairs, essentials_of_plane};
use crate::seed::Rng;

const ON_THE_PLANE: f64 = 0.5;
const SAMPLES: usize = 50;
const SQUARED_SLACK: f64 = 4.0;
const SQUARED_ROUNDING: f64 = 1e-24;

/// If at least half of these matches, which agree with one pose, lie on a plane: the essential matrices that
/// this plane allows. Otherwise none.
pub(super) fn plane_poses(
    inliers: &PointPairs,
    squared_threshold: f64,
    rng: &mut Rng,
) -> Vec<Matrix3<f64>> {
    let problem = HomographyProblem {
        pairs: inliers,
        one_side: true,
    };
    let score = Msac {
        squared_threshold: (SQUARED_SLACK * squared_threshold).max(SQUARED_ROUNDING),
    };
    let found = consensus_until(
        &problem,
        &score,
        &mut Uniform::new(inliers.len()),
        ConsensusParams {
            confidence: 0.99,
            max_samples: SAMPLES,
        },
        Extras {
            min_samples: 10,
            local_steps: 3,
            sprt: false,
            hypotheses: 1,
            hopeless_after: None,
        },
        rng,
        &|_| false,
    );
    let plane = found.filter(|found| {
        // A few matches lie on some plane by chance.
        let on_it = found.inliers.len();
        on_it > HomographyProblem::SAMPLE && on_it as f64 >= ON_THE_PLANE * inliers.len() as f64
    });
    plane.map_or_else(Vec::new, |found| essentials_of_plane(&found.model).to_vec())
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::geometry::transfer;
    use crate::robust::degensac::tests::matches_of_a_plane;
    use crate::seed::Seed;

    #[test]
    fn a_plane_has_two_poses_and_a_scene_in_depth_none() {
        let found = |pairs: &PointPairs| plane_poses(pairs, 4e-7, &mut Seed(1).rng()).len();
        assert_eq!(found(&matches_of_a_plane(90, 10, 0)), 2);
        // Half of them are enough.
        assert_eq!(found(&matches_of_a_plane(60, 40, 0)), 2);
        assert_eq!(found(&matches_of_a_plane(40, 60, 0)), 0);
        assert_eq!(found(&matches_of_a_plane(0, 100, 0)), 0);
        for few in 0..5 {
            assert_eq!(found(&matches_of_a_plane(few, 0, 0)), 0);
        }
    }

    /// The threshold of a least median is 0 if most matches are exact.
    #[test]
    fn exact_matches_of_a_plane_need_no_threshold() {
        let mut rng = Seed(2).rng();
        let tilted = Matrix3::new(1.1, 0.05, 0.1, -0.1, 0.9, 0.02, 0.1, -0.2, 1.0);
        let pairs: PointPairs = (0..50)
            .map(|_| {
                let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                (a, transfer(&tilted, a))
            })
            .collect();
        assert_eq!(plane_poses(&pairs, 0.0, &mut Seed(1).rng()).len(), 2);
    }
}
