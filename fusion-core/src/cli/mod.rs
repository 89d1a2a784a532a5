pub mod demo;
pub mod evaluate;
mod folder;
pub mod render;
pub mod track;

use std::io::{ErrorKind, Write};

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};

/// Prints to standard output. A reader that has seen enough (`| head`) is no error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("cannot print"),
        _ => Ok(()),
    }
}

/// Hidden where standard error is not a terminal.
fn progress_bar(frames: usize, what: &'static str) -> ProgressBar {
    let style =
        ProgressStyle::with_template("{msg} {wide_bar} frame {pos}/{len}, {eta} left").expect("the template is valid");
    ProgressBar::new(frames as u64).with_style(style).with_message(what)
}
