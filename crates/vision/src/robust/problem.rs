//! What a search by sample consensus estimates: a model, its minimal samples, and its residuals.

use std::ops::{Deref, Range};

use crate::seed::Rng;

/// A model, the data it is estimated from, and how the two are compared. One of the three axes of
/// [`consensus`](super::consensus).
///
/// A problem owns its data, in whatever layout its residuals are computed fastest, and numbers
/// them from 0; samples are such numbers.
pub trait Problem {
    /// What is estimated.
    type Model: Clone;
    /// All models that one sample allows: a fixed-capacity list, so that nothing is allocated.
    type Models: Deref<Target = [Self::Model]>;
    /// Data in a minimal sample.
    const SAMPLE: usize;
    /// Samples that are best solved together.
    const BATCH: usize = 1;

    /// Number of data.
    fn len(&self) -> usize;

    /// Whether there are no data.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The models that agree with the data of a `sample` of [`Problem::SAMPLE`] distinct numbers;
    /// none where they are degenerate.
    fn solve(&self, sample: &[u32]) -> Self::Models;

    /// As [`Problem::solve`] of at most [`Problem::BATCH`] samples, whose numbers come one after the other, in the place
    /// of what is in `models`.
    fn solve_each(&self, samples: &[u32], models: &mut Vec<Self::Models>) {
        models.clear();
        let samples = samples.chunks_exact(Self::SAMPLE);
        models.extend(samples.map(|sample| self.solve(sample)));
    }

    /// Squared residuals of the data in `range`, written to `out`: 0 or larger, infinite or NaN for
    /// data that agree with no model. A range, so that bad models can be abandoned before all data are
    /// seen.
    ///
    /// # Panics
    /// If `range` exceeds the data or `out` has another length.
    fn squared_residuals(&self, model: &Self::Model, range: Range<usize>, out: &mut [f64]);

    /// A model near this one that agrees better with the data within the threshold, for local
    /// optimisation; `None` where there is none or the problem knows no way. At most `steps` steps
    /// of whatever iteration is used.
    fn refine(
        &self,
        _model: &Self::Model,
        _squared_threshold: f64,
        _steps: usize,
    ) -> Option<Self::Model> {
        None
    }

    /// Looks for data that are within the threshold of the model and still cannot belong to it (a scene
    /// point behind a camera), sets their residuals to infinity, and returns whether there are any. Too
    /// costly for every model, so it is asked of those that would be the best only.
    fn exclude_impossible(
        &self,
        _model: &Self::Model,
        _squared_threshold: f64,
        _squared_residuals: &mut [f64],
    ) -> bool {
        false
    }

    /// Models that most of the data that agree with this one may agree with too. Asked once, of the best model in the
    /// end; each is refined, and the best of all is kept.
    fn rivals(
        &self,
        _model: &Self::Model,
        _squared_threshold: f64,
        _rng: &mut Rng,
    ) -> Vec<Self::Model> {
        Vec::new()
    }

    /// Another model in place of this one, where the `sample` it comes from does not determine it (most
    /// of its data lie on one plane). Asked of models that would be the best; `None` where the sample is
    /// not degenerate.
    fn resolve_degeneracy(
        &self,
        _model: &Self::Model,
        _sample: &[u32],
        _squared_threshold: f64,
        _rng: &mut Rng,
    ) -> Option<Self::Model> {
        None
    }
}
