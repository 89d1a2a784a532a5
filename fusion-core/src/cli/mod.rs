pub mod demo;
pub mod evaluate;
mod first_image;
mod folder;
mod frame;
mod journal;
mod page;
pub mod pose;
mod posed;
pub mod render;
pub mod resume;
pub mod session;
mod surface_output;
pub mod track;
mod track_output;

use energy_cli::print;
use energy_cli::progress::{self, ProgressBar};

/// Creates a progress bar over frames.
fn progress_bar(frames: usize, what: &'static str) -> ProgressBar {
    progress::bar(frames as u64, "{msg} {wide_bar} frame {pos}/{len}, {eta} left").with_message(what)
}
