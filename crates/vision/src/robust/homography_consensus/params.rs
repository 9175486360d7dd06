//! What a [`HomographyConsensus`](super::HomographyConsensus) is made of.

use crate::geometry::Loss;
use crate::params::ParamError;
use crate::robust::parts::{EarlyStop, FinalRefinement, Sampler, Score};
use crate::robust::search::Search;

/// Parameters of [`HomographyConsensus`](super::HomographyConsensus). Thresholds are symmetric transfer
/// distances in pixels: the root of the mean of both squares.
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
    /// Which model is best.
    pub score: Score,
    /// Which matches are tried next.
    pub sampler: Sampler,
    /// When fewer than `max_iterations` samples are enough; `None`: never.
    pub early_stop: Option<EarlyStop>,
    /// Samples drawn at most; at least 1.
    pub max_iterations: usize,
    /// Steps of each local optimisation at most, 0 to 1000; 0 for none.
    pub local_steps: usize,
    /// How the best model is refined in the end; `None`: not at all.
    pub final_refinement: Option<FinalRefinement>,
    /// Whether what is seen is seen from one side: samples that would mirror it are refused, and matches
    /// beyond the line that goes to infinity are none of its inliers.
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
        FinalRefinement::check(self.final_refinement)
    }
}

/// By flat names, as people type them.
#[cfg(feature = "serde")]
mod flat {
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::HomographyParams;
    use crate::params::ParamError;
    use crate::robust::settings::{Settings, have};

    impl HomographyParams {
        /// These parameters by flat names: those that act.
        pub fn settings(&self) -> Settings {
            Settings {
                one_side: Some(self.one_side),
                ..Settings::of(&self.search(), self.final_refinement)
            }
        }

        /// These parameters, changed. What a new choice brings with it and `changes` does not say has its
        /// general default.
        ///
        /// # Errors
        /// If one of the changes does not act beside the choices; the error names those that do.
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
