//! The parameters of a sample consensus by flat names, as people type them and files keep them.
//!
//! `{"score": "msac", "threshold_px": 2}` instead of a tree of choices. A choice (`geometry`, `score`,
//! `sampler`) decides which of the other names act:
//!
//! | name | acts where |
//! | --- | --- |
//! | `geometry`, `max_depth` | a pose is estimated |
//! | `cheirality`, `plane_poses`, `tangent_sampson` | `geometry` is `essential` |
//! | `hypotheses` | `geometry` is `essential`, and `turns` is true |
//! | `hopeless` | `geometry` is `essential`, `confidence` is below 1, and `max_iterations` above 1 and above `min_iterations` |
//! | `degensac` | `geometry` is `fundamental` |
//! | `threshold_px` | `score` is not `lmeds` |
//! | `score_cells`, `turns` | `score` is `even-msac` or `even-marginal` |
//! | `noise_iterations` | `score` is `even-marginal` |
//! | `sprt` | `score` is neither `lmeds` nor `mlesac` |
//! | `prosac_horizon` | `sampler` is `prosac` |
//! | `cells` | `sampler` is `spread` |
//! | `min_iterations` | `confidence` is below 1; at 1 all `max_iterations` samples are drawn |
//! | `final_loss` | `final_steps` is not 0 |
//! | `one_side` | a homography is estimated |
//!
//! The others always act. A name that does not act is refused, as an unknown one is.

use serde::{Deserialize, Serialize};

use super::parts::{EarlyStop, FinalRefinement, Sampler, Score};
use super::search::Search;
use crate::geometry::Loss;
use crate::params::ParamError;

/// Name of a [`Geometry`](super::Geometry).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum GeometryName {
    /// An essential matrix, from five matches; the calibration is used.
    Essential,
    /// A fundamental matrix, from seven matches. Lens and calibration are undone before; that it is essential is not used.
    Fundamental,
}

/// Name of a [`Score`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ScoreName {
    /// The number of inliers.
    InlierCount,
    /// An inlier counts more if it is nearer to the model.
    Msac,
    /// An inlier counts more if it is nearer to the model, and if fewer matches lie around it.
    EvenMsac,
    /// As `even-msac`, at many noise levels about that of the pair, which is estimated.
    EvenMarginal,
    /// The loss of a distance, in the mean of all noise levels up to a largest one (MAGSAC++).
    Magsac,
    /// The likelihood of all distances under a normal distribution (inliers) and a uniform one.
    Mlesac,
    /// The least median of squared distances, which needs no threshold.
    #[serde(alias = "median")]
    Lmeds,
}

/// Name of a [`Sampler`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum SamplerName {
    /// All matches are equally likely.
    Uniform,
    /// The least ambiguous matches first.
    Prosac,
    /// Sparse parts of the image as often as dense ones.
    Spread,
}

macro_rules! settings {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $default:expr,)*) => {
        /// Parameters of a [`SampleConsensusParams`](super::SampleConsensusParams) or of
        /// [`HomographyParams`](super::HomographyParams) by flat names; `None` for those that are left out.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
        #[serde(default, deny_unknown_fields)]
        pub struct Settings {
            $($(#[$doc])* #[serde(skip_serializing_if = "Option::is_none")] pub $name: Option<$type>,)*
        }

        impl Settings {
            /// The values of parameters that neither the user nor the preset gives, which are needed if another
            /// choice gives them an effect.
            pub(super) const DEFAULTS: Self = Self { $($name: Some($default),)* };

            /// The names that have a value.
            pub(super) fn names(&self) -> Vec<&'static str> {
                let mut names = Vec::new();
                $(if self.$name.is_some() {
                    names.push(stringify!($name));
                })*
                names
            }

            /// These settings, with `others` for those that are left out.
            pub(super) fn or(self, others: Self) -> Self {
                Self { $($name: self.$name.or(others.$name),)* }
            }

            /// Only the settings that `others` has too.
            pub(super) fn among(self, others: &Self) -> Self {
                Self { $($name: self.$name.filter(|_| others.$name.is_some()),)* }
            }
        }
    };
}

