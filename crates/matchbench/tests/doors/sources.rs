//! Sources of datasets, each with all its files, to which the doors offer one file after the other.

use super::archives::{doubles, npy, npz};

/// The doors to sources, one a line: the kind of the source, the file that the door offers, below the folder of the
/// source, and the name of the door.
const DOORS: &str = "\
    colmap model/cameras.txt colmap cameras
    colmap model-binary/cameras.bin colmap cameras binary
    tum fr3/groundtruth.txt tum
    kitti kitti/sequences/00/calib.txt kitti
    strecha strecha/images/0000.pgm.camera strecha
    7scenes 7scenes/frame-000000.pose.txt seven scenes
    scannet-raw scan/intrinsic/intrinsic_color.txt scan
    euroc euroc/cam0/sensor.yaml euroc sensor
    euroc euroc/state_groundtruth_estimate0/data.csv euroc states
    zeb zeb/room_0000_0001.txt zeb
    oxford oxford/H1to2p oxford
    megadepth views/views.txt views
    nerf nerf/transforms.json nerf
    imc calibrations/calibration_7.h5 imc calibration";

/// A door to a source of a dataset.
pub(super) struct SourceDoor {
    pub(super) name: &'static str,
    pub(super) kind: &'static str,
    pub(super) file: &'static str,
}

/// All of them.
pub(super) fn source_doors() -> impl Iterator<Item = SourceDoor> {
    DOORS.lines().map(|line| {
        let mut words = line.trim().splitn(3, ' ');
        let mut word = || words.next().expect("three words");
        let (kind, file, name) = (word(), word(), word());
        SourceDoor { name, kind, file }
    })
}

/// The files of sources that are sound, each with its path.
pub(super) fn sources() -> Vec<(&'static str, Vec<u8>)> {
    let image = || [&b"P5 4 3 255\n"[..], &[7; 12]].concat();
    let text = |text: &str| text.as_bytes().to_vec();
    let mut files = vec![
        ("model/cameras.txt", text(MODEL_CAMERAS)),
        ("model/images.txt", text(MODEL_IMAGES)),
        ("model-binary/cameras.bin", binary_cameras()),
        ("model-binary/images.bin", binary_image()),
        ("fr3/rgb.txt", text("1 0000.pgm\n2 0001.pgm\n3 0002.pgm\n")),
        ("fr3/groundtruth.txt", text(TRAJECTORY)),
        ("kitti/sequences/00/calib.txt", text(CALIBRATION)),
        (
            "kitti/poses/00.txt",
            text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n"),
        ),
        ("strecha/images/0000.pgm.camera", text(STRECHA)),
        ("7scenes/frame-000000.pose.txt", text(POSE)),
        ("scan/pose/0.txt", text(POSE)),
        (
            "scan/intrinsic/intrinsic_color.txt",
            text("4 0 1.5 0\n0 4 1 0\n0 0 1 0\n0 0 0 1\n"),
        ),
        ("euroc/cam0/sensor.yaml", text(SENSOR)),
        (
            "euroc/cam0/data.csv",
            text("#time,name\n1000000000,a.png\n"),
        ),
        ("euroc/state_groundtruth_estimate0/data.csv", text(STATES)),
        ("zeb/room_0000_0001.txt", text(ZEB)),
        ("oxford/H1to2p", text(HOMOGRAPHY)),
        ("views/views.txt", text(VIEWS)),
        ("nerf/transforms.json", text(TRANSFORMS)),
        ("views/pairs.txt", text("0000.pgm 0001.pgm\n")),
        ("calibrations/calibration_7.h5", IMC_CALIBRATION.to_vec()),
    ];
    for path in [
        "fr3/0000.pgm",
        "fr3/0001.pgm",
        "fr3/0002.pgm",
        "kitti/sequences/00/image_0/000000.pgm",
        "kitti/sequences/00/image_0/000001.pgm",
        "strecha/images/0000.pgm",
        "7scenes/frame-000000.color.pgm",
        "scan/color/0.pgm",
        "oxford/img1.pgm",
        "oxford/img2.pgm",
    ] {
        files.push((path, image()));
    }
    files
}

/// A calibration of the Image Matching Challenge, in HDF5. Included, since this is compiled in `fuzz` too, where tests of
/// this package are elsewhere.
const IMC_CALIBRATION: &[u8] = include_bytes!("../lists/calibration_7.h5");

