//! `dsp-sift`: the keypoints of SIFT, described by means over domain sizes.
//!
//! | parameter | default | source |
//! | --- | --- | --- |
//! | `extractor.sift` | those of `sift` | OpenCV's |
//! | `extractor`, all others | see [`DspSift`] | COLMAP's, but for two |
//!
//! `max_domain` and `domains` were chosen on the kitchen (231 pairs, as for `adalam`), KITTI (40) and rendered scenes, with
//! three repetitions. Mean AUC over the six, and the kitchen's rotation:
//!
//! | sizes | `ransac-e` | `best` | kitchen, rotation, `best` |
//! | --- | ---: | ---: | ---: |
//! | `sift` | 0.619 | 0.715 | 0.731 |
//! | `rootsift` | 0.620 | 0.733 | 0.773 |
//! | 10 from 1/6 to 3, COLMAP's | 0.614 | 0.722 | 0.768 |
//! | the same without roots | 0.601 | 0.716 | 0.698 |
//! | the same on ellipses | 0.621 | 0.725 | 0.755 |
//! | 5 from 1/6 to 3 | 0.613 | 0.722 | 0.782 |
//! | 4 from 1 to 2 | 0.613 | 0.717 | 0.763 |
//! | 6 from 1/2 to 2 | 0.630 | 0.735 | 0.781 |
//! | 5 from 1/2 to 1.5 | 0.641 | 0.734 | 0.785 |
//! | the same without roots | 0.613 | 0.724 | 0.746 |
//! | 6 from 1/6 to 1.75 | 0.645 | 0.743 | 0.792 |
//! | 8 from 1/6 to 1.5 | 0.645 | 0.747 | 0.772 |
//! | 6 from 1/6 to 1.5 | 0.650 | 0.750 | 0.777 |
//! | 4 from 1/6 to 1.5 | 0.647 | 0.749 | 0.769 |
//! | 4 from 1/3 to 4/3 | 0.648 | 0.752 | 0.781 |
//!
//! Sizes larger than that of the keypoint bring more matches and fewer right poses; smaller sizes are what
//! helps. Among the best rows, which hardly differ, those of four sizes are the fastest. Ellipses are no better
//! here, and slow.

use matchbench_vision::features::{DspSift, DspSiftParams};

use super::local_features::LocalFeatures;
use super::sift;

pub(super) const DSP_SIFT: LocalFeatures<DspSiftParams> = LocalFeatures {
    id: "dsp-sift",
    summary: "DSP-SIFT: SIFT pooled over domain sizes, exact nearest neighbours, ratio test",
    reference: "J. Dong, S. Soatto, \"Domain-Size Pooling in Local Descriptors: DSP-SIFT\", CVPR 2015",
    revision: 1,
    removed: &[],
    detection: |params| Some(sift::detection(&params.sift)),
    extractor: |params| Ok(Box::new(DspSift::new(params)?)),
};
