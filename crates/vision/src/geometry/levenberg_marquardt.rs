//! Minimisation of a robust sum of squares by the method of Levenberg and Marquardt.
//!
//! Levenberg, "A Method for the Solution of Certain Non-Linear Problems in Least Squares",
//! Quarterly of Applied Mathematics 2, 1944; Marquardt, "An Algorithm for Least-Squares Estimation of
//! Nonlinear Parameters", SIAM Journal 11, 1963. Losses: Huber, Ronchetti, "Robust Statistics", 2nd edition,
//! 2009. They are minimised as iteratively reweighted least squares.
//!
//! A model with N degrees of freedom moves on its tangent space. A step solves the weighted normal equations,
//! whose diagonal is increased by the damping. A step that reduces the cost is taken, and the next is damped
//! less. A step that increases the cost is not taken, and the next is damped more.
//!
//! | constant | value | source |
//! | --- | --- | --- |
//! | `FIRST_DAMPING` | 1e-3, times the diagonal | Marquardt |
//! | `DAMPING_FACTOR` | 10 | Marquardt |
//! | `MAX_DAMPING` | 1e6, beyond which no step is tried | ours |
//! | `MIN_STEP` | 1e-9, in the unit of the tangent space | ours |

use nalgebra::{SMatrix, SVector};

const FIRST_DAMPING: f64 = 1e-3;
const MAX_DAMPING: f64 = 1e6;
const DAMPING_FACTOR: f64 = 10.0;
const MIN_STEP: f64 = 1e-9;

/// The cost of a residual r, where c is the scale of the loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Loss {
    /// `min(r^2, c^2)`: outliers have no influence.
    Truncated,
    /// `c^2 log(1 + r^2 / c^2)`: the influence of outliers gets smaller with their distance.
    Cauchy,
}

impl Loss {
    /// The cost of residuals. First the number of residuals that are not finite, if the loss has no bound; then
    /// the sum over the others.
    pub(super) fn cost(self, squared: &[f64], squared_scale: f64) -> (usize, f64) {
        match self {
            // `min` ignores NaN.
            Self::Truncated => (0, squared.iter().map(|r| r.min(squared_scale)).sum()),
            Self::Cauchy => {
                let finite = || squared.iter().filter(|r| r.is_finite());
                let sum = finite()
                    .map(|r| squared_scale * libm::log1p(r / squared_scale))
                    .sum();
                (squared.len() - finite().count(), sum)
            }
        }
    }

    /// Replaces the squared residuals by their weights.
    fn weigh(self, squared: &mut [f64], squared_scale: f64) {
        for r in squared {
            *r = match self {
                Self::Truncated => f64::from(u8::from(*r <= squared_scale)),
                Self::Cauchy if r.is_finite() => squared_scale / (squared_scale + *r),
                Self::Cauchy => 0.0,
            };
        }
    }
}

/// A problem to be refined: a model of N degrees of freedom and its matches.
pub(super) trait LeastSquares<const N: usize> {
    type Model: Copy;

    /// Number of matches.
    fn len(&self) -> usize;

    /// The squared residual of each match.
    fn squared_residuals(&self, model: &Self::Model, out: &mut [f64]);

    /// The normal equations at a model for the `weights` of the matches; `None` if there are none.
    fn normal_equations(&self, model: &Self::Model, weights: &[f64]) -> Option<NormalEquations<N>>;

    /// The model moved by a step on its tangent space.
    fn moved(&self, model: &Self::Model, step: &SVector<f64, N>) -> Self::Model;
}

/// `J^T W J` and `J^T W r` for the weights W, the derivatives J of the residuals r.
#[derive(Clone, Copy, Debug)]
pub(super) struct NormalEquations<const N: usize> {
    pub(super) matrix: SMatrix<f64, N, N>,
    pub(super) gradient: SVector<f64, N>,
}

impl<const N: usize> NormalEquations<N> {
    /// From the lower triangle of the matrix, row after row, and then the gradient.
    pub(super) fn from_sums(sums: &[f64]) -> Self {
        let mut matrix = SMatrix::zeros();
        let mut next = 0;
        for i in 0..N {
            for j in 0..=i {
                matrix[(i, j)] = sums[next];
                matrix[(j, i)] = sums[next];
                next += 1;
            }
        }
        let gradient = SVector::from_column_slice(&sums[next..]);
        Self { matrix, gradient }
    }
}

/// The model after at most `max_steps` steps from `start`. Its cost is never larger than that of `start`. The
/// scale of the `loss` is given squared, in the unit of the squared residuals.
pub(super) fn minimise<const N: usize, P: LeastSquares<N>>(
    problem: &P,
    start: P::Model,
    loss: Loss,
    squared_scale: f64,
    max_steps: usize,
) -> P::Model {
    let mut residuals = vec![0.0; problem.len()];
    let mut trial = vec![0.0; problem.len()];
    let squared = |model: &P::Model, out: &mut [f64]| {
        problem.squared_residuals(model, out);
        loss.cost(out, squared_scale)
    };
    let mut model = start;
    let mut cost = squared(&model, &mut residuals);
    let mut damping = FIRST_DAMPING;
    let mut equations = None;
    for _ in 0..max_steps {
        if equations.is_none() {
            loss.weigh(&mut residuals, squared_scale);
            equations = problem.normal_equations(&model, &residuals);
        }
        let Some(NormalEquations { matrix, gradient }) = equations else {
            break;
        };
        let mut damped = matrix;
        for i in 0..N {
            damped[(i, i)] *= 1.0 + damping;
        }
        let Some(cholesky) = damped.cholesky() else {
            break;
        };
        let step: SVector<f64, N> = -cholesky.solve(&gradient);
        let moved = problem.moved(&model, &step);
        let moved_cost = squared(&moved, &mut trial);
        if moved_cost < cost {
            (model, cost) = (moved, moved_cost);
            std::mem::swap(&mut residuals, &mut trial);
            equations = None;
            damping /= DAMPING_FACTOR;
        } else {
            damping *= DAMPING_FACTOR;
        }
        // The damping bounds the number of vain trials. A step of NaN is none.
        let moves = step.norm() > MIN_STEP;
        if !moves || damping > MAX_DAMPING {
            break;
        }
    }
    model
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix1, Vector1};

    use super::*;

    /// The distances of a number from 2 and from what is not a number; none beyond 1.
    struct Fenced;

    impl LeastSquares<1> for Fenced {
        type Model = f64;

        fn len(&self) -> usize {
            2
        }

        fn squared_residuals(&self, model: &f64, out: &mut [f64]) {
            let squared = (model - 2.0) * (model - 2.0);
            out[0] = if *model < 1.0 { squared } else { f64::INFINITY };
            out[1] = f64::NAN;
        }

        fn normal_equations(&self, model: &f64, weights: &[f64]) -> Option<NormalEquations<1>> {
            Some(NormalEquations {
                matrix: Matrix1::new(weights[0]),
                gradient: Vector1::new(weights[0] * (model - 2.0)),
            })
        }

        fn moved(&self, model: &f64, step: &SVector<f64, 1>) -> f64 {
            model + step.x
        }
    }

    #[test]
    fn a_step_to_where_nothing_has_a_distance_costs_more() {
        for loss in [Loss::Truncated, Loss::Cauchy] {
            let found = minimise(&Fenced, 0.0, loss, 9.0, 25);
            assert!((0.5..1.0).contains(&found), "{loss:?}: {found}");
        }
    }
}
