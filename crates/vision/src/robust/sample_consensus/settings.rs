//! The parameters of a sample consensus by flat names, as people type them and files keep them.
//!
//! `{"score": "msac", "threshold_px": 2}` instead of a tree of choices. A choice (`geometry`, `score`,
//! `sampler`) decides which of the other names act:
//!
//! | name | acts where |
//! | --- | --- |
//! | `cheirality` | `geometry` is `essential` |
//! | `degensac` | `geometry` is `fundamental` |
//! | `threshold_px` | `score` is not `lmeds` |
//! | `score_cells` | `score` is `even-msac` |
//! | `sprt` | `score` is neither `lmeds` nor `mlesac` |
//! | `prosac_horizon` | `sampler` is `prosac` |
//! | `cells` | `sampler` is `spread` |
//! | `min_iterations` | `confidence` is below 1; at 1 all `max_iterations` samples are drawn |
//! | `final_loss` | `final_steps` is not 0 |
//!
//! The others always act. A name that does not act is refused, as an unknown one is.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::params::{EarlyStop, FinalRefinement, Geometry, SampleConsensusParams, Sampler, Score};
use crate::geometry::Loss;
use crate::params::ParamError;

/// Name of a [`Geometry`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(missing_docs, reason = "named as what they choose")]
pub enum GeometryName {
    Essential,
    Fundamental,
}

/// Name of a [`Score`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(missing_docs, reason = "named as what they choose")]
pub enum ScoreName {
    InlierCount,
    Msac,
    EvenMsac,
    Magsac,
    Mlesac,
    #[serde(alias = "median")]
    Lmeds,
}

/// Name of a [`Sampler`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(missing_docs, reason = "named as what they choose")]
pub enum SamplerName {
    Uniform,
    Prosac,
    Spread,
}

macro_rules! settings {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $default:expr,)*) => {
        /// Parameters of a [`SampleConsensusParams`] by flat names; `None` for those that are left
        /// out.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Settings {
            $($(#[$doc])* #[serde(skip_serializing_if = "Option::is_none")] pub $name: Option<$type>,)*
        }

        impl Settings {
            /// What a name means where neither the user nor the preset says it, since another choice
            /// made it act.
            const DEFAULTS: Self = Self { $($name: Some($default),)* };

            /// The names that are given.
            fn names(&self) -> Vec<&'static str> {
                let mut names = Vec::new();
                $(if self.$name.is_some() {
                    names.push(stringify!($name));
                })*
                names
            }

            /// These, and `others` for what is left out.
            fn or(self, others: Self) -> Self {
                Self { $($name: self.$name.or(others.$name),)* }
            }

            /// Only those that `others` has too.
            fn among(self, others: &Self) -> Self {
                Self { $($name: self.$name.filter(|_| others.$name.is_some()),)* }
            }
        }
    };
}

settings! {
    /// [`SampleConsensusParams::geometry`].
    geometry: GeometryName = GeometryName::Essential,
    /// [`SampleConsensusParams::score`].
    score: ScoreName = ScoreName::Msac,
    /// [`SampleConsensusParams::sampler`].
    sampler: SamplerName = SamplerName::Uniform,
    /// [`EarlyStop::confidence`]; 1 for no early stop.
    confidence: f64 = 0.999,
    /// Largest distance of an inlier, in pixels; see [`Score`].
    threshold_px: f64 = 1.0,
    /// [`Geometry::Essential::cheirality`].
    cheirality: bool = true,
    /// [`Geometry::Fundamental::degensac`].
    degensac: bool = true,
    /// Whether bad models are abandoned early; see [`Score`].
    sprt: bool = true,
    /// [`EarlyStop::min_iterations`].
    min_iterations: usize = 50,
    /// [`SampleConsensusParams::max_iterations`].
    max_iterations: usize = 1000,
    /// [`SampleConsensusParams::local_steps`].
    local_steps: usize = 10,
    /// [`FinalRefinement::loss`].
    final_loss: Loss = Loss::Truncated,
    /// [`FinalRefinement::steps`]; 0 for no refinement.
    final_steps: usize = 25,
    /// [`Sampler::Prosac::horizon`].
    prosac_horizon: usize = 200_000,
    /// [`Sampler::Spread::cells`].
    cells: u32 = 20,
    /// [`Score::EvenMsac::cells`].
    score_cells: u32 = 10,
    /// [`SampleConsensusParams::max_depth`].
    max_depth: f64 = 50.0,
}

