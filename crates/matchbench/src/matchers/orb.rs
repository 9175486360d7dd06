//! `orb`: with up to 100,000 features, as in the paper.

use matchbench_vision::features::orb::{Orb, OrbParams};

use super::local_features::LocalFeatures;

pub(super) const ORB: LocalFeatures<OrbParams> = LocalFeatures {
    id: "orb",
    summary: "ORB, exact nearest neighbours, ratio test",
    reference: "E. Rublee, V. Rabaud, K. Konolige, G. Bradski, \"ORB: an efficient alternative to \
                SIFT or SURF\", ICCV 2011",
    revision: 1,
    removed: &[],
    detection: |_| None,
    extractor: |params| Ok(Box::new(Orb::new(params)?)),
};
