//! Parameters of a pose estimator by [flat names](Settings).

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::params::{Geometry, SampleConsensusParams};
use crate::params::ParamError;
use crate::robust::settings::{GeometryName, Settings, have};

impl SampleConsensusParams {
    /// These parameters by flat names. Only parameters that have an effect are included.
    pub fn settings(&self) -> Settings {
        let mut flat = Settings {
            max_depth: Some(self.max_depth),
            ..Settings::of(&self.search(), self.final_refinement)
        };
        match self.geometry {
            Geometry::Essential {
                cheirality,
                plane_poses,
                tangent_sampson,
                hypotheses,
                hopeless,
            } => {
                flat.geometry = Some(GeometryName::Essential);
                flat.cheirality = Some(cheirality);
                flat.plane_poses = Some(plane_poses);
                flat.tangent_sampson = Some(tangent_sampson);
                flat.hypotheses = self.score.uses_turns().then_some(hypotheses);
                flat.hopeless = self.search().hopeless_after().map(|_| hopeless);
            }
            Geometry::Fundamental { degensac } => {
                flat.geometry = Some(GeometryName::Fundamental);
                flat.degensac = Some(degensac);
            }
        }
        flat
    }

    /// These parameters with `changes`. If a changed choice needs further parameters that `changes` does not
    /// give, they have their general defaults.
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
    /// If one of the changes would have no effect with these choices; the error lists the parameters that have
    /// one.
    pub fn with(&self, changes: Settings) -> Result<Self, ParamError> {
        let changed = changes.over(self);
        changes.check_acting(&changed.settings())?;
        Ok(changed)
    }
}

impl Settings {
    /// The settings of a file of an earlier version that have an effect as changes of `base`. Such files hold
    /// every name, including those of parts that were not chosen. A name that came later is not in them, and what it does
    /// was not done then.
    #[must_use]
    pub fn of_earlier_version(mut self, base: &SampleConsensusParams) -> Self {
        self.turns = self.turns.or(Some(false));
        self.plane_poses = self.plane_poses.or(Some(false));
        self.hypotheses = self.hypotheses.or(Some(1));
        self.hopeless = self.hopeless.or(Some(0.0));
        // All samples were drawn in any case, so the confidence had no effect.
        if self.min_iterations.is_some() && self.min_iterations == self.max_iterations {
            self.confidence = Some(1.0);
        }
        self.among(&self.over(base).settings())
    }

    /// `base` with these changes; changes that have no effect are left out.
    fn over(self, base: &SampleConsensusParams) -> SampleConsensusParams {
        let all = self.or(base.settings()).or(Self::DEFAULTS);
        let search = all.search();
        SampleConsensusParams {
            geometry: match have(all.geometry) {
                GeometryName::Essential => Geometry::Essential {
                    cheirality: have(all.cheirality),
                    plane_poses: have(all.plane_poses),
                    tangent_sampson: have(all.tangent_sampson),
                    hypotheses: if search.score.uses_turns() {
                        have(all.hypotheses)
                    } else {
                        1
                    },
                    hopeless: search.hopeless_after().map_or(0.0, |_| have(all.hopeless)),
                },
                GeometryName::Fundamental => Geometry::Fundamental {
                    degensac: have(all.degensac),
                },
            },
            score: search.score,
            sampler: search.sampler,
            early_stop: search.early_stop,
            max_iterations: search.max_iterations,
            local_steps: search.local_steps,
            final_refinement: all.final_refinement(),
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
    use crate::geometry::Loss;
    use crate::robust::{SampleConsensus, Score, ScoreName, presets};

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
    fn several_hypotheses_are_there_only_with_turns() {
        let several = Settings {
            hypotheses: Some(8),
            ..Settings::default()
        };
        let changed = presets::adaptive().with(several).expect("it uses turns");
        assert_eq!(changed.settings().hypotheses, Some(8));
        assert!(presets::best().with(several).is_err());
        let turns = |turns| Settings {
            turns: Some(turns),
            ..Settings::default()
        };
        let points_alone = changed.with(turns(false)).expect("it has that choice");
        assert_eq!(points_alone.settings().hypotheses, None);
        assert!(SampleConsensus::new(points_alone).is_ok());
        let again = points_alone.with(turns(true)).expect("it has that choice");
        assert_eq!(again.settings().hypotheses, Some(1));
        let none = Settings {
            hypotheses: Some(0),
            ..Settings::default()
        };
        let none = presets::adaptive().with(none).expect("it acts");
        assert!(SampleConsensus::new(none).is_err());
    }

    #[test]
    fn a_search_that_never_stops_early_is_never_hopeless() {
        let settings = |confidence, hopeless| Settings {
            confidence,
            hopeless,
            ..Settings::default()
        };
        let adaptive = presets::adaptive();
        assert_eq!(adaptive.settings().hopeless, Some(0.1));
        let all = adaptive.with(settings(Some(1.0), None));
        let all = all.expect("no early stop");
        assert_eq!(all.settings().hopeless, None);
        assert!(SampleConsensus::new(all).is_ok());
        assert!(all.with(settings(None, Some(0.1))).is_err());
        // Nor is one that must draw all its samples.
        let fewer = Settings {
            max_iterations: Some(1000),
            ..Settings::default()
        };
        let fewer = adaptive.with(fewer).expect("as many as it must draw");
        assert_eq!(fewer.settings().hopeless, None);
        assert!(SampleConsensus::new(fewer).is_ok());
        assert!(fewer.with(settings(None, Some(0.1))).is_err());
        let by_field = SampleConsensusParams {
            max_iterations: 1000,
            ..adaptive
        };
        let refused = SampleConsensus::new(by_field).expect_err("it would do nothing");
        assert!(refused.to_string().contains("hopeless"), "{refused}");
        for (hopeless, is_allowed) in [(0.0, true), (1.0, true), (1.1, false), (f64::NAN, false)] {
            let changed = presets::best().with(settings(None, Some(hopeless)));
            let built = SampleConsensus::new(changed.expect("it acts"));
            assert_eq!(built.is_ok(), is_allowed, "{hopeless}");
        }
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
    fn a_confidence_of_1_is_no_early_stop_and_the_refusal_of_another_says_so() {
        let confidence = |confidence| Settings {
            confidence: Some(confidence),
            ..Settings::default()
        };
        let all = presets::best()
            .with(confidence(1.0))
            .expect("no early stop");
        assert_eq!(all.early_stop, None);
        assert!(SampleConsensus::new(all).is_ok());
        let more = presets::best()
            .with(confidence(1.5))
            .expect("checked later");
        let message = SampleConsensus::new(more).expect_err("refused").to_string();
        assert!(
            message.contains("1 by its flat name, is no early stop"),
            "{message}"
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