impl SampleConsensusParams {
    /// These parameters by flat names: those that act.
    pub fn settings(&self) -> Settings {
        let mut flat = Settings {
            score: Some(match self.score {
                Score::InlierCount { .. } => ScoreName::InlierCount,
                Score::Msac { .. } => ScoreName::Msac,
                Score::EvenMsac { .. } => ScoreName::EvenMsac,
                Score::Magsac { .. } => ScoreName::Magsac,
                Score::Mlesac { .. } => ScoreName::Mlesac,
                Score::Lmeds => ScoreName::Lmeds,
            }),
            threshold_px: self.score.threshold_px(),
            sprt: self.score.sprt(),
            confidence: Some(self.early_stop.map_or(1.0, |stop| stop.confidence)),
            min_iterations: self.early_stop.map(|stop| stop.min_iterations),
            max_iterations: Some(self.max_iterations),
            local_steps: Some(self.local_steps),
            final_loss: self.final_refinement.map(|refinement| refinement.loss),
            final_steps: Some((self.final_refinement).map_or(0, |refinement| refinement.steps)),
            max_depth: Some(self.max_depth),
            ..Settings::default()
        };
        match self.geometry {
            Geometry::Essential { cheirality } => {
                flat.geometry = Some(GeometryName::Essential);
                flat.cheirality = Some(cheirality);
            }
            Geometry::Fundamental { degensac } => {
                flat.geometry = Some(GeometryName::Fundamental);
                flat.degensac = Some(degensac);
            }
        }
        if let Score::EvenMsac { cells, .. } = self.score {
            flat.score_cells = Some(cells);
        }
        match self.sampler {
            Sampler::Uniform => flat.sampler = Some(SamplerName::Uniform),
            Sampler::Prosac { horizon } => {
                flat.sampler = Some(SamplerName::Prosac);
                flat.prosac_horizon = Some(horizon);
            }
            Sampler::Spread { cells } => {
                flat.sampler = Some(SamplerName::Spread);
                flat.cells = Some(cells);
            }
        }
        flat
    }

    /// These parameters, changed. What a new choice brings with it and `changes` does not say has its
    /// general default.
    ///
    /// ```
    /// # #[cfg(feature = "serde")] {
    /// use matchbench_vision::robust::{ScoreName, Settings, presets};
    ///
    /// let changes = Settings { threshold_px: Some(1.0), ..Settings::default() };
    /// assert_eq!(presets::best().with(changes)?.score.threshold_px(), Some(1.0));
    /// // The least median needs no threshold, so one that is given would do nothing.
    /// assert!(presets::lmeds_e().with(changes).is_err());
    /// # }
    /// # Ok::<(), matchbench_vision::ParamError>(())
    /// ```
    ///
    /// # Errors
    /// If one of the changes does not act beside the choices; the error names those that do.
    pub fn with(&self, changes: Settings) -> Result<Self, ParamError> {
        let changed = changes.over(self);
        let acting = changed.settings().names();
        let given = changes.names();
        match given.iter().find(|name| !acting.contains(name)) {
            Some(name) => Err(ParamError(format!(
                "`{name}` does nothing beside the chosen geometry, score, sampler, confidence and \
                 final_steps; what acts is {}",
                acting.join(", ")
            ))),
            None => Ok(changed),
        }
    }
}

impl Settings {
    /// Those of a file of an earlier version that act as changes of `base`. Such files hold every name,
    /// also of the parts that were not chosen.
    #[must_use]
    pub fn of_earlier_version(mut self, base: &SampleConsensusParams) -> Self {
        // No sample could be left out, so the confidence did nothing.
        if self.min_iterations.is_some() && self.min_iterations == self.max_iterations {
            self.confidence = Some(1.0);
        }
        self.among(&self.over(base).settings())
    }

