//! The homography of two views, from four matches at a time. Views of a plane, and views from one place, are
//! related by a homography.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 4.7.
//!
//! Local optimisation minimises the truncated squared distance ([`refine_homography`]).

use std::ops::Range;

use nalgebra::Matrix3;

use super::Problem;
use super::consensus::{NEAR, inliers_within, near};
use crate::geometry::solvers::{Solutions, homography};
use crate::geometry::{Loss, PointPairs, refine_homography, squared_transfer_distances};

/// The problem of a homography; residuals are squared symmetric transfer distances.
#[derive(Clone, Copy, Debug)]
pub struct HomographyProblem<'a> {
    /// The matches, in pixels or at depth 1.
    pub pairs: &'a PointPairs,
    /// Whether the plane is seen from the same side in both images. Then samples that would mirror it are
    /// refused, and matches beyond the line that is mapped to infinity count neither for the quality of a model nor
    /// for the number of its inliers, though they are in the list
    /// [`Consensus::inliers`](super::Consensus::inliers), and a score that counts distances beyond its threshold
    /// ([`EvenMarginal`](super::EvenMarginal)) counts them there.
    pub one_side: bool,
}

impl Problem for HomographyProblem<'_> {
    type Model = Matrix3<f64>;
    type Models = Solutions<Matrix3<f64>, 1>;
    const SAMPLE: usize = 4;

    fn len(&self) -> usize {
        self.pairs.len()
    }

    fn solve(&self, sample: &[u32]) -> Self::Models {
        let point = |i: usize| self.pairs.get(sample[i] as usize);
        let a = std::array::from_fn(|i| point(i).0);
        let b = std::array::from_fn(|i| point(i).1);
        let mut models = Solutions::none();
        // For a matrix that keeps points in front, the sign of the determinant says whether it mirrors.
        if let Some(model) = homography(&a, &b).filter(|h| !self.one_side || h.determinant() > 0.0)
        {
            models.push(model);
        }
        models
    }

    fn squared_residuals(&self, model: &Matrix3<f64>, range: Range<usize>, out: &mut [f64]) {
        squared_transfer_distances(model, self.pairs, range, out);
    }

    fn exclude_impossible(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        squared_residuals: &mut [f64],
    ) -> bool {
        if !self.one_side {
            return false;
        }
        let mut any = false;
        for index in inliers_within(squared_residuals, squared_threshold) {
            let (a, _) = self.pairs.get(index as usize);
            let behind = (model * a.to_homogeneous()).z < 0.0;
            if behind {
                squared_residuals[index as usize] = f64::INFINITY;
                any = true;
            }
        }
        any
    }

    /// Minimises the truncated squared distance, using the matches near the model.
    fn refine(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        steps: usize,
    ) -> Option<Matrix3<f64>> {
        let near = near(self, self.pairs, model, NEAR * squared_threshold);
        let refined = refine_homography(model, &near, Loss::Truncated, squared_threshold, steps);
        Some(refined)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::robust::{Consensus, ConsensusParams, Extras, Msac, Uniform, consensus_until};
    use crate::seed::Seed;

    fn truth() -> Matrix3<f64> {
        Matrix3::new(1.1, 0.05, 0.1, -0.1, 0.9, 0.02, 0.1, -0.2, 1.0).normalize()
    }

    /// Matches under the truth with noise, then wrong ones.
    fn matches(right: usize, wrong: usize) -> PointPairs {
        let mut rng = Seed(5).rng();
        (0..right + wrong)
            .map(|i| {
                let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                let b = truth() * a.to_homogeneous();
                let mut off = |at: f64| at + 1e-3 * rng.normal();
                let b = Point2::new(off(b.x / b.z), off(b.y / b.z));
                let anywhere = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                (a, if i < right { b } else { anywhere })
            })
            .collect()
    }

    fn find(pairs: &PointPairs) -> Option<Consensus<Matrix3<f64>>> {
        consensus_until(
            &HomographyProblem {
                pairs,
                one_side: true,
            },
            &Msac {
                squared_threshold: 9e-6,
            },
            &mut Uniform::new(pairs.len()),
            ConsensusParams {
                confidence: 0.999,
                max_samples: 2000,
            },
            Extras {
                local_steps: 3,
                ..Extras::NONE
            },
            &mut Seed(1).rng(),
            &|_| false,
        )
    }

    #[test]
    fn the_plane_is_found_among_wrong_matches() {
        let found = find(&matches(100, 100)).expect("a homography");
        let right = found.inliers.iter().filter(|&&i| i < 100).count();
        assert!(right >= 95 && found.inliers.len() <= right + 3, "{right}");
        let distance = (found.model - truth()).norm();
        let distance = distance.min((found.model + truth()).norm());
        assert!(distance < 2e-3, "{distance}");
    }

    #[test]
    fn a_mirrored_plane_is_found_only_where_it_may_be() {
        let mirrored: PointPairs = (0..20)
            .map(|i| {
                let (x, y) = (0.1 * f64::from(i), 0.01 * f64::from(i * i));
                (Point2::new(x, y), Point2::new(-x, y))
            })
            .collect();
        let models = |one_side| {
            let pairs = &mirrored;
            HomographyProblem { pairs, one_side }
                .solve(&[0, 4, 9, 15])
                .len()
        };
        assert_eq!((models(false), models(true)), (1, 0));
    }

    #[test]
    fn what_lies_beyond_the_horizon_supports_nothing() {
        // z = 1 - x: points with x above 1 are behind.
        let h = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0);
        let pairs: PointPairs = [0.5, -1.0, 3.0]
            .map(|x: f64| {
                (
                    Point2::new(x, 0.2),
                    Point2::new(x / (1.0 - x), 0.2 / (1.0 - x)),
                )
            })
            .into_iter()
            .collect();
        for (one_side, expected) in [(false, [true; 3]), (true, [true, true, false])] {
            let problem = HomographyProblem {
                pairs: &pairs,
                one_side,
            };
            let mut residuals = [0.0; 3];
            problem.squared_residuals(&h, 0..3, &mut residuals);
            assert_eq!(
                problem.exclude_impossible(&h, 1e-9, &mut residuals),
                one_side
            );
            assert_eq!(residuals.map(|r| r < 1e-9), expected);
        }
    }

    #[test]
    fn there_is_none_where_nothing_determines_it() {
        let point = Point2::new(0.1, 0.2);
        let nan = Point2::new(f64::NAN, 0.2);
        for bad in [point, nan] {
            assert_eq!(find(&[(bad, bad); 20].into_iter().collect()), None);
        }
        assert_eq!(find(&PointPairs::default()), None);
    }
}
