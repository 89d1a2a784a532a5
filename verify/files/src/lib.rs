//! Files that may come from strangers.
//!
//! * [`read`] and [`read_text`] read regular files of limited size; [`read_state`] also follows no symbolic link.
//! * [`write_whole`] and [`PartFile`] write a file completely or not at all, under a random name until it is complete.
//! * [`FolderLock`] keeps two programs from writing to one folder.
//! * [`sealed`] stores a state with its version and checksum, in two generations.
//! * [`AppendFile`] grows next to such a state, and [`InputFile`] tells whether an input was edited.
//! * [`printable`] shows a name without control characters, [`excerpt`] its start.
//! * `drill`, with the feature of this name, fails and kills programs at each of these operations, for tests.
//!
//! A folder of results may come from a stranger as well, who may have put symbolic links, pipes or devices into it.
//! Nothing here writes, locks or reads a state through a link in the folder.
#![forbid(unsafe_code)]

mod append;
#[cfg(feature = "drill")]
pub mod drill;
mod fault;
mod folder;
mod input_file;
mod lock;
mod print;
mod read;
pub mod sealed;
mod write;

pub use append::AppendFile;
pub use folder::{create_folder, remove_file, subfolder};
pub use input_file::InputFile;
pub use lock::{FolderLock, LockError};
pub use print::{excerpt, printable};
pub use read::{open, open_state, read, read_state, read_text, utf8};
pub use write::{PartFile, remove_parts, write_whole};
