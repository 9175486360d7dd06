//! `kaze`: 64 values, as in the paper.

use matchbench_vision::features::kaze::{Kaze, KazeParams};

use super::local_features::LocalFeatures;

pub(super) const KAZE: LocalFeatures<KazeParams> = LocalFeatures {
    id: "kaze",
    summary: "KAZE, exact nearest neighbours, ratio test",
    reference: "P. F. Alcantarilla, A. Bartoli, A. J. Davison, \"KAZE Features\", ECCV 2012",
    revision: 2,
    removed: &[],
    detection: |_| None,
    extractor: |params| Ok(Box::new(Kaze::new(params)?)),
};
