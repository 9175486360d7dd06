//! What a search by sample consensus estimates: a model, its minimal samples, and its residuals.

use std::ops::{Deref, Range};

use crate::seed::Rng;

/// A model, the data from which it is estimated, and how the two are compared. One of the three parts of
/// [`consensus`](super::consensus()).
///
/// A problem owns its data, in the layout in which residuals are computed fastest. Data are numbered from 0,
/// and a sample is a list of such numbers.
pub trait Problem {
    /// What is estimated.
    type Model: Clone;
    /// All models that one sample allows: a fixed-capacity list, so that nothing is allocated.
    type Models: Deref<Target = [Self::Model]>;
    /// Number of data in a minimal sample.
    const SAMPLE: usize;
    /// Number of samples that are best solved together.
    const BATCH: usize = 1;

    /// Number of data.
    fn len(&self) -> usize;

    /// Whether there are no data.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The models that agree with the data of a `sample` of [`Problem::SAMPLE`] distinct numbers; none if the
    /// sample is degenerate.
    fn solve(&self, sample: &[u32]) -> Self::Models;

    /// Writes the results of [`Problem::solve`] for at most [`Problem::BATCH`] samples, whose numbers follow
    /// each other, to `models`, whose old content is replaced.
    fn solve_each(&self, samples: &[u32], models: &mut Vec<Self::Models>) {
        models.clear();
        let samples = samples.chunks_exact(Self::SAMPLE);
        models.extend(samples.map(|sample| self.solve(sample)));
    }

    /// Writes the squared residuals of the data in `range` to `out`. They are 0 or larger, or infinite or NaN
    /// for data that agree with no model. Only a range is computed, so that bad models can be rejected before
    /// all data are used.
    ///
    /// # Panics
    /// If `range` exceeds the data or `out` has another length.
    fn squared_residuals(&self, model: &Self::Model, range: Range<usize>, out: &mut [f64]);

    /// A model near this one that agrees better with the data within the threshold, for local optimisation. At
    /// most `steps` steps of an iteration are made. `None` if there is none, or if the problem has no such
    /// method.
    fn refine(
        &self,
        _model: &Self::Model,
        _squared_threshold: f64,
        _steps: usize,
    ) -> Option<Self::Model> {
        None
    }

    /// Finds data that are within the threshold of the model but cannot belong to it (a scene point behind a
    /// camera), sets their residuals to infinity, and returns whether there are any. It is too slow to be
    /// called for every model, so it is called only for models that would be the best. It decides which model that
    /// is; the data that it finds are still in the list [`Consensus::inliers`](super::Consensus::inliers).
    fn exclude_impossible(
        &self,
        _model: &Self::Model,
        _squared_threshold: f64,
        _squared_residuals: &mut [f64],
    ) -> bool {
        false
    }

    /// Other models with which most data that agree with this one may agree too. It is called once at the end,
    /// for the best model. Each result is refined if the best model is (local optimisation), and the best of all is kept.
    fn rivals(
        &self,
        _model: &Self::Model,
        _squared_threshold: f64,
        _rng: &mut Rng,
    ) -> Vec<Self::Model> {
        Vec::new()
    }

    /// How far two models are from each other, 0 if they are the same, for a search that keeps several hypotheses.
    /// By default no two are near.
    fn distance(&self, _one: &Self::Model, _other: &Self::Model) -> f64 {
        f64::INFINITY
    }

    /// How far each datum is trusted, from 0 to 1, if this is the true model: what is known of a datum beside its
    /// residual may be unlike what the model predicts. Data whose squared residual is above four times the threshold
    /// need not be looked at, since no score counts them. `None` if nothing more is known. A search that keeps several
    /// hypotheses chooses by it at the end.
    fn trust(
        &self,
        _model: &Self::Model,
        _squared_threshold: f64,
        _squared_residuals: &[f64],
    ) -> Option<Vec<f64>> {
        None
    }

    /// Whether what the search has found after many samples, a model and its squared threshold or nothing, is so unlikely
    /// to be right that more samples are not worth their time.
    fn is_hopeless(&self, _found: Option<(&Self::Model, f64)>) -> bool {
        false
    }

    /// A model to replace this one if its `sample` does not determine it (most of its data lie on one plane).
    /// It is called for models that would be the best. `None` if the sample is not degenerate.
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
