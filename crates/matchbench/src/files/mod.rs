//! Access to the file system: only regular files are read, and a file is written completely or not at all.
//!
//! A name that a user gives may be anything: a pipe that nobody writes to, a device without an end, or a link
//! to one. So [`read_file`] refuses everything except regular files, and a read never waits for ever or fills
//! the memory. Files that may be larger than memory are read by `LineBlocks`, and texts of others by `read_lines`,
//! which refuses a line without an end. [`write_whole`] replaces regular files; if a name leads to something else,
//! it writes into that. `link_in` finds links where writing must not follow them. An `Appender` appends to files.
//! [`remove_leftovers`] finds and removes incomplete files of processes that were killed. A whole folder is filled as a
//! `HiddenFolder` first. A [`TemporaryFolder`] is for what nobody keeps.

mod append;
mod calls;
mod hidden;
mod leftovers;
mod lines;
mod links;
mod names;
mod read;
mod temporary;
mod write;

pub(crate) use append::Appender;
#[cfg(test)]
pub(crate) use calls::{Call, Fault, break_calls};
pub(crate) use hidden::HiddenFolder;
pub(crate) use leftovers::{PREFIX, hold};
pub use leftovers::{remove_leftovers, remove_leftovers_below};
pub(crate) use lines::{LineBlock, LineBlocks, LineError};
pub(crate) use links::{is_link, link_in, link_on_the_way, place_of, refuse_link, refuse_links};
pub(crate) use names::check_name;
pub(crate) use read::regular;
pub(crate) use read::{LONGEST_LINE, read_file_as_told, read_lines, read_text_lines};
pub use read::{open_file, read_file, read_text};
pub use temporary::{TemporaryFolder, remove_temporary_folders, temporary_files};
pub(crate) use write::WholeFile;
pub use write::write_whole;
pub(crate) use write::{
    make_folder, move_file, sync_folder_of, write_new, write_unnamed, write_whole_file,
};
