//! From two images to correspondences.
//!
//! A [`Search`] finds putative matches between two sets of features: exactly ([`NearestNeighbours`],
//! [`PlacewiseNeighbours`]) or approximately ([`KdForest`]). A [`Selector`] decides which of them to keep: by
//! descriptors ([`RatioTest`], [`MutualCheck`], [`Fginn`]) or by how matches move together ([`Gms`],
//! [`Kvld`], [`Code`], [`RepMatch`], [`Adalam`]). A [`Matcher`] is an extractor, a search and selectors
//! together ([`Pipeline`]); [`Gaim`] chooses among candidates of all features at once.

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
mod refined;
mod repmatch;
mod resized;
mod stages;
mod symmetric_ratio;
mod views_on_demand;

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
pub use nearest::{NearestNeighbours, two_nearest, two_nearest_below};
pub use pipeline::Pipeline;
pub use placewise::PlacewiseNeighbours;
pub use ratio::RatioTest;
pub use refined::Refined;
pub use repmatch::{RepMatch, RepMatchParams};
pub use resized::{ImageSize, Resized};
pub use stages::{Matcher, Search, Selector, View};
pub use symmetric_ratio::SymmetricRatioTest;
pub use views_on_demand::ViewsOnDemand;