settings! {
    /// The matrix that is estimated.
    geometry: GeometryName = GeometryName::Essential,
    /// The score, which says which model is best.
    score: ScoreName = ScoreName::Msac,
    /// The sampler, which says which matches are tried next.
    sampler: SamplerName = SamplerName::Uniform,
    /// Required probability that at least one sample is free of wrong matches, as if samples were drawn uniformly;
    /// 0 to 1, where 1 means that sampling does not stop early.
    confidence: f64 = 0.999,
    /// Largest distance of an inlier, in pixels; only a first guess where the score estimates the noise.
    threshold_px: f64 = 1.0,
    /// Whether scene points must lie in front of both cameras while models are compared.
    cheirality: bool = true,
    /// Whether, at the end, the best pose is compared with the two poses that a plane of its inliers allows.
    plane_poses: bool = false,
    /// Whether distances are measured in units of the image where a lens distorts (tangent Sampson distance).
    tangent_sampson: bool = false,
    /// Number of models that differ which the search keeps, to choose among them at the end by how well each predicts how
    /// far keypoints turned and grew; 1 to 1000, where 1 is the best alone.
    hypotheses: usize = 1,
    /// A search ends after a quarter of `max_iterations` samples, or after `min_iterations` if these are more, if the pose
    /// so far is right with a probability below this; 0 to 1, where 0 is never.
    hopeless: f64 = 0.0,
    /// Whether a matrix whose sample lies mostly on one plane is replaced by one that also explains matches off the
    /// plane (DEGENSAC).
    degensac: bool = true,
    /// Whether bad models are abandoned early, by a sequential probability ratio test.
    sprt: bool = true,
    /// Least number of samples.
    min_iterations: usize = 50,
    /// Largest number of samples, at least 1.
    max_iterations: usize = 1000,
    /// Largest number of steps of each local optimisation, 0 to 1000; 0 for none.
    local_steps: usize = 10,
    /// The cost of residuals in the refinement of the best model.
    final_loss: Loss = Loss::Truncated,
    /// Largest number of steps of the refinement of the best model, 0 to 1000; 0 for no refinement.
    final_steps: usize = 25,
    /// Number of samples after which all matches are equally likely, at least 1.
    prosac_horizon: usize = 200_000,
    /// Cells across and down of the grid over image `a` from which samples are drawn evenly; 1 to 1000.
    cells: u32 = 20,
    /// Cells across and down of the grid that finds crowds of matches; 1 to 1000.
    score_cells: u32 = 10,
    /// Whether matches whose keypoints are turned by another angle than most are trusted less.
    turns: bool = false,
    /// Number of samples that are drawn first to estimate the noise of the pair; with 0 it is not estimated.
    noise_iterations: usize = 100,
    /// Scene points farther than this, in baselines, do not support a pose; positive.
    max_depth: f64 = 50.0,
    /// Whether the plane is seen from the same side in both images.
    one_side: bool = true,
}

/// Where a setting acts, as in the table above.
fn acts_where(name: &str) -> &'static str {
    match name {
        "geometry" | "max_depth" => "a pose is estimated",
        "cheirality" | "plane_poses" | "tangent_sampson" => "`geometry` is `essential`",
        "hypotheses" => "`geometry` is `essential`, and `turns` is true",
        "hopeless" => {
            "`geometry` is `essential`, `confidence` is below 1, and `max_iterations` above 1 and above `min_iterations`"
        }
        "degensac" => "`geometry` is `fundamental`",
        "threshold_px" => "`score` is not `lmeds`",
        "score_cells" | "turns" => "`score` is `even-msac` or `even-marginal`",
        "noise_iterations" => "`score` is `even-marginal`",
        "sprt" => "`score` is neither `lmeds` nor `mlesac`",
        "prosac_horizon" => "`sampler` is `prosac`",
        "cells" => "`sampler` is `spread`",
        "min_iterations" => "`confidence` is below 1",
        "final_loss" => "`final_steps` is not 0",
        "one_side" => "a homography is estimated",
        _ => "another choice is made",
    }
}

/// A value that [`Settings::DEFAULTS`] has filled in.
pub(super) fn have<T>(value: Option<T>) -> T {
    value.expect("the defaults have every name")
}

