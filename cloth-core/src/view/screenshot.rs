use std::path::Path;

use super::colouring::{Colouring, colour, upper_end};
use super::stage::{Moment, Stage, ViewError};
use crate::output::{Look, Show};

/// A picture of one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Screenshot {
    /// The picture, as PNG.
    pub png: Vec<u8>,
    /// Time of the moment, in s.
    pub time: f64,
    /// Description of the colours.
    pub legend: String,
}

/// Draws a moment of a scene, which is simulated up to there, or of a finished run. Needs no display. Calls `on_step`
/// after each step.
///
/// # Errors
/// Returns an error if the scene or run cannot be opened or simulated, or the run has no such frame.
pub fn screenshot(
    path: &Path,
    moment: Moment,
    colouring: Colouring,
    wireframe: bool,
    on_step: impl FnMut(),
) -> Result<Screenshot, ViewError> {
    let mut stage = Stage::open(path)?;
    stage.go_to(moment, on_step)?;
    let values = stage.values(colouring);
    let most = upper_end(&values);
    let colours: Vec<[f32; 3]> = values.iter().map(|&value| colour(value, most)).collect();
    let look = Look { colours: (colouring != Colouring::Plain).then_some(&colours), wireframe };
    let frames = [stage.positions().to_vec()];
    let show = Show::new(
        stage.simulation(),
        &frames,
        stage.scene().time_grid().frames_per_second,
        stage.scene().output.style(),
    );
    let png = show.picture_with(stage.positions(), stage.time(), &look)?;
    Ok(Screenshot { png, time: stage.time(), legend: colouring.legend(most) })
}
