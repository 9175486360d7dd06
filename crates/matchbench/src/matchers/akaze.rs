//! `akaze`: all 486 bits of M-LDB, as in the paper.

use matchbench_vision::features::akaze::{Akaze, AkazeParams};

use super::local_features::LocalFeatures;

pub(super) const AKAZE: LocalFeatures<AkazeParams> = LocalFeatures {
    id: "akaze",
    summary: "AKAZE, exact nearest neighbours, ratio test",
    reference: "P. F. Alcantarilla, J. Nuevo, A. Bartoli, \"Fast Explicit Diffusion for \
                Accelerated Features in Nonlinear Scale Spaces\", BMVC 2013",
    revision: 1,
    removed: &[],
    detection: |_| None,
    extractor: |params| Ok(Box::new(Akaze::new(params)?)),
};