impl Settings {
    /// Those of a search and of a refinement, that act.
    pub(super) fn of(search: &Search, refinement: Option<FinalRefinement>) -> Self {
        let mut flat = Self {
            score: Some(match search.score {
                Score::InlierCount { .. } => ScoreName::InlierCount,
                Score::Msac { .. } => ScoreName::Msac,
                Score::EvenMsac { .. } => ScoreName::EvenMsac,
                Score::EvenMarginal { .. } => ScoreName::EvenMarginal,
                Score::Magsac { .. } => ScoreName::Magsac,
                Score::Mlesac { .. } => ScoreName::Mlesac,
                Score::Lmeds => ScoreName::Lmeds,
            }),
            threshold_px: search.score.threshold_px(),
            sprt: search.score.sprt(),
            confidence: Some(search.early_stop.map_or(1.0, |stop| stop.confidence)),
            min_iterations: search.early_stop.map(|stop| stop.min_iterations),
            max_iterations: Some(search.max_iterations),
            local_steps: Some(search.local_steps),
            final_loss: refinement.map(|refinement| refinement.loss),
            final_steps: Some(refinement.map_or(0, |refinement| refinement.steps)),
            score_cells: search.score.cells(),
            turns: search.score.turns(),
            ..Self::default()
        };
        if let Score::EvenMarginal {
            noise_iterations, ..
        } = search.score
        {
            flat.noise_iterations = Some(noise_iterations);
        }
        match search.sampler {
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

    /// The search of these settings, none of which may be left out.
    pub(super) fn search(&self) -> Search {
        let threshold_px = have(self.threshold_px);
        let sprt = have(self.sprt);
        Search {
            score: match have(self.score) {
                ScoreName::InlierCount => Score::InlierCount { threshold_px, sprt },
                ScoreName::Msac => Score::Msac { threshold_px, sprt },
                ScoreName::EvenMsac => Score::EvenMsac {
                    threshold_px,
                    cells: have(self.score_cells),
                    turns: have(self.turns),
                    sprt,
                },
                ScoreName::EvenMarginal => Score::EvenMarginal {
                    threshold_px,
                    noise_iterations: have(self.noise_iterations),
                    cells: have(self.score_cells),
                    turns: have(self.turns),
                    sprt,
                },
                ScoreName::Magsac => Score::Magsac { threshold_px, sprt },
                ScoreName::Mlesac => Score::Mlesac { threshold_px },
                ScoreName::Lmeds => Score::Lmeds,
            },
            sampler: match have(self.sampler) {
                SamplerName::Uniform => Sampler::Uniform,
                SamplerName::Prosac => Sampler::Prosac {
                    horizon: have(self.prosac_horizon),
                },
                SamplerName::Spread => Sampler::Spread {
                    cells: have(self.cells),
                },
            },
            early_stop: (have(self.confidence) != 1.0).then(|| EarlyStop {
                confidence: have(self.confidence),
                min_iterations: have(self.min_iterations),
            }),
            max_iterations: have(self.max_iterations),
            local_steps: have(self.local_steps),
        }
    }

    /// The refinement of these settings, none of which may be left out.
    pub(super) fn final_refinement(&self) -> Option<FinalRefinement> {
        (have(self.final_steps) > 0).then(|| FinalRefinement {
            loss: have(self.final_loss),
            steps: have(self.final_steps),
        })
    }

    /// Refuses changes that would have no effect; the error lists the settings that have one.
    pub(super) fn check_acting(&self, acting: &Self) -> Result<(), ParamError> {
        let acting = acting.names();
        match self.names().iter().find(|name| !acting.contains(name)) {
            Some(name) => Err(ParamError(format!(
                "`{name}` does nothing here: it acts where {}; what acts is {}",
                acts_where(name),
                acting.join(", ")
            ))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_always_act_says_where() {
        let names = Settings::DEFAULTS.names().into_iter();
        let always: Vec<&str> = names
            .filter(|name| acts_where(name) == "another choice is made")
            .collect();
        assert_eq!(
            always,
            [
                "score",
                "sampler",
                "confidence",
                "max_iterations",
                "local_steps",
                "final_steps"
            ]
        );
    }
}
