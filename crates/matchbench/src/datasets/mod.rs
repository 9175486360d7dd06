//! Datasets: images with known cameras, and the pairs to be matched.
//!
//! A dataset on disk is a folder in the authors' layout. [`Sequence::open`] reads it, [`write_native`] writes
//! it, and [`validate`] reports what is wrong with it. Data in any other layout are converted to this one by
//! [`import`]. Poses are camera-to-world; `b_from_a` takes points from camera `a` to camera `b`.

mod bring;
mod camera_model;
mod cameras;
mod colour;
mod decode;
mod decode_error;
mod depth;
mod error;
mod exif;
mod exporters;
mod fingerprint;
mod images;
mod importers;
mod jpeg;
mod listed;
mod manifest;
mod names;
mod native;
mod pair_list;
mod pair_poses;
mod pairs;
mod parts;
mod pnm;
mod problem;
pub mod rendered;
mod sequence;
mod stored_depth;
#[cfg(test)]
pub(crate) mod testing;
mod text;
mod tiff;
mod trajectory;
mod truth;
mod turn;
mod validate;
mod write;

pub use camera_model::{CameraModelError, camera_of_model};
pub use cameras::camera_problems;
pub use colour::{decode_planes, read_planes};
pub(crate) use decode::size_of_image;
pub use decode::{decode_gray, gray_of_rgb, read_gray, read_size};
pub use decode_error::{DecodeError, MAX_PIXELS, check_size, limit_pixels};
pub use depth::{Depth, DepthFile, DepthUnit};
pub use error::DatasetError;
pub use exporters::{EXPORTS, Export, export};
pub use fingerprint::Whole;
pub(crate) use importers::RENDERED;
pub use importers::{
    ImportOption, ImportOptions, ImportReport, Imported, KINDS, Kind, import, import_once,
    read_source, reference,
};
pub use manifest::{About, describe};
pub(crate) use names::{ImageNames, Named};
pub use native::Unpaired;
pub use pair_poses::pair_pose_problem;
pub use pairs::{PairRule, PairRuleError, pairs_of, relative_pose};
pub use parts::{dataset_of_part, is_dataset};
pub use problem::{Problem, Severity};
pub use sequence::{Frame, Pair, Sequence, Truth};
pub use stored_depth::decode_depth;
pub use text::rigid_motion_4x4;
pub use trajectory::Association;
pub use truth::{read_dataset_pairs, read_pairs, read_poses_of_pairs};
pub use turn::Turn;
pub use validate::validate;
pub use write::{ImageStorage, write_native};
