//! Images with known cameras and the pairs to be matched.

pub mod rendered;
mod sequence;

pub use sequence::{Frame, Pair, Sequence};
