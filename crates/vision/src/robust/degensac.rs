//! What to do where a fundamental matrix comes from a plane.
//!
//! Chum, Werner, Matas, "Two-View Geometry Estimation Unaffected by a Dominant Plane", CVPR 2005.
//!
//! A plane with homography H agrees with every matrix `[e]_x H`, whatever the epipole e is. If five or
//! more of the seven matches of a sample lie on the plane, the others fix e, rightly or not. All matches
//! on the plane are inliers either way, so a matrix with a wrong epipole can have the best score. So,
//! whenever a matrix becomes the best:
//!
//! 1. Each of five triplets of its sample, of which any five matches on a plane contain one, gives a
//!    homography together with F: `H = A - e (M^-1 b)^T`, with e the epipole in b, `A = [e]_x F`, and M
//!    and b from the triplet (Hartley, Zisserman, 2nd edition, result 13.6).
//! 2. If five of the seven agree with one of the homographies, the sample is degenerate.
//! 3. Then two matches off the plane determine F: `F = [e]_x H`, where the lines through b and H a of both
//!    meet in e (plane and parallax). The pair of matches whose F most matches agree with is searched
//!    for by sampling.
//!
//! | symbol | constant | value | source |
//! | --- | --- | --- | --- |
//! | | `DRAWS` | 200 | ours: 99.9 % sure where a fifth of what is off the plane is right |
//! | | `SQUARED_SLACK` | 4 | ours: a sample's homography is rough, so it may be off by twice the threshold |
//! | | `REFINEMENTS` | 2 | ours: steps of Levenberg and Marquardt in which the homography is refined |

use nalgebra::{Matrix3, Point2, Vector3};

use super::{HomographyProblem, Problem};
use crate::geometry::{
    PointPairs, epipole_in_b, squared_sampson_distances, squared_transfer_distances,
};
use crate::seed::Rng;
use crate::simd;

const DRAWS: usize = 200;
const SQUARED_SLACK: f64 = 4.0;
const REFINEMENTS: usize = 2;

/// Any five of the seven matches contain at least one of these triplets.
const TRIPLETS: [[usize; 3]; 5] = [[0, 1, 2], [3, 4, 5], [0, 1, 6], [3, 4, 6], [2, 5, 6]];

