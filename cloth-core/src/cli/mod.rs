//! The subcommands of `cloth`, one per file.

pub mod bench;
pub mod completions;
pub mod demo;
pub mod fabrics;
pub mod interrupts;
pub mod manual;
pub mod materials;
pub mod report;
pub mod resume;
pub mod run;
pub mod schema;
pub mod sweep;
pub mod validate;
pub mod view;

use std::io::{ErrorKind, Write};

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};

/// Prints to standard output. A closed pipe (`| head`) is not an error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("cannot print"),
        _ => Ok(()),
    }
}

/// Creates a progress bar on standard error, hidden unless that is a terminal.
fn progress_bar(steps: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{wide_bar} step {pos}/{len}, {eta} left").expect("the template is valid");
    ProgressBar::new(steps).with_style(style)
}

/// Parses a finite number greater than 0.
fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.is_finite() && *x > 0.0)
        .ok_or_else(|| "expected a number greater than 0".to_owned())
}
