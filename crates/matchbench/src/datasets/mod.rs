//! Images with known cameras and the pairs to be matched.

mod sequence;

pub use sequence::{Frame, Pair, Sequence};
