//! The fundamental matrix of two views, from seven matches at a time.
//!
//! The matches are at depth 1, so what is found is `K_b^T F K_a` (see [`seven_point`]): in the coordinates of the
//! cameras the equations are well conditioned, and the result needs no conversion. It need not be an essential
//! matrix; the nearest one is taken when it is decomposed.
//!
//! Local optimisation is the normalised eight-point algorithm over the inliers (Hartley, "In Defense
//! of the Eight-Point Algorithm", PAMI 19(6), 1997), with the singularity enforced afterwards.

use std::ops::Range;

use nalgebra::Matrix3;

use super::Problem;
use super::degensac::off_the_plane;
use super::linear::{Normalised, least_violating, refit};
use crate::geometry::solvers::{Solutions, seven_point};
use crate::geometry::{PointPairs, squared_sampson_distances};
use crate::seed::Rng;

/// The problem of a fundamental matrix; residuals are squared Sampson distances.
#[derive(Clone, Copy, Debug)]
pub struct FundamentalProblem<'a> {
    /// The matches, at depth 1.
    pub pairs: &'a PointPairs,
    /// Whether a matrix whose sample lies mostly on one plane is replaced by one that also explains
    /// matches off the plane.
    pub degensac: bool,
}

impl Problem for FundamentalProblem<'_> {
    type Model = Matrix3<f64>;
    type Models = Solutions<Matrix3<f64>, 4>;
    const SAMPLE: usize = 7;

    fn len(&self) -> usize {
        self.pairs.len()
    }

    fn solve(&self, sample: &[u32]) -> Self::Models {
        let point = |i: usize| self.pairs.get(sample[i] as usize);
        seven_point(
            &std::array::from_fn(|i| point(i).0),
            &std::array::from_fn(|i| point(i).1),
        )
    }

    fn squared_residuals(&self, model: &Matrix3<f64>, range: Range<usize>, out: &mut [f64]) {
        squared_sampson_distances(model, self.pairs, range, out);
    }

    fn resolve_degeneracy(
        &self,
        model: &Matrix3<f64>,
        sample: &[u32],
        squared_threshold: f64,
        rng: &mut Rng,
    ) -> Option<Matrix3<f64>> {
        if !self.degensac {
            return None;
        }
        off_the_plane(model, sample, self.pairs, squared_threshold, rng)
    }

    fn refine(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        steps: usize,
    ) -> Option<Matrix3<f64>> {
        refit(self, model, squared_threshold, steps, 8, |inliers| {
            eight_point(self.pairs, inliers)
        })
    }
}

/// The singular matrix with the least algebraic error over the `matches`.
fn eight_point(pairs: &PointPairs, matches: &[u32]) -> Option<Matrix3<f64>> {
    let Normalised {
        matrix,
        from_a,
        from_b,
    } = least_violating(pairs, matches)?;
    let mut svd = matrix.svd(true, true);
    let least = svd.singular_values.imin();
    svd.singular_values[least] = 0.0;
    let singular = svd.recompose().ok()?;
    let f = from_b.transpose() * singular * from_a;
    (f.norm() > 0.0).then(|| f.normalize())
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::super::degensac::tests::matches_of_a_plane;
    use super::*;
    use crate::geometry::{RelativePose, essential_from_pose};
    use crate::robust::{
        Consensus, ConsensusParams, Extras, InlierCount, Uniform, consensus_until,
    };
    use crate::seed::Seed;

    #[test]
    fn refining_comes_closer_to_the_truth() {
        let truth = RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2),
            direction: UnitVector3::new_normalize(Vector3::new(0.8, 0.1, 0.3)),
        };
        let mut rng = Seed(3).rng();
        let pairs: PointPairs = (0..200)
            .map(|_| {
                let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                let depth = 2.0 + 6.0 * rng.uniform();
                let x =
                    truth.rotation * (a.to_homogeneous() * depth) + truth.direction.into_inner();
                (a, Point2::new(x.x / x.z + 2e-4 * rng.normal(), x.y / x.z))
            })
            .collect();
        let e = essential_from_pose(&truth).normalize();
        let problem = FundamentalProblem {
            pairs: &pairs,
            degensac: false,
        };
        let start = (e + Matrix3::from_fn(|i, j| 2e-3 * ((3 * i + j) as f64 - 4.0))).normalize();
        let refined = problem.refine(&start, 1e-4, 2).expect("most are inliers");
        let distance = |f: &Matrix3<f64>| (f - e).norm().min((f + e).norm());
        assert!(refined.determinant().abs() < 1e-12);
        assert!(distance(&refined) < 0.5 * distance(&start));
        assert_eq!(problem.refine(&start, 1e-30, 2), None);
    }

    fn find(pairs: &PointPairs, degensac: bool, seed: u64) -> Consensus<Matrix3<f64>> {
        consensus_until(
            &FundamentalProblem { pairs, degensac },
            &InlierCount {
                squared_threshold: 1e-6,
            },
            &mut Uniform::new(pairs.len()),
            ConsensusParams {
                confidence: 0.99,
                max_samples: 2000,
            },
            Extras::NONE,
            &mut Seed(seed).rng(),
            &|_| false,
        )
        .expect("a matrix")
    }

    #[test]
    fn what_is_off_the_plane_is_found() {
        let pairs = matches_of_a_plane(160, 24, 16);
        // How many of the matches before the plane agree, over ten seeds.
        let before = |degensac| -> usize {
            (0..10)
                .map(|seed| find(&pairs, degensac, seed).inliers)
                .map(|inliers| inliers.iter().filter(|i| (160..184).contains(*i)).count())
                .sum()
        };
        let (with, without) = (before(true), before(false));
        assert!(with >= 220 && without + 40 <= with, "{with} {without}");
    }
}
