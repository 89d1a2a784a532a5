//! Steps and frames of a scene.

/// The frame rate of a scene that does not choose one, in 1/s; rounded so that frames are whole steps of `dt`.
const USUAL_RATE: f64 = 25.0;
/// The relative distance from a whole number of steps below which `dt` divides the time between frames.
const SLACK: f64 = 1e-9;

/// The times of steps and frames: equal steps, of which a whole number ends with each frame.
///
/// ```
/// use cloth_scene::TimeGrid;
///
/// // A frame lasts 4.17 steps of 10 ms: five steps of 8.33 ms take their place.
/// let grid = TimeGrid::new(0.01, Some(24.0));
/// assert_eq!((grid.steps_per_frame, grid.frames_per_second, grid.step), (5, 24.0, 1.0 / 120.0));
/// // Four steps of 10 ms are a frame: nothing changes.
/// assert_eq!(TimeGrid::new(0.01, Some(25.0)).step, 0.01);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeGrid {
    /// The step size, in s; at most the `dt` of the scene.
    pub step: f64,
    /// Number of steps per frame, at least 1.
    pub steps_per_frame: u64,
    /// Frames per simulated second.
    pub frames_per_second: f64,
}

impl TimeGrid {
    /// Returns the grid for steps of at most `dt` seconds. Without a frame rate, steps take `dt`, and frames come close
    /// to 25 per second.
    #[must_use]
    pub fn new(dt: f64, frames_per_second: Option<f64>) -> Self {
        let rate = frames_per_second.unwrap_or(USUAL_RATE);
        let ratio = 1.0 / (rate * dt);
        let whole = ratio.round().max(1.0);
        match frames_per_second {
            None => Self { step: dt, steps_per_frame: whole as u64, frames_per_second: 1.0 / (whole * dt) },
            Some(rate) if (ratio - whole).abs() <= SLACK * whole => {
                Self { step: dt, steps_per_frame: whole as u64, frames_per_second: rate }
            }
            Some(rate) => {
                let steps = ratio.ceil().max(1.0);
                Self { step: 1.0 / (steps * rate), steps_per_frame: steps as u64, frames_per_second: rate }
            }
        }
    }

    /// Returns the time of a frame, in s.
    #[must_use]
    pub fn frame_time(&self, frame: usize) -> f64 {
        frame as f64 / self.frames_per_second
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_end_with_a_step_at_every_rate() {
        for rate in [1.0, 12.0, 23.976, 24.0, 29.97, 30.0, 48.0, 60.0, 90.0, 120.0, 144.0, 1000.0] {
            for dt in [1e-4, 1.0 / 240.0, 1.0 / 150.0, 0.01, 1.0 / 60.0, 0.04, 0.5] {
                let grid = TimeGrid::new(dt, Some(rate));
                assert_eq!(grid.frames_per_second, rate);
                assert!(grid.step <= dt * (1.0 + SLACK), "{rate} {dt}: {grid:?}");
                let frame = grid.steps_per_frame as f64 * grid.step;
                assert!((frame * rate - 1.0).abs() < 1e-12 + SLACK, "{rate} {dt}: {grid:?}");
            }
        }
        assert_eq!(
            TimeGrid::new(0.003, None),
            TimeGrid { step: 0.003, steps_per_frame: 13, frames_per_second: 1.0 / 0.039 }
        );
    }
}
