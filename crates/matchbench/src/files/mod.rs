//! The door to the file system: files are read if they are files, and written whole or not at all.
//!
//! Whoever names a file may name anything: a pipe that nobody writes into, a device without an end, a
//! link to one. Reading refuses all but regular files ([`read_file`]), so that nothing waits for ever
//! or fills the memory; what may be longer than memory is read by `LineBlocks`. Writing ([`write_whole`]) replaces regular files and writes through to
//! whatever else a name leads to; files that grow do so by an `Appender`. What a killed process left half written is found and removed by
//! [`remove_leftovers`].

mod append;
mod calls;
mod leftovers;
mod lines;
mod names;
mod read;
mod write;

pub(crate) use append::Appender;
#[cfg(test)]
pub(crate) use calls::{Fault, break_calls};
pub(crate) use leftovers::{HELD, PREFIX, hold};
pub use leftovers::{remove_leftovers, remove_leftovers_below};
pub(crate) use lines::{LineBlock, LineBlocks, LineError};
pub(crate) use names::check_name;
pub(crate) use read::regular;
pub use read::{open_file, read_file, read_text};
pub(crate) use write::WholeFile;
pub use write::write_whole;
pub(crate) use write::{make_folder, sync_folder_of, write_new, write_unnamed, write_whole_file};
