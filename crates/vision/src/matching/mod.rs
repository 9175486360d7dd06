//! From two sets of features to correspondences: search, selection, and the two together.

mod adalam;
pub mod code;
mod correspondence;
mod error;
mod fginn;
pub mod gaim;
mod gms;
mod kdforest;
mod kvld;
mod mutual;
mod nearest;
mod pipeline;
mod placewise;
mod ratio;
mod repmatch;
mod resized;
mod stages;
mod symmetric_ratio;

pub use adalam::{Adalam, AdalamParams};
pub use code::{Code, CodeParams};
pub use correspondence::{Correspondence, Correspondences};
pub use error::MatcherError;
pub use fginn::Fginn;
pub use gaim::{CandidateLabels, Gaim, GaimParams};
pub use gms::{Gms, GmsParams};
pub use kdforest::{KdForest, KdForestParams};
pub use kvld::{Kvld, KvldParams};
pub use mutual::MutualCheck;
pub use nearest::{NearestNeighbours, two_nearest};
pub use pipeline::Pipeline;
pub use placewise::PlacewiseNeighbours;
pub use ratio::RatioTest;
pub use repmatch::{RepMatch, RepMatchParams};
pub use resized::{ImageSize, Resized};
pub use stages::{Matcher, Search, Selector, View};
pub use symmetric_ratio::SymmetricRatioTest;
