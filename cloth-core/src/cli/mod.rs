//! The subcommands of `cloth`, one per file.

pub mod allowed_folders;
pub mod bench;
pub mod completions;
pub mod demo;
pub mod fabrics;
pub mod manual;
pub mod materials;
pub mod measure;
pub mod report;
pub mod resume;
pub mod run;
pub mod schema;
pub mod sweep;
pub mod test;
pub mod validate;
pub mod view;

use energy_cli::print;
use indicatif::{ProgressBar, ProgressStyle};

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
