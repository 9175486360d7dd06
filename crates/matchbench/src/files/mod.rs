//! The door to the file system: files are read if they are files, and written whole or not at all.
//!
//! Whoever names a file may name anything: a pipe that nobody writes into, a device without an end, a
//! link to one. Reading refuses all but regular files ([`read_file`]), so that nothing waits for ever
//! or fills the memory. Writing ([`write_whole`]) replaces regular files and writes through to
//! whatever else a name leads to. What a killed process left half written is found and removed by
//! [`remove_leftovers`].

mod leftovers;
mod read;
mod write;

pub use leftovers::remove_leftovers;
pub(crate) use leftovers::{HELD, PREFIX, hold};
pub use read::{open_file, read_file, read_text};
pub use write::write_whole;
