//! Combinations of parts that have a name, each as the parameters of a [`SampleConsensus`](super::SampleConsensus)
//! or, `*_h`, of a [`HomographyConsensus`](super::HomographyConsensus).
//!
//! A preset only sets defaults: every field can be changed, and what a choice does not need is not there
//! to be set. `*_e` estimates an essential matrix from five matches, `*_f` a fundamental matrix from seven.
//! The reference estimator of the benchmark, `ransac-e`, is a type of its own: [`Ransac`](super::Ransac).
//!
//! ```
//! use matchbench_vision::robust::{SampleConsensus, SampleConsensusParams, presets};
//!
//! let estimator = SampleConsensus::new(presets::rich())?;
//! let patient = SampleConsensusParams { max_iterations: 50_000, ..presets::best() };
//! let other = SampleConsensus::new(patient)?;
//! # Ok::<(), matchbench_vision::ParamError>(())
//! ```

use super::{
    EarlyStop, FinalRefinement, Geometry, HomographyParams, SampleConsensusParams, Sampler, Score,
};
use crate::geometry::Loss;

/// Our recommendation for points alone: progressive samples, a score that crowded matches do not dominate, local
/// optimisation, robust refinement.
///
/// | field | value | why |
/// | --- | --- | --- |
/// | `sampler` | PROSAC | the ratio test has ordered the matches; uniform samples need several times as many |
/// | `score` | even MSAC | matches that lie close together are no independent witnesses |
/// | `score.threshold_px` | 2 | tuned on the kitchen of 7-Scenes, 0.7 to 3 |
/// | `final_refinement.loss` | Cauchy | the same |
/// | `early_stop.min_iterations` | 1000 | the same, 50 to 1000: an early model with many inliers need not be the best |
/// | `max_iterations` | 20,000 | hopeless pairs end after about 0.04 s |
pub fn best() -> SampleConsensusParams {
    SampleConsensusParams {
        score: EVEN_MSAC_2_PX,
        sampler: PROSAC,
        early_stop: at_least(1000),
        max_iterations: 20_000,
        final_refinement: Some(FinalRefinement {
            loss: Loss::Cauchy,
            steps: 25,
        }),
        ..SampleConsensusParams::default()
    }
}

/// Needs no threshold. It is [`best`] with five changes: the score is averaged over three thresholds around five times
/// the noise that is estimated for each pair; matches whose turn is unlike that of most are trusted less; the poses that
/// a plane allows are tried; of several poses the one is chosen that predicts how keypoints turned and grew; and a
/// hopeless pair is given up early.
///
/// | field | value | why |
/// | --- | --- | --- |
/// | `score` | even marginal | see [`EvenMarginal`](super::EvenMarginal) |
/// | `score.threshold_px` | 2 | a first guess: the mean AUC on the tuning scenes is the same from 0.5 to 4 |
/// | `score.turns` | yes | tuned on the same: 0.007 more in the mean of five features |
/// | `geometry.plane_poses` | yes | tuned on the kitchen and four rendered scenes: where most is on a plane, samples off it are rare |
/// | `geometry.hypotheses` | 8 | tuned on these: 0.006 more in the mean of five features; 32 are no better |
/// | `geometry.hopeless` | 0.1 | on these the mean AUC is the same as with 0, within 0.0003; with 0.2 it is 0.0004 lower on the kitchen |
pub fn adaptive() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: Geometry::Essential {
            cheirality: true,
            plane_poses: true,
            tangent_sampson: false,
            hypotheses: 8,
            hopeless: 0.1,
        },
        score: Score::EvenMarginal {
            threshold_px: 2.0,
            noise_iterations: 100,
            cells: 10,
            turns: true,
            sprt: true,
        },
        ..best()
    }
}

