//! Progress on standard error, hidden if that is not a terminal.

use std::time::Duration;

pub use indicatif::ProgressBar;
use indicatif::ProgressStyle;

/// Creates a progress bar of `length` steps.
///
/// # Panics
/// If the template is invalid.
#[must_use]
pub fn bar(length: u64, template: &str) -> ProgressBar {
    ProgressBar::new(length).with_style(ProgressStyle::with_template(template).expect("the template is valid"))
}

/// Creates a spinner for work of unknown length.
#[must_use]
pub fn spinner(message: &'static str) -> ProgressBar {
    let spinner = ProgressBar::new_spinner().with_message(message);
    spinner.enable_steady_tick(Duration::from_millis(100));
    spinner
}
