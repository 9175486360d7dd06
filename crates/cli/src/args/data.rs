//! Arguments of the commands about datasets: import, convert, validate.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::threads::Threads;

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  matchbench import tum rgbd_dataset_freiburg1_desk desk --pairs window:9,stride:15
  matchbench import kitti dataset 04-kitti --sequence 00 --pairs fragments:5
  matchbench import kitti dataset kitti-colour --sequence 00 --sensor image_2
  matchbench import strecha castle-P30 05-castle --pairs all
  matchbench import folder photos mine --poses photos/poses.txt --camera photos/K.txt
  matchbench import superglue scannet_test_pairs_with_gt.txt scannet-1500 --image-root ScanNet
  matchbench import scannet test.npz scannet-1500 --intrinsics intrinsics.npz --image-root ScanNet
  matchbench import image-pairs pairs_calibrated.txt scannet-gf --image-root scannet1500
  matchbench import megadepth 0015_0.1_0.3.npz st-peters --image-root MegaDepth
  matchbench import scannet-raw scene0000_00 scene0 --pairs window:9,stride:15
  matchbench import colmap sparse/0 church --image-root images --pairs covisible:0.1..0.7
  matchbench import nerf lego/transforms_train.json lego --pairs window:5
  matchbench import oxford boat oxford-boat
  matchbench import rendered office office

Every KIND has --images and --property; which others it has: matchbench list datasets. Where images
are not there, the dataset names where they belong, and `matchbench validate` says which are
missing.

The pairs of the paper, and more:
  fragments:15        consecutive fragments of 15 frames, the first of each against its others
  all                 every image against every later one
  window:9            every image against the next 9
  window:9,stride:15  the same on every 15th image; the others are left out
  list:FILE           a pair a line: names of images, or numbers of frames of OUT from 0
  covisible:0.1..0.7  pairs that share this fraction of their points (COLMAP models)")]
pub(crate) struct ImportArgs {
    /// What SRC is: tum, kitti, strecha, 7scenes, folder, superglue, image-pairs, scannet, scannet-raw,
    /// megadepth, colmap, nerf, imc, euroc, zeb, hpatches, oxford, evd or rendered
    #[arg(value_name = "KIND")]
    pub kind: String,
    /// The data as their authors publish them: a folder, a list, a model
    #[arg(value_name = "SRC")]
    pub source: PathBuf,
    /// The dataset to be made; the folder's name becomes the dataset's name
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// Which images are matched with which [default: that of the kind, see `matchbench list datasets`]
    #[arg(long, value_name = "RULE")]
    pub pairs: Option<String>,
    /// Which sequence, if SRC holds several (KITTI: 00 to 10; HPatches: i, v or a folder)
    #[arg(long, value_name = "NN")]
    pub sequence: Option<String>,
    /// Which camera of a rig (KITTI: image_0 to image_3; EuRoC: cam0 or cam1) [default: the first that is
    /// there]
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Whether the images stay where they are, are linked to, or are copied
    #[arg(long, value_enum, default_value_t = Images::Reference)]
    pub images: Images,
    /// 3x3 calibration matrix (and distortion `k1 k2 p1 p2 [k3]`), if SRC has none, or to use instead of the
    /// one in SRC
    #[arg(long, value_name = "FILE")]
    pub camera: Option<PathBuf>,
    /// The poses, one line for each image (KIND folder): in TUM's or KITTI's format, or the 16 numbers of a 4x4
    /// matrix
    #[arg(long, value_name = "FILE")]
    pub poses: Option<PathBuf>,
    /// Where the camera is on the body whose poses SRC has, such as a depth camera, an inertial sensor or a
    /// robot: `[R t]` of body_from_camera, 3x4 or 4x4
    #[arg(long, value_name = "FILE")]
    pub body_from_camera: Option<PathBuf>,
    /// Largest difference in time between an image and its pose, in seconds [default: 0.02]
    #[arg(long, value_name = "SECONDS")]
    pub tolerance: Option<f64>,
    /// Interpolate between the poses before and after an image instead of taking the nearest
    #[arg(long)]
    pub interpolate: bool,
    /// Folder to which the image names in SRC are relative [default: beside SRC]
    #[arg(long, value_name = "DIR")]
    pub image_root: Option<PathBuf>,
    /// What the images show, in a few words, for the report: "indoor, office"
    #[arg(long, value_name = "TEXT")]
    pub property: Option<String>,
    /// The calibration matrices (ScanNet's intrinsics.npz) [default: beside SRC]
    #[arg(long, value_name = "FILE")]
    pub intrinsics: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Layouts:
  colmap     a folder with a COLMAP model as text (cameras, images, no points) and pairs.txt
  superglue  a file with SuperGlue's 38 columns per pair: names, turns, K, K, T_0to1

Both can be imported again, as kinds of the same names. The COLMAP model has no points, so import
it with a rule that needs none, such as --pairs all or --pairs list:OUT/pairs.txt. The list of
SuperGlue has no frames that are in no pair, and no absolute poses. The images are not copied.

Examples:
  matchbench convert castle castle-model --format colmap
  matchbench convert castle castle-pairs.txt --format superglue")]
pub(crate) struct ConvertArgs {
    /// The dataset folder
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// The file or folder to write; it must not exist
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// The layout: colmap or superglue
    #[arg(long, value_name = "LAYOUT")]
    pub format: String,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Images {
    /// The images stay where they are, and the dataset names the files
    Reference,
    /// Symbolic links in the folder of the dataset
    Link,
    /// Copies in the folder of the dataset, which can then be moved and mailed
    Copy,
}

#[derive(Debug, Args)]
pub(crate) struct ValidateArgs {
    /// The dataset folder
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// Print every problem. Without this option, only the first ten problems of the same kind are printed, and
    /// the others are counted
    #[arg(long)]
    pub all: bool,
    #[command(flatten)]
    pub threads: Threads,
}
