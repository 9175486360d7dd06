//! Two-view geometry: cameras, relative pose and its error, epipolar geometry, triangulation, minimal
//! solvers.

mod camera;
mod cheirality;
mod covariances;
mod distortion;
mod epipolar;
mod essential;
mod fisheye;
mod hand_eye;
mod homography;
mod lens;
mod levenberg_marquardt;
mod matched_points;
mod normalisation;
mod patch_change;
mod plane;
mod point_pairs;
mod pose;
mod refine;
mod refine_homography;
pub mod solvers;
mod triangulation;

pub use camera::{Camera, CameraError};
pub use cheirality::choose_pose;
pub(crate) use cheirality::pose_support;
pub use covariances::Covariances;
pub use distortion::Distortion;
pub use epipolar::{agree_in_orientation, epipole_in_b, squared_sampson_distances};
pub use essential::{decompose_essential, essential_defect, essential_from_pose};
pub use fisheye::Fisheye;
pub use hand_eye::camera_from_body;
pub use homography::{corner_error, squared_transfer_distances, transfer};
pub use lens::Lens;
pub use levenberg_marquardt::Loss;
pub use matched_points::MatchedPoints;
pub(crate) use normalisation::normalisation;
pub(crate) use patch_change::{PatchChange, PatchChanges};
pub use plane::essentials_of_plane;
pub use point_pairs::PointPairs;
pub use pose::{PoseError, RelativePose, larger};
pub(crate) use refine::pose_deviation;
pub use refine::refine_pose;
pub use refine_homography::refine_homography;
pub use triangulation::{ray_depths, triangulate_depths};
