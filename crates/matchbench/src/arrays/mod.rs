//! Arrays of numbers from numpy and HDF5 files. Nothing that such a file claims is trusted.
//!
//! Datasets, matches and features come in these files, from people and from programs. What a file claims is
//! compared with the bytes that it has, before memory is allocated. What no file of this field needs is
//! refused: objects (which are pickles), links to other files, arrays above [`MAX_BYTES`].

mod array;
mod error;
mod hdf5;
mod metered;
mod npy;
mod npz;
#[cfg(test)]
pub(crate) mod testing;

pub(crate) use array::{Array, Element, Kind, MAX_BYTES};
pub(crate) use error::ArrayError;
pub(crate) use hdf5::{Hdf5, Hdf5Out};
pub(crate) use npy::MAX_SIDES;
pub(crate) use npz::{Npz, npz};
