pub mod demo;
pub mod evaluate;
mod first_image;
mod folder;
mod page;
pub mod pose;
mod posed;
pub mod render;
mod surface_output;
pub mod track;
mod track_output;

use std::io::{ErrorKind, Write};

use anyhow::{Context, Result};
use energy_cli::progress::{self, ProgressBar};

/// Prints to standard output. A closed pipe (`| head`) is not an error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("cannot print"),
        _ => Ok(()),
    }
}

/// Creates a progress bar over frames.
fn progress_bar(frames: usize, what: &'static str) -> ProgressBar {
    progress::bar(frames as u64, "{msg} {wide_bar} frame {pos}/{len}, {eta} left").with_message(what)
}