/// For tens of thousands of matches: spatially even samples and an even score. This is our substitute for the
/// unpublished estimator of Lin et al., "RepMatch", ECCV 2016, which the MatchBench paper uses with CODE, RepMatch
/// and GMS.
///
/// | field | value | why |
/// | --- | --- | --- |
/// | `sampler` | spatially even | most of very many matches lie on few surfaces |
/// | `score` | even MSAC | the same: crowds of matches on one surface do not dominate |
/// | `score.threshold_px` | 3 | tuned on the kitchen of 7-Scenes (with GMS and CODE), 1.5 to 4 |
/// | `early_stop.min_iterations` | 1000 | the same, 50 to 1000 |
/// | `final_refinement.loss` | truncated | the same; Cauchy's is no better |
/// | `max_iterations` | 5000 | bounds the time |
pub fn rich() -> SampleConsensusParams {
    SampleConsensusParams {
        score: Score::EvenMsac {
            threshold_px: 3.0,
            cells: 10,
            turns: false,
            sprt: true,
        },
        sampler: Sampler::Spread { cells: 20 },
        early_stop: at_least(1000),
        max_iterations: 5000,
        ..SampleConsensusParams::default()
    }
}

/// Locally optimised sample consensus with the MSAC score (Lebeda, Matas, Chum, "Fixing the Locally
/// Optimized RANSAC", BMVC 2012). The threshold of 2 pixels was tuned on the kitchen of 7-Scenes, 0.5 to 3.
pub fn lo_ransac_e() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: ESSENTIAL,
        score: Score::Msac {
            threshold_px: 2.0,
            sprt: false,
        },
        ..SampleConsensusParams::default()
    }
}

/// MAGSAC++ (Barath, Noskova, Ivashechkin, Matas, CVPR 2020): scores models over all noise levels up to a
/// largest one.
pub fn magsac_e() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: ESSENTIAL,
        score: Score::Magsac {
            threshold_px: 3.0,
            sprt: false,
        },
        ..SampleConsensusParams::default()
    }
}

/// Maximum likelihood (Torr, Zisserman, "MLESAC", CVIU 78(1), 2000).
pub fn mlesac_e() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: ESSENTIAL,
        score: Score::Mlesac { threshold_px: 1.0 },
        ..plain(1000)
    }
}

/// RANSAC with progressive samples (Chum, Matas, "Matching with PROSAC", CVPR 2005). The threshold of 1.5
/// pixels was tuned on the kitchen of 7-Scenes, 0.5 to 3.
pub fn prosac_e() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: ESSENTIAL,
        score: inlier_count(1.5),
        sampler: PROSAC,
        ..plain(1000)
    }
}

/// Least median of squares (Rousseeuw, JASA 79, 1984). With half of the matches wrong, 218 samples contain a
/// right one with probability 0.999.
pub fn lmeds_e() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: ESSENTIAL,
        score: Score::Lmeds,
        early_stop: None,
        ..plain(218)
    }
}

/// Least median of squares over samples of seven matches, of which 881 are needed.
pub fn lmeds_f() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: FUNDAMENTAL,
        score: Score::Lmeds,
        early_stop: None,
        ..plain(881)
    }
}

/// Five-point RANSAC with the settings that SuperGlue and most later learned matchers give to OpenCV for their
/// scores: like [`Ransac`](super::Ransac), but only the inliers choose among the four decompositions, at any depth.
///
/// | field | value | OpenCV |
/// | --- | --- | --- |
/// | `score`, `sampler` | inlier count, uniform | `findEssentialMat(.., RANSAC)` |
/// | `early_stop.confidence` | 0.99999 | its `prob` |
/// | `max_iterations` | 1000 | its default |
/// | `max_depth` | 1e9 | `recoverPose(.., 1e9, mask)` |
pub fn ransac_e_inliers() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: ESSENTIAL,
        score: inlier_count(1.0),
        early_stop: Some(EarlyStop {
            confidence: 0.99999,
            min_iterations: 0,
        }),
        max_depth: 1e9,
        ..plain(1000)
    }
}

