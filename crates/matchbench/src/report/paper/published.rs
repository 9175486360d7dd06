//! The numbers of the paper's Tables 1 to 3 (Bian et al.: "MatchBench: An Evaluation of Feature Matchers"), as
//! they are printed.

/// A sequence in Table 1.
pub(super) struct Sequence {
    /// Its number.
    pub(super) number: &'static str,
    /// Its name.
    pub(super) name: &'static str,
    pub(super) images: &'static str,
    pub(super) pairs: &'static str,
    pub(super) resolution: &'static str,
    pub(super) property: &'static str,
}

const fn sequence(
    [number, name, images, pairs, resolution, property]: [&'static str; 6],
) -> Sequence {
    Sequence {
        number,
        name,
        images,
        pairs,
        resolution,
        property,
    }
}

/// Table 1. Resolutions are rows by columns but for castle's.
pub(super) const SEQUENCES: [Sequence; 8] = [
    sequence([
        "01",
        "office",
        "2583",
        "2310",
        "480 x 640",
        "indoor, office",
    ]),
    sequence([
        "02",
        "teddy",
        "2405",
        "2234",
        "480 x 640",
        "indoor, non-planar",
    ]),
    sequence([
        "03",
        "large-cabinet",
        "1006",
        "938",
        "480 x 640",
        "indoor, weak texture",
    ]),
    sequence([
        "04",
        "kitti",
        "4542",
        "3632",
        "376 x 1241",
        "outdoor, street-view",
    ]),
    sequence(["05", "castle", "30", "435", "3072 x 2048", "outdoor, urban"]),
    sequence([
        "06",
        "office-wide",
        "173",
        "1512",
        "480 x 640",
        "same with 01",
    ]),
    sequence([
        "07",
        "teddy-wide",
        "161",
        "1404",
        "480 x 640",
        "same with 02",
    ]),
    sequence([
        "08",
        "large-cabinet-wide",
        "68",
        "567",
        "480 x 640",
        "same with 03",
    ]),
];

/// Sequences of the short-baseline portion, the first ones.
pub(super) const SHORT: usize = 4;

/// A matcher in Tables 2 and 3.
pub(super) struct Matcher {
    /// Our id of it.
    pub(super) id: &'static str,
    /// AUC on each sequence; 0 where it was not run.
    pub(super) auc: [f64; 8],
    /// Features per image, and milliseconds for detection, matching and selection. Times on a graphics
    /// processor are in brackets.
    pub(super) times: [&'static str; 4],
}

const fn matcher(id: &'static str, auc: [f64; 8], times: [&'static str; 4]) -> Matcher {
    Matcher { id, auc, times }
}

/// Tables 2 and 3, in the order of Table 2. FREAK has two rows: our two ways to run it.
#[rustfmt::skip]
pub(super) const MATCHERS: [Matcher; 17] = [
    matcher("sift", [0.375, 0.415, 0.137, 0.939, 0.396, 0.538, 0.179, 0.198], ["1082", "56.4", "21.2", "1.0"]),
    matcher("surf", [0.360, 0.449, 0.159, 0.919, 0.385, 0.456, 0.180, 0.180], ["1432", "63.0", "19.7", "1.0"]),
    matcher("orb", [0.265, 0.328, 0.078, 0.874, 0.338, 0.480, 0.141, 0.115], ["3539", "10.3", "38.2", "1.0"]),
    matcher("brisk", [0.288, 0.260, 0.098, 0.897, 0.329, 0.468, 0.110, 0.127], ["1160", "17.8", "5.4", "1.0"]),
    matcher("kaze", [0.382, 0.408, 0.167, 0.908, 0.377, 0.557, 0.215, 0.177], ["1060", "187.0", "15.5", "1.0"]),
    matcher("akaze", [0.340, 0.388, 0.121, 0.897, 0.358, 0.456, 0.169, 0.127], ["726", "29.7", "3.6", "1.0"]),
    matcher("dlco", [0.379, 0.420, 0.131, 0.935, 0.415, 0.543, 0.195, 0.210], ["1082", "430.4", "21.7", "1.0"]),
    matcher("freak", [0.339, 0.370, 0.128, 0.927, 0.348, 0.435, 0.134, 0.156], ["919", "43.9", "3.2", "1.0"]),
    matcher("freak-sift", [0.339, 0.370, 0.128, 0.927, 0.348, 0.435, 0.134, 0.156], ["919", "43.9", "3.2", "1.0"]),
    matcher("binboost", [0.378, 0.404, 0.134, 0.936, 0.375, 0.508, 0.170, 0.185], ["1082", "94.0", "4.2", "1.0"]),
    matcher("latch", [0.348, 0.392, 0.124, 0.909, 0.349, 0.389, 0.134, 0.138], ["984", "86.1", "3.3", "1.0"]),
    matcher("daisy", [0.354, 0.388, 0.112, 0.925, 0.356, 0.493, 0.171, 0.169], ["1082", "79.3", "25.2", "1.0"]),
    matcher("kvld", [0.0, 0.0, 0.0, 0.0, 0.463, 0.492, 0.150, 0.142], ["1082", "56.4", "21.2", "540.1"]),
    matcher("gaim", [0.0, 0.0, 0.0, 0.0, 0.210, 0.360, 0.142, 0.100], ["45345", "6783.2", "1550.6", "7145.1"]),
    matcher("code", [0.0, 0.0, 0.0, 0.0, 0.447, 0.809, 0.436, 0.476], ["64609", "(1365.0)", "(970.1)", "3079.6"]),
    matcher("repmatch", [0.0, 0.0, 0.0, 0.0, 0.535, 0.766, 0.425, 0.473], ["64609", "(1365.0)", "(970.1)", "10779.6"]),
    matcher("gms", [0.508, 0.605, 0.251, 0.955, 0.433, 0.605, 0.332, 0.347], ["9463", "33.0", "(12.4)", "1.3"]),
];