/// LoFTR's list of ScanNet, with two pairs of a scan.
pub(crate) fn scannet_list() -> Vec<u8> {
    let names: [u16; 8] = [707, 0, 15, 45, 707, 0, 15, 60];
    let names: Vec<u8> = names.iter().flat_map(|name| name.to_le_bytes()).collect();
    let pose = |x| [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0];
    let poses = [pose(-0.25), pose(0.75)].concat();
    npz(&[
        ("name", &npy("<u2", "(2, 4)", &names)),
        ("rel_pose", &doubles("(2, 12)", &poses)),
    ])
}

/// The array of the intrinsics of this scan.
pub(crate) fn intrinsics() -> Vec<u8> {
    doubles(
        "(3, 3)",
        &[575.7, 0.0, 320.5, 0.0, 578.0, 240.4, 0.0, 0.0, 1.0],
    )
}

pub(super) const MODEL_CAMERAS: &str =
    "1 PINHOLE 4 3 4 4 1.5 1\n2 SIMPLE_RADIAL 4 3 4 1.5 1 0.01\n";
const MODEL_IMAGES: &str = "1 1 0 0 0 0 0 0 1 0000.pgm\n\n2 1 0 0 0 1 0 0 2 0001.pgm\n\n";
const TRAJECTORY: &str =
    "# time tx ty tz qx qy qz qw\n1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0.6 0.8\n3 1 2 3 1 0 0 0\n";
const CALIBRATION: &str = "P0: 4 0 1.5 0 0 4 1 0 0 0 1 0\nP1: 1\n";
const STRECHA: &str = "4 0 1.5\n0 4 1\n0 0 1\n0 0 0\n0 0 1\n1 0 0\n0 1 0\n1 2 3\n4 3\n";
const POSE: &str = "1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n";
const SENSOR: &str = "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0, \
    0, 0, 1, 0, 0, 0, 0, 1]\ncamera_model: pinhole\nintrinsics: [4, 4, 1.5, 1]\n\
    distortion_model: radial-tangential\ndistortion_coefficients: [-0.1, 0.01, 0, 0]\n";
const STATES: &str = "#time, p, q\n1000000000,1,2,3,1,0,0,0,9,9\n";
const ZEB: &str = "0000.jpg 0001.jpg 0.5 0.5 4 0 1.5 0 4 1 0 0 1 4 0 1.5 0 4 1 0 0 1 1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1\n";
const HOMOGRAPHY: &str = "1 0 2\n0 1 3\n0.001 0 1\n";
const VIEWS: &str = "0000.pgm 1 0 0 0 1 0 0 0 1 0 0 0 PINHOLE 4 3 4 4 2 1.5\n\
    0001.pgm 1 0 0 0 1 0 0 0 1 1 0 0 SIMPLE_RADIAL 4 3 4 2 1.5 0.01\n";

const TRANSFORMS: &str = "{\"w\": 4, \"h\": 3, \"camera_angle_x\": 1.2, \"k1\": 0.01, \"frames\": [\n\
    {\"file_path\": \"./a\", \"transform_matrix\": [[1, 0, 0, 1], [0, 0, -1, 2], [0, 1, 0, 3], [0, 0, 0, 1]]},\n\
    {\"file_path\": \"b.png\", \"fl_x\": 4, \"cx\": 2.5, \"transform_matrix\": [[1, 0, 0, 1], [0, 1, 0, 2], \
    [0, 0, 1, 3], [0, 0, 0, 1]]}]}\n";

/// The first of [`MODEL_CAMERAS`] as COLMAP's other form has it.
pub(super) fn binary_cameras() -> Vec<u8> {
    let mut file = 1_u64.to_le_bytes().to_vec();
    file.extend(1_u32.to_le_bytes());
    file.extend(1_i32.to_le_bytes());
    file.extend([4_u64, 3].iter().flat_map(|side| side.to_le_bytes()));
    file.extend(
        [4.0_f64, 4.0, 1.5, 1.0]
            .iter()
            .flat_map(|x| x.to_le_bytes()),
    );
    file
}

/// One image of the first camera, without keypoints, as COLMAP's other form has it.
fn binary_image() -> Vec<u8> {
    let mut file = 1_u64.to_le_bytes().to_vec();
    file.extend(1_u32.to_le_bytes());
    file.extend(1.0_f64.to_le_bytes());
    file.extend([0; 6 * 8]);
    file.extend(1_u32.to_le_bytes());
    file.extend(b"0000.pgm\0");
    file.extend(0_u64.to_le_bytes());
    file
}
