//! From pixels to relative pose: local features, matching, robust two-view geometry.
//!
//! Pure functions only: nothing here reads a file, a clock, an environment variable or a global,
//! and the same input gives the same bits on every machine and for any number of threads.
//!
//! The rooms, bottom to top: [`simd`] (the only unsafe code), [`image`], [`features`],
//! [`matching`] on one side; [`geometry`], [`robust`] on the other. `matching` sees both.
//! `ARCHITECTURE.md` in the repository draws them, `tests/architecture.rs` keeps them apart.

pub mod features;
pub mod geometry;
pub mod image;
pub mod matching;
mod params;
pub mod robust;
pub mod seed;
pub mod simd;
mod tables;

pub use params::ParamError;