    /// `base` with these changes; those that do not act are left out.
    fn over(self, base: &SampleConsensusParams) -> SampleConsensusParams {
        fn have<T>(value: Option<T>) -> T {
            value.expect("the defaults have every name")
        }
        let all = self.or(base.settings()).or(Self::DEFAULTS);
        let threshold_px = have(all.threshold_px);
        let sprt = have(all.sprt);
        SampleConsensusParams {
            geometry: match have(all.geometry) {
                GeometryName::Essential => Geometry::Essential {
                    cheirality: have(all.cheirality),
                },
                GeometryName::Fundamental => Geometry::Fundamental {
                    degensac: have(all.degensac),
                },
            },
            score: match have(all.score) {
                ScoreName::InlierCount => Score::InlierCount { threshold_px, sprt },
                ScoreName::Msac => Score::Msac { threshold_px, sprt },
                ScoreName::EvenMsac => Score::EvenMsac {
                    threshold_px,
                    cells: have(all.score_cells),
                    sprt,
                },
                ScoreName::Magsac => Score::Magsac { threshold_px, sprt },
                ScoreName::Mlesac => Score::Mlesac { threshold_px },
                ScoreName::Lmeds => Score::Lmeds,
            },
            sampler: match have(all.sampler) {
                SamplerName::Uniform => Sampler::Uniform,
                SamplerName::Prosac => Sampler::Prosac {
                    horizon: have(all.prosac_horizon),
                },
                SamplerName::Spread => Sampler::Spread {
                    cells: have(all.cells),
                },
            },
            early_stop: (have(all.confidence) != 1.0).then(|| EarlyStop {
                confidence: have(all.confidence),
                min_iterations: have(all.min_iterations),
            }),
            max_iterations: have(all.max_iterations),
            local_steps: have(all.local_steps),
            final_refinement: (have(all.final_steps) > 0).then(|| FinalRefinement {
                loss: have(all.final_loss),
                steps: have(all.final_steps),
            }),
            max_depth: have(all.max_depth),
        }
    }
}

impl Serialize for SampleConsensusParams {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.settings().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for SampleConsensusParams {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let settings = Settings::deserialize(deserializer)?;
        Self::default().with(settings).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::presets;

    #[test]
    fn the_general_defaults_are_one() {
        let default = SampleConsensusParams::default();
        assert_eq!(default.with(Settings::default()), Ok(default));
        assert_eq!(
            default.settings(),
            Settings::DEFAULTS.among(&default.settings())
        );
        let of_nothing = Settings::DEFAULTS.over(&presets::lmeds_f());
        assert_eq!(of_nothing, default);
    }

    #[test]
    fn presets_come_back_from_their_flat_names() {
        for preset in presets::ALL {
            let preset = preset();
            assert_eq!(
                SampleConsensusParams::default().with(preset.settings()),
                Ok(preset)
            );
        }
    }

    #[test]
    fn a_name_that_does_not_act_is_refused_beside_those_that_do() {
        let refused = |base: SampleConsensusParams, changes: Settings, name: &str| {
            let message = base.with(changes).expect_err("refused").to_string();
            assert!(message.starts_with(&format!("`{name}`")), "{message}");
            let acting = base.settings().names();
            assert!(
                acting.iter().all(|name| message.contains(name)),
                "{message}"
            );
        };
        let none = Settings::default;
        let threshold = Settings {
            threshold_px: Some(2.0),
            ..none()
        };
        refused(presets::lmeds_e(), threshold, "threshold_px");
        let cells = Settings {
            cells: Some(9),
            ..none()
        };
        refused(presets::magsac_e(), cells, "cells");
        let cheirality = Settings {
            cheirality: Some(true),
            ..none()
        };
        refused(presets::ransac_f(), cheirality, "cheirality");
        let loss = Settings {
            final_loss: Some(Loss::Cauchy),
            ..none()
        };
        refused(presets::mlesac_e(), loss, "final_loss");
        // With steps there is a loss to choose.
        let both = Settings {
            final_steps: Some(5),
            ..loss
        };
        assert!(presets::mlesac_e().with(both).is_ok());
    }

    #[test]
    fn a_new_choice_brings_its_parameters_with_it_and_keeps_the_others() {
        let changes = Settings {
            score: Some(ScoreName::Msac),
            ..Settings::default()
        };
        let changed = presets::best().with(changes).expect("msac has a threshold");
        let expected = SampleConsensusParams {
            score: Score::Msac {
                threshold_px: 2.0,
                sprt: true,
            },
            ..presets::best()
        };
        assert_eq!(changed, expected);
        let with_threshold = presets::lmeds_e().with(changes).expect("msac");
        assert_eq!(
            with_threshold.score,
            Score::Msac {
                threshold_px: 1.0,
                sprt: true
            }
        );
    }

    #[test]
    fn files_of_earlier_versions_hold_names_that_do_not_act() {
        let every = Settings {
            min_iterations: Some(218),
            max_iterations: Some(218),
            ..presets::lmeds_e().settings().or(Settings::DEFAULTS)
        };
        let acting = every.of_earlier_version(&presets::lmeds_e());
        assert_eq!(acting, presets::lmeds_e().settings());
        // Here the confidence did act.
        let early = Settings {
            confidence: Some(0.9),
            min_iterations: Some(10),
            ..every
        };
        let acting = early.of_earlier_version(&presets::lmeds_e());
        assert_eq!(
            (acting.confidence, acting.min_iterations),
            (Some(0.9), Some(10))
        );
        assert_eq!(acting.threshold_px, None);
    }
}
