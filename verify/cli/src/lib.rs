//! Support for the workspace's command-line programs.
//!
//! * [`write_whole`] and [`write_file`] write a file completely or not at all.
//! * [`message`] formats an error and its causes on one line.
//! * [`plot`] draws curves as SVG.
//! * [`progress`] shows progress on standard error.
#![forbid(unsafe_code)]

mod atomic_file;
mod message;
pub mod plot;
pub mod progress;

pub use atomic_file::write_file;
pub use energy_files::write_whole;
pub use message::message;
