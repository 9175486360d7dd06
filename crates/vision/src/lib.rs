//! From two images to the relative pose of their cameras, in pure Rust.
//!
//! Local features (SIFT, RootSIFT, DSP-SIFT, SURF, FAST, ORB, BRISK, KAZE, AKAZE, FREAK, LATCH, DAISY, DLCO, BinBoost,
//! ASIFT), search for nearest neighbours, selection of matches (ratio test, FGINN, GMS, KVLD, CODE, RepMatch, GAIM,
//! AdaLAM) and robust two-view geometry (RANSAC and its descendants), each after its paper. The same input gives the same
//! bits on every machine and for any number of threads. Nothing here reads a file or a clock.
//!
//! Four things are read that change no result: which instructions the processor has, the size of its second-level cache
//! (how wide the strips of a scale space are), the number of threads (how many views are simulated at once), and once
//! in a process the environment variable `MATCHBENCH_SIMD`, which limits the instructions. With a value that
//! [`InstructionSet::asked_for`] refuses, the first kernel panics; a program reports that error when it starts.
//!
//! ```
//! use matchbench_vision::features::{Sift, SiftParams};
//! use matchbench_vision::geometry::Camera;
//! use matchbench_vision::matching::{Matcher, Pipeline};
//! use matchbench_vision::robust::{PoseEstimator, SampleConsensus, TwoViews, presets};
//! use matchbench_vision::seed::Seed;
//! # use matchbench_vision::image::{GrayImage, Size};
//! # // A wall 10 baselines away and a box before it, seen by a camera that moves one baseline to the right.
//! # let scene = |shift: [usize; 2]| GrayImage::from_fn(Size::new(240, 180), |x, y| {
//! #     let in_front = (60..120).contains(&y);
//! #     let column = x + shift[usize::from(in_front)];
//! #     Seed(u64::from(in_front)).number(column as u64 / 6).number(y as u64 / 6).rng().below(256) as u8
//! # });
//! # let (image_a, image_b) = (scene([0, 0]), scene([20, 40]));
//!
//! let sift = Pipeline::of_features(Sift::new(SiftParams::default())?);
//! let points = sift.match_images(&image_a, &image_b, None, Seed(0))?;
//!
//! let camera = Camera::pinhole(200.0, 200.0, 120.0, 90.0);
//! let views = TwoViews { points: &points, camera_a: &camera, camera_b: &camera };
//! let found = SampleConsensus::new(presets::best())?.estimate(views, Seed(0))?;
//!
//! let t = found.b_from_a.direction;
//! println!("{} inliers, translation along {:.2} {:.2} {:.2}", found.inliers.len(), t.x, t.y, t.z);
//! # assert!(found.inliers.len() > 50 && found.b_from_a.direction.x < -0.99, "{found:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Images are 8-bit grey values ([`image::GrayImage`]) that the caller decodes; `examples/two_view_pose.rs` does
//! it with the `image` crate.
//!
//! The modules, in the order of the data: [`image`], [`features`], [`matching`], [`geometry`], [`robust`]. Random
//! choices come from a [`seed::Seed`] that the caller passes. With the feature `serde`, parameters, cameras
//! and the reasons why there is no model can be read and written.

pub mod features;
pub mod geometry;
pub mod image;
pub mod matching;
mod params;
pub mod robust;
pub mod seed;
mod simd;
mod tables;

/// The linear algebra in which points, rotations and matrices are given and returned.
pub use nalgebra;
pub use params::ParamError;
pub use simd::InstructionSet;

/// The example of the README is tested.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
