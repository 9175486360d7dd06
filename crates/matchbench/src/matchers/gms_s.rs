//! `gms-s`: see [`gms`](super::gms).

pub(super) use super::gms::GMS_S;
