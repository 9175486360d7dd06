//! The homography of two views, from four matches at a time: what relates views of a plane, or views
//! from one place.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 4.7.
//!
//! Local optimisation is the normalised linear algorithm over the inliers (alg. 4.2).

use std::ops::Range;

use nalgebra::{Matrix3, SVector};

use super::Problem;
use super::linear::{Normalised, least_violating, refit};
use crate::geometry::solvers::{Solutions, homography};
use crate::geometry::{PointPairs, squared_transfer_distances};

/// Finds the homography; residuals are squared symmetric transfer distances.
#[derive(Clone, Copy, Debug)]
pub struct HomographyProblem<'a> {
    /// The matches, in pixels or at depth 1.
    pub pairs: &'a PointPairs,
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
        if let Some(model) = homography(&a, &b) {
            models.push(model);
        }
        models
    }

    fn squared_residuals(&self, model: &Matrix3<f64>, range: Range<usize>, out: &mut [f64]) {
        squared_transfer_distances(model, self.pairs, range, out);
    }

    fn refine(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        steps: usize,
    ) -> Option<Matrix3<f64>> {
        refit(
            self,
            model,
            squared_threshold,
            steps,
            Self::SAMPLE,
            |inliers| linear(self.pairs, inliers),
        )
    }
}

/// The homography that fits the `matches` best in the algebraic sense.
fn linear(pairs: &PointPairs, matches: &[u32]) -> Option<Matrix3<f64>> {
    // Two of the equations b x H a = 0, in the rows of H.
    let Normalised {
        matrix,
        from_a,
        from_b,
    } = least_violating(pairs, matches, |a, b| {
        [(0, b.x), (1, b.y)].map(|(row, weight)| {
            let mut equation = SVector::zeros();
            for i in 0..3 {
                equation[3 * row + i] = a[i];
                equation[6 + i] = -weight * a[i];
            }
            equation
        })
    })?;
    let h = from_b.try_inverse()? * matrix * from_a;
    (h.norm() > 0.0 && h.norm().is_finite()).then(|| h.normalize())
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
            &HomographyProblem { pairs },
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
    fn there_is_none_where_nothing_determines_it() {
        let point = Point2::new(0.1, 0.2);
        let nan = Point2::new(f64::NAN, 0.2);
        for bad in [point, nan] {
            assert_eq!(find(&[(bad, bad); 20].into_iter().collect()), None);
        }
        assert_eq!(find(&PointPairs::default()), None);
    }
}
