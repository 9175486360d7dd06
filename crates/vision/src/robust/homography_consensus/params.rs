//! What a [`HomographyConsensus`](super::HomographyConsensus) is made of.

use crate::geometry::Loss;
use crate::params::ParamError;
use crate::robust::parts::{EarlyStop, FinalRefinement, Sampler, Score};
use crate::robust::search::Search;

/// Parameters of [`HomographyConsensus`](super::HomographyConsensus). Thresholds are symmetric transfer
/// distances in pixels: the root of the mean of the two squared distances.
///
/// ```
/// use matchbench_vision::robust::{HomographyConsensus, HomographyParams, presets};
///
/// let patient = HomographyParams { max_iterations: 50_000, ..presets::best_h() };
/// let estimator = HomographyConsensus::new(patient)?;
/// # Ok::<(), matchbench_vision::ParamError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomographyParams {
    /// The score, which says which model is best.
    pub score: Score,
    /// The sampler, which says which matches are tried next.
    pub sampler: Sampler,
    /// When sampling may stop before `max_iterations`; `None`: never.
    pub early_stop: Option<EarlyStop>,
    /// Largest number of samples; at least 1.
    pub max_iterations: usize,
    /// Largest number of steps of each local optimisation, 0 to 1000; 0 for none.
    pub local_steps: usize,
    /// The refinement of the best model at the end; `None`: none.
    pub final_refinement: Option<FinalRefinement>,
    /// Whether the plane is seen from the same side in both images. Then samples that would mirror it are
    /// refused, and matches beyond the line that is mapped to infinity do not count as inliers.
    pub one_side: bool,
}

impl Default for HomographyParams {
    fn default() -> Self {
        Self {
            score: Score::Msac {
                threshold_px: 3.0,
                sprt: false,
            },
            sampler: Sampler::Uniform,
            early_stop: Some(EarlyStop {
                confidence: 0.999,
                min_iterations: 50,
            }),
            max_iterations: 2000,
            local_steps: 10,
            final_refinement: Some(FinalRefinement {
                loss: Loss::Truncated,
                steps: 25,
            }),
            one_side: true,
        }
    }
}

impl HomographyParams {
    /// The parts of the search itself.
    pub(super) fn search(&self) -> Search {
        Search {
            score: self.score,
            sampler: self.sampler,
            early_stop: self.early_stop,
            max_iterations: self.max_iterations,
            local_steps: self.local_steps,
        }
    }

    /// Refuses a parameter that is out of its range.
    pub(super) fn check(&self) -> Result<(), ParamError> {
        self.search().check()?;
        if let Score::EvenMarginal {
            noise_iterations, ..
        } = self.score
        {
            ParamError::unless(
                noise_iterations == 0,
                "noise_iterations",
                noise_iterations,
                "0 for homographies: what is known of noise is how far points are from lines",
            )?;
        }
        ParamError::unless(
            !matches!(self.score, Score::Mlesac { .. }),
            "score",
            "mlesac",
            "another for homographies: its likelihoods are those of distances from lines",
        )?;
        FinalRefinement::check(self.final_refinement)
    }
}

/// Parameters by flat names, as users type them.
#[cfg(feature = "serde")]
mod flat {
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::HomographyParams;
    use crate::params::ParamError;
    use crate::robust::settings::{Settings, have};

    impl HomographyParams {
        /// These parameters by flat names. Only parameters that have an effect are included.
        pub fn settings(&self) -> Settings {
            Settings {
                one_side: Some(self.one_side),
                ..Settings::of(&self.search(), self.final_refinement)
            }
        }

        /// These parameters with `changes`. If a changed choice needs further parameters that `changes` does
        /// not give, they have their general defaults.
        ///
        /// # Errors
        /// If one of the changes would have no effect with these choices; the error lists the parameters that
        /// have one.
        pub fn with(&self, changes: Settings) -> Result<Self, ParamError> {
            let all = changes.or(self.settings()).or(Settings::DEFAULTS);
            let search = all.search();
            let changed = Self {
                score: search.score,
                sampler: search.sampler,
                early_stop: search.early_stop,
                max_iterations: search.max_iterations,
                local_steps: search.local_steps,
                final_refinement: all.final_refinement(),
                one_side: have(all.one_side),
            };
            changes.check_acting(&changed.settings())?;
            Ok(changed)
        }
    }

    impl Serialize for HomographyParams {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            self.settings().serialize(serializer)
        }
    }

    impl<'de> Deserialize<'de> for HomographyParams {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            let settings = Settings::deserialize(deserializer)?;
            Self::default().with(settings).map_err(D::Error::custom)
        }
    }
}