/// Seven-point RANSAC (Hartley, Zisserman, "Multiple View Geometry", 2004, sec. 11.1.2).
pub fn ransac_f() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: FUNDAMENTAL,
        score: inlier_count(1.0),
        ..plain(1000)
    }
}

/// The configuration of USAC that the MatchBench paper's authors used: PROSAC, the sequential probability
/// ratio test, the degeneracy check, local optimisation, 1.5 pixels and confidence 0.99 (Raguram et al.,
/// "USAC: A Universal Framework for Random Sample Consensus", PAMI 35(8), 2013).
pub fn usac_f() -> SampleConsensusParams {
    SampleConsensusParams {
        geometry: Geometry::Fundamental { degensac: true },
        score: Score::InlierCount {
            threshold_px: 1.5,
            sprt: true,
        },
        sampler: PROSAC,
        early_stop: Some(EarlyStop {
            confidence: 0.99,
            min_iterations: 0,
        }),
        local_steps: 4,
        ..plain(5000)
    }
}

/// Four-point RANSAC as in OpenCV 4's `findHomography(a, b, RANSAC, 3)`: the homography with the most
/// inliers, refined over them.
///
/// | field | value | source |
/// | --- | --- | --- |
/// | `score.threshold_px` | 3 | the usual value; there of the forward distance alone |
/// | `early_stop.confidence` | 0.995 | OpenCV 4 |
/// | `max_iterations` | 2000 | OpenCV 4 |
/// | `final_refinement.steps` | 10 | OpenCV 4 |
pub fn ransac_h() -> HomographyParams {
    HomographyParams {
        score: inlier_count(3.0),
        early_stop: Some(EarlyStop {
            confidence: 0.995,
            min_iterations: 0,
        }),
        local_steps: 0,
        final_refinement: Some(FinalRefinement {
            loss: Loss::Truncated,
            steps: 10,
        }),
        one_side: false,
        ..HomographyParams::default()
    }
}

/// Our recommendation for homographies: progressive samples, a score that crowds of matches do not dominate,
/// local optimisation, robust refinement.
pub fn best_h() -> HomographyParams {
    HomographyParams {
        score: EVEN_MSAC_2_PX,
        sampler: PROSAC,
        early_stop: at_least(200),
        max_iterations: 10_000,
        final_refinement: Some(FinalRefinement {
            loss: Loss::Cauchy,
            steps: 25,
        }),
        ..HomographyParams::default()
    }
}

const ESSENTIAL: Geometry = Geometry::Essential {
    cheirality: false,
    plane_poses: false,
    tangent_sampson: false,
    hypotheses: 1,
    hopeless: 0.0,
};
const FUNDAMENTAL: Geometry = Geometry::Fundamental { degensac: false };
const PROSAC: Sampler = Sampler::Prosac { horizon: 200_000 };
const EVEN_MSAC_2_PX: Score = Score::EvenMsac {
    threshold_px: 2.0,
    cells: 10,
    turns: false,
    sprt: true,
};

fn inlier_count(threshold_px: f64) -> Score {
    Score::InlierCount {
        threshold_px,
        sprt: false,
    }
}

fn at_least(min_iterations: usize) -> Option<EarlyStop> {
    Some(EarlyStop {
        confidence: 0.999,
        min_iterations,
    })
}

/// No local optimisation and no refinement: what is found is the model of one sample.
fn plain(max_iterations: usize) -> SampleConsensusParams {
    SampleConsensusParams {
        early_stop: at_least(0),
        max_iterations,
        local_steps: 0,
        final_refinement: None,
        ..SampleConsensusParams::default()
    }
}

/// Every preset, for tests.
#[cfg(all(test, feature = "serde"))]
pub(super) const ALL: [fn() -> SampleConsensusParams; 12] = [
    best,
    adaptive,
    rich,
    ransac_e_inliers,
    lo_ransac_e,
    magsac_e,
    mlesac_e,
    prosac_e,
    lmeds_e,
    lmeds_f,
    ransac_f,
    usac_f,
];
