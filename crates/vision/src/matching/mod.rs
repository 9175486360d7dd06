//! From two images to correspondences.
//!
//! A [`Search`] finds putative matches between two sets of features: exactly ([`NearestNeighbours`],
//! [`PlacewiseNeighbours`]) or approximately ([`KdForest`]). A [`Selector`] decides which of them to keep: by
//! descriptors ([`RatioTest`], [`SymmetricRatioTest`], [`MutualCheck`], [`Fginn`]) or by how matches move together
//! ([`Gms`], [`Kvld`], [`Code`], [`RepMatch`], [`Adalam`]). [`Gaim`] chooses among the candidates of all features at
//! once, which [`CandidateLabels`] finds. [`ViewsOnDemand`] searches and selects: it compares simulated views only
//! where the images as they are do not match well.
//!
//! A [`Matcher`] is an extractor, a search and selectors together ([`Pipeline`]). Two change another matcher:
//! [`Refined`] moves its matches to where the pixels about them agree best, and [`Resized`] gives it images of another
//! size.
//!
//! The module of each says how it works, after which paper, and where its values come from.

pub mod adalam;
pub mod code;
mod correspondence;
mod error;
pub mod fginn;
pub mod gaim;
pub mod gms;
pub mod kdforest;
pub mod kvld;
pub mod mutual;
pub mod nearest;
mod pipeline;
pub mod placewise;
pub mod ratio;
pub mod refined;
pub mod repmatch;
pub mod resized;
mod stages;
pub mod symmetric_ratio;
pub mod views_on_demand;

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
