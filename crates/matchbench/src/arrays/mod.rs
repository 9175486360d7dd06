//! Arrays of numbers in numpy's and HDF5's files, of which nothing is believed.
//!
//! Datasets, matches and features come in them, from people and from programs. What a file claims is
//! compared with the bytes that are there before memory is asked for; what no file of this field needs
//! (objects, which are pickles, links to other files, arrays above [`MOST_BYTES`]) is refused.

mod array;
mod error;
mod hdf5;
mod npy;
mod npz;
#[cfg(test)]
pub(crate) mod testing;

pub(crate) use array::{Array, Element, Kind, MOST_BYTES};
pub(crate) use error::ArrayError;
pub(crate) use hdf5::{Hdf5, Hdf5Out};
pub(crate) use npz::{Npz, npz};