/// If five matches of the `sample` of `f` lie on a plane: the best matrix from this plane and from parallax off
/// it. `None` if there is no such plane, or if no match is off it.
pub(super) fn off_the_plane(
    f: &Matrix3<f64>,
    sample: &[u32],
    pairs: &PointPairs,
    squared_threshold: f64,
    rng: &mut Rng,
) -> Option<Matrix3<f64>> {
    let rough = plane_of(f, sample, pairs, SQUARED_SLACK * squared_threshold)?;
    let plane = HomographyProblem {
        pairs,
        one_side: false,
    };
    let h = plane
        .refine(&rough, SQUARED_SLACK * squared_threshold, REFINEMENTS)
        .unwrap_or(rough);
    let mut residuals = vec![0.0; pairs.len()];
    squared_transfer_distances(&h, pairs, 0..pairs.len(), &mut residuals);
    let off: Vec<usize> = (residuals.iter().enumerate())
        .filter(|&(_, &squared)| squared > SQUARED_SLACK * squared_threshold && squared.is_finite())
        .map(|(index, _)| index)
        .collect();
    let count = u32::try_from(off.len()).ok().filter(|&count| count >= 2)?;
    // The line through b and H a.
    let line = |index: usize| {
        let (a, b) = pairs.get(index);
        b.to_homogeneous().cross(&(h * a.to_homogeneous()))
    };
    let mut best: Option<(usize, Matrix3<f64>)> = None;
    for _ in 0..DRAWS {
        let [i, j] = [(); 2].map(|()| off[rng.below(count) as usize]);
        let epipole = line(i).cross(&line(j));
        let candidate = epipole.cross_matrix() * h;
        let norm = candidate.norm();
        if i == j || !(norm.is_finite() && norm > 0.0) {
            continue;
        }
        let candidate = candidate / norm;
        squared_sampson_distances(&candidate, pairs, 0..pairs.len(), &mut residuals);
        let inliers = simd::count_at_most(&residuals, squared_threshold);
        if best.is_none_or(|(most, _)| inliers > most) {
            best = Some((inliers, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// The homography with which five matches of the sample agree.
fn plane_of(
    f: &Matrix3<f64>,
    sample: &[u32],
    pairs: &PointPairs,
    squared_limit: f64,
) -> Option<Matrix3<f64>> {
    let sampled = pairs.chosen(sample);
    let mut residuals = vec![0.0; sampled.len()];
    TRIPLETS.iter().find_map(|triplet| {
        let h = homography_of(f, triplet.map(|i| sampled.get(i)))?;
        squared_transfer_distances(&h, &sampled, 0..sampled.len(), &mut residuals);
        (simd::count_at_most(&residuals, squared_limit) >= 5).then_some(h)
    })
}

/// The homography that is compatible with F and maps three points of a to those of b.
fn homography_of(
    f: &Matrix3<f64>,
    triplet: [(Point2<f64>, Point2<f64>); 3],
) -> Option<Matrix3<f64>> {
    let epipole = epipole_in_b(f).try_normalize(0.0)?;
    let compatible = epipole.cross_matrix() * f;
    let offset = |(a, b): (Point2<f64>, Point2<f64>)| {
        let (a, b) = (a.to_homogeneous(), b.to_homogeneous());
        let to_epipole = b.cross(&epipole);
        b.cross(&(compatible * a)).dot(&to_epipole) / to_epipole.norm_squared()
    };
    let rows = triplet.map(|(a, _)| a.to_homogeneous().transpose());
    let plane = Matrix3::from_rows(&rows).try_inverse()? * Vector3::from(triplet.map(offset));
    let h = compatible - epipole * plane.transpose();
    h.iter().all(|x| x.is_finite()).then_some(h)
}

#[cfg(test)]
pub(super) mod tests {
    use nalgebra::{UnitQuaternion, UnitVector3};

    use super::*;
    use crate::geometry::{RelativePose, essential_from_pose};
    use crate::seed::Seed;

    fn truth() -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.05, -0.15, 0.02),
            direction: UnitVector3::new_normalize(Vector3::new(0.9, 0.1, 0.3)),
        }
    }

    /// Matches on a plane, then some before it, then wrong ones.
    pub(in crate::robust) fn matches_of_a_plane(
        plane: usize,
        before: usize,
        wrong: usize,
    ) -> PointPairs {
        let mut rng = Seed(8).rng();
        (0..plane + before + wrong)
            .map(|i| {
                let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                let wall = 8.0 / (1.0 + 0.4 * a.x);
                let near = wall * (0.3 + 0.4 * rng.uniform());
                let depth = if i < plane { wall } else { near };
                let x = truth().rotation * (a.to_homogeneous() * depth)
                    + truth().direction.into_inner();
                let b = Point2::new(
                    x.x / x.z + 2e-4 * rng.normal(),
                    x.y / x.z + 2e-4 * rng.normal(),
                );
                let anywhere = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                (a, if i < plane + before { b } else { anywhere })
            })
            .collect()
    }

    #[test]
    fn the_homography_of_three_matches_and_f_is_that_of_their_plane() {
        let pairs = matches_of_a_plane(20, 0, 0);
        let e = essential_from_pose(&truth());
        let h = homography_of(&e, [0, 1, 2].map(|i| pairs.get(i))).expect("a plane");
        let mut residuals = vec![0.0; 20];
        squared_transfer_distances(&h, &pairs, 0..20, &mut residuals);
        assert!(residuals.iter().all(|&r| r < 1e-4), "{residuals:?}");
    }

    /// A match without noise, on the plane or at this share of its depth, and moved in `b` so far along its epipolar line.
    fn exact(rng: &mut Rng, share: f64, along: f64) -> (Point2<f64>, Point2<f64>) {
        let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
        let x = truth().rotation * (a.to_homogeneous() * (share * 8.0 / (1.0 + 0.4 * a.x)))
            + truth().direction.into_inner();
        let b = Point2::new(x.x / x.z, x.y / x.z);
        let epipole = truth().direction;
        let line = b - Point2::new(epipole.x / epipole.z, epipole.y / epipole.z);
        (a, b + along * line.normalize())
    }

    #[test]
    fn a_sample_is_degenerate_where_any_five_of_the_seven_lie_on_a_plane() {
        let e = essential_from_pose(&truth());
        let sample = [0, 1, 2, 3, 4, 5, 6];
        let rng = &mut Seed(6).rng();
        for chosen in 0..1_u32 << 7 {
            let pairs: PointPairs = (0..7)
                .map(|i| {
                    let share = if chosen >> i & 1 == 1 {
                        1.0
                    } else {
                        0.3 + 0.4 * rng.uniform()
                    };
                    exact(rng, share, 0.0)
                })
                .collect();
            let found = plane_of(&e, &sample, &pairs, 1e-12);
            let on_it = chosen.count_ones();
            assert_eq!(found.is_some(), on_it >= 5, "{on_it} of {chosen:07b}");
        }
    }

    /// Matches are moved along their epipolar lines, so that F agrees with all of them.
    #[test]
    fn on_the_plane_is_what_lies_within_twice_the_threshold_of_it() {
        let e = essential_from_pose(&truth());
        let sample = [0, 1, 2, 3, 4, 5, 6];
        let threshold = 1e-3;
        let is_found = |matches: [(f64, f64); 7]| {
            let rng = &mut Seed(7).rng();
            let pairs = matches.map(|(share, moved)| exact(rng, share, moved * threshold));
            let pairs = pairs.into_iter().collect();
            let squared = threshold * threshold;
            off_the_plane(&e, &sample, &pairs, squared, &mut Seed(1).rng()).is_some()
        };
        let on = (1.0, 0.0);
        // The fifth match of the plane.
        let degenerate = |moved| is_found([on, on, on, on, (1.0, moved), (0.4, 0.0), (0.6, 0.0)]);
        assert!(degenerate(1.8) && !degenerate(2.2));
        // The two matches that give the epipole.
        let off = |moved| is_found([on, on, on, on, on, (1.0, moved), (1.0, -moved)]);
        assert!(!off(1.8) && off(2.2));
        // One alone gives none.
        assert!(!is_found([on, on, on, on, on, on, (0.4, 0.0)]));
    }

    #[test]
    fn a_sample_off_the_plane_is_left_alone() {
        let pairs = matches_of_a_plane(0, 30, 0);
        let e = essential_from_pose(&truth());
        let sample = [0, 1, 2, 3, 4, 5, 6];
        let found = off_the_plane(&e, &sample, &pairs, 1e-6, &mut Seed(1).rng());
        assert_eq!(found, None);
        let nan = Matrix3::from_element(f64::NAN);
        let found = off_the_plane(&nan, &sample, &pairs, 1e-6, &mut Seed(1).rng());
        assert_eq!(found, None);
    }
}
