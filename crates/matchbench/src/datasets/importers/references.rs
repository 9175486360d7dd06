//! The papers that ask to be cited where their data are used.

/// A source: the id of its kind, how the origin of its datasets begins, and its paper.
type Source = (&'static str, &'static str, &'static str);

/// Sources with a paper. Other kinds hold anybody's data.
const SOURCES: [Source; 12] = [
    (
        "tum",
        "TUM RGB-D, ",
        "J. Sturm, N. Engelhard, F. Endres, W. Burgard, D. Cremers, \"A Benchmark for the Evaluation of RGB-D SLAM \
         Systems\", IROS 2012",
    ),
    (
        "kitti",
        "KITTI odometry, ",
        "A. Geiger, P. Lenz, R. Urtasun, \"Are we ready for Autonomous Driving? The KITTI Vision Benchmark Suite\", \
         CVPR 2012",
    ),
    (
        "strecha",
        "Strecha et al. 2008, ",
        "C. Strecha, W. von Hansen, L. Van Gool, P. Fua, U. Thoennessen, \"On Benchmarking Camera Calibration and \
         Multi-View Stereo for High Resolution Imagery\", CVPR 2008",
    ),
    (
        "7scenes",
        "7-Scenes, ",
        "J. Shotton, B. Glocker, C. Zach, S. Izadi, A. Criminisi, A. Fitzgibbon, \"Scene Coordinate Regression \
         Forests for Camera Relocalization in RGB-D Images\", CVPR 2013",
    ),
    (
        "euroc",
        "EuRoC MAV, ",
        "M. Burri, J. Nikolic, P. Gohl, T. Schneider, J. Rehder, S. Omari, M. W. Achtelik, R. Siegwart, \"The EuRoC \
         Micro Aerial Vehicle Datasets\", International Journal of Robotics Research 35(10), 2016",
    ),
    (
        "scannet",
        "ScanNet, ",
        "A. Dai, A. X. Chang, M. Savva, M. Halber, T. Funkhouser, M. Nießner, \"ScanNet: Richly-annotated 3D \
         Reconstructions of Indoor Scenes\", CVPR 2017",
    ),
    (
        "megadepth",
        "MegaDepth, ",
        "Z. Li, N. Snavely, \"MegaDepth: Learning Single-View Depth Prediction from Internet Photos\", CVPR 2018",
    ),
    (
        "imc",
        "Image Matching Challenge, ",
        "Y. Jin, D. Mishkin, A. Mishchuk, J. Matas, P. Fua, K. M. Yi, E. Trulls, \"Image Matching across Wide \
         Baselines: From Paper to Practice\", International Journal of Computer Vision 129(2), 2021",
    ),
    (
        "zeb",
        "ZEB, ",
        "X. Shen, Z. Cai, W. Yin, M. Müller, Z. Li, K. Wang, X. Chen, C. Wang, \"GIM: Learning Generalizable Image \
         Matcher From Internet Videos\", ICLR 2024",
    ),
    (
        "hpatches",
        "HPatches, ",
        "V. Balntas, K. Lenc, A. Vedaldi, K. Mikolajczyk, \"HPatches: A Benchmark and Evaluation of Handcrafted and \
         Learned Local Descriptors\", CVPR 2017",
    ),
    (
        "oxford",
        "Oxford affine, ",
        "K. Mikolajczyk, T. Tuytelaars, C. Schmid, A. Zisserman, J. Matas, F. Schaffalitzky, T. Kadir, L. Van Gool, \
         \"A Comparison of Affine Region Detectors\", International Journal of Computer Vision 65(1-2), 2005",
    ),
    (
        "evd",
        "Extreme View Dataset, ",
        "D. Mishkin, J. Matas, M. Perdoch, \"MODS: Fast and Robust Method for Two-View Matching\", Computer Vision \
         and Image Understanding 141, 2015",
    ),
];

/// How origins begin of data that come in the layout of a source, and from others.
const OTHERS: [&str; 2] = ["glue-factory, ", "Image Matching Challenge 2025, "];

/// The paper of those whose data a dataset has, as text, by what its `dataset.toml` says of its import and its
/// origin. `None` if that is not known.
pub fn reference(import: &[String], origin: &str) -> Option<&'static str> {
    if OTHERS.iter().any(|start| origin.starts_with(start)) {
        return None;
    }
    let kind = import.first();
    let is_it =
        |(id, start, _): &&Source| kind.is_some_and(|kind| kind == id) || origin.starts_with(start);
    SOURCES.iter().find(is_it).map(|(_, _, paper)| *paper)
}

#[cfg(test)]
mod tests {
    use super::super::KINDS;
    use super::*;

    #[test]
    fn a_source_is_known_by_its_kind_or_its_origin() {
        let of = |origin: &str, import: &[&str]| {
            let import: Vec<String> = import.iter().map(|&word| word.into()).collect();
            reference(&import, origin)
        };
        for (id, start, paper) in SOURCES {
            assert!(KINDS.iter().any(|kind| kind.id == id), "{id}");
            assert_eq!(of("", &[id, "x"]), Some(paper));
            assert_eq!(of(&format!("{start}x; pairs all"), &[]), Some(paper));
        }
        for (origin, import) in [
            ("folder x", &["folder", "x"][..]),
            ("glue-factory, pairs", &["megadepth", "pairs.txt"]),
            (
                "Image Matching Challenge 2025, fort/wall",
                &["imc", "train_labels.csv"],
            ),
            ("", &[]),
        ] {
            assert_eq!(of(origin, import), None, "{origin}");
        }
    }
}
