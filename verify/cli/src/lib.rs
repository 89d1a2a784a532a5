//! Support for the workspace's command-line programs.
//!
//! * [`write_file`] writes a file completely or not at all.
//! * [`print()`] and [`tell`] print texts without control characters.
//! * [`Interrupts`] ends a program at a signal, after its current step; [`report_file_limits`] makes errors of others.
//! * [`Notice`] says what a program does when that takes longer than a second.
//! * [`message`] formats an error and its causes on one line.
//! * [`plot`] draws curves as SVG.
//! * [`progress`] shows progress on standard error.
#![forbid(unsafe_code)]

mod atomic_file;
mod interrupts;
mod message;
mod notice;
mod output;
pub mod plot;
pub mod progress;

pub use atomic_file::write_file;
pub use energy_files::write_whole;
pub use interrupts::{Interrupts, report_file_limits};
pub use message::message;
pub use notice::Notice;
pub use output::{print, tell};
