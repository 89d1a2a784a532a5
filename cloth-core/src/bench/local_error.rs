//! The local error of a scene: how far its steps lead from a reference, over a short time.
//!
//! Folds and impacts are chaotic: after a second, two runs differ however short their steps are. Over a tenth of a
//! second from the same state they do not, so that speeds can be compared at equal error.

use std::time::Duration;

use comfy_table::{CellAlignment, Table, presets};
use energy_dsl::Vector3;
use serde::Serialize;

use crate::geometry::{norm, subtract};
use crate::scene::Scene;
use crate::simulation::{RestoreError, SavedState, Simulation, SimulationError, Totals};

/// Number of states of the reference that windows start from.
const WINDOWS: u64 = 6;
/// Length of a window, in s.
const LENGTH: f64 = 0.1;
/// Steps of the reference in a step of the scene.
const FINER: u64 = 16;
/// The stopping velocity of the reference over that of the scene.
const STRICTER: f64 = 0.01;

/// A scene whose local error cannot be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LocalErrorFailure {
    /// The scene cannot be set up.
    #[error(transparent)]
    Scene(SimulationError),
    /// A step of the reference failed.
    #[error("the reference, whose step is a sixteenth: {0}")]
    Reference(SimulationError),
    /// A step of the scene failed.
    #[error("from the reference at {start:.4} s: {source}")]
    Window {
        /// Start of the window, in s.
        start: f64,
        /// Why the step failed.
        source: Box<SimulationError>,
    },
}

/// The error over a short time, from a state of the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Window {
    /// Start, in s.
    pub start: f64,
    /// Root of the mean square distance of vertices at the end, in m.
    pub rms: f64,
    /// The largest distance of a vertex at the end, in m.
    pub largest: f64,
}

/// Local error of a scene, and its cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LocalError {
    /// Step of the scene, in s.
    pub step: f64,
    /// Step of the reference, in s.
    pub reference_step: f64,
    /// Length of a window, in s.
    pub length: f64,
    /// The windows, in order.
    pub windows: Vec<Window>,
    /// Root of the mean square distance over all windows, in m.
    pub rms: f64,
    /// The largest distance in any window, in m.
    pub largest: f64,
    /// Linear solves of all vertices per simulated second, in the windows.
    pub solves_per_second: f64,
    /// Wall time per simulated second, in s, in the windows.
    pub time_per_second: f64,
}

/// Measures the local error of a scene. A reference runs with a sixteenth of the step and a hundredth of the stopping
/// velocity. From six of its states, evenly spaced from the start to 0.1 s before the end, the scene's own steps go on
/// for 0.1 s; the distances to the reference are the error. A scene that is shorter has windows of its whole duration.
///
/// Calls `on_step` with the number of completed steps and their total; if it returns `false`, the result is `None`.
///
/// ```
/// use cloth_core::bench::local_error;
/// use cloth_core::scene::Scene;
///
/// let text = "dt = 0.01\nduration = 0.1\nintegrator = \"newton\"\nmesh.sheet = { cells = [2, 2], size = [0.1, 0.1] }
///     fabric = \"denim\"\npins = [{ vertex = 0 }]\n";
/// let error = local_error::measure(&Scene::parse(text, "s.toml".as_ref())?, None, |_, _| true)?.unwrap();
/// assert!(error.rms > 0.0 && error.rms < error.largest && error.largest < 0.01, "{error:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Returns an error if the scene is invalid, or a step fails.
pub fn measure(
    scene: &Scene,
    threads: Option<usize>,
    mut on_step: impl FnMut(u64, u64) -> bool,
) -> Result<Option<LocalError>, LocalErrorFailure> {
    let start = |scene: &Scene| -> Result<Simulation, LocalErrorFailure> {
        let mut simulation = Simulation::new(scene).map_err(LocalErrorFailure::Scene)?;
        threads.into_iter().for_each(|threads| simulation.set_threads(threads));
        Ok(simulation)
    };
    let (step, steps) = (scene.time_grid().step, scene.steps());
    let length = ((LENGTH / step).round() as u64).clamp(1, steps.max(1));
    let starts: Vec<u64> = (0..WINDOWS).map(|k| k * steps.saturating_sub(length) / (WINDOWS - 1)).collect();
    let total = FINER * (starts[starts.len() - 1] + length) + WINDOWS * length;
    let mut done = 0;
    let mut proceeds = || {
        done += 1;
        on_step(done, total)
    };
    let Some((states, ends)) = reference(start(&finer(scene))?, &starts, length, &mut proceeds)? else {
        return Ok(None);
    };
    let (mut windows, mut work) = (Vec::new(), Totals::default());
    for ((&at, state), end) in starts.iter().zip(states).zip(ends) {
        let time = at as f64 * step;
        let failed = |source| LocalErrorFailure::Window { start: time, source: Box::new(source) };
        let mut simulation = start(scene)?;
        let restored = simulation.restore(state.after_other_steps(at));
        restored.map_err(|error: RestoreError| failed(error.into()))?;
        for _ in 0..length {
            let report = simulation.step().map_err(failed)?;
            work.solves += report.solves;
            if !proceeds() {
                return Ok(None);
            }
        }
        work.stepping_time += stepping_time(&simulation);
        windows.push(Window::new(time, simulation.positions(), &end));
    }
    let simulated = WINDOWS as f64 * length as f64 * step;
    let mean_square = windows.iter().map(|window| window.rms.powi(2)).sum::<f64>() / WINDOWS as f64;
    Ok(Some(LocalError {
        step,
        reference_step: step / FINER as f64,
        length: length as f64 * step,
        rms: mean_square.sqrt(),
        largest: windows.iter().fold(0.0, |largest, window| window.largest.max(largest)),
        windows,
        solves_per_second: work.solves as f64 / simulated,
        time_per_second: work.stepping_time.as_secs_f64() / simulated,
    }))
}

/// The reference at the starts of windows, and its positions at their ends.
type Reference = (Vec<SavedState>, Vec<Vec<Vector3<f64>>>);

/// Returns the scene of the reference.
fn finer(scene: &Scene) -> Scene {
    let mut fine = scene.clone();
    fine.dt = scene.time_grid().step / FINER as f64;
    fine.tolerances = scene.tolerances.tightened(scene.integrator, STRICTER);
    fine
}

/// Runs the reference, for windows that start after these steps of the scene. `None` if it was stopped.
fn reference(
    mut simulation: Simulation,
    starts: &[u64],
    length: u64,
    proceeds: &mut impl FnMut() -> bool,
) -> Result<Option<Reference>, LocalErrorFailure> {
    let (mut states, mut ends) = (Vec::new(), Vec::new());
    loop {
        let is_at = |other: u64| simulation.steps_done() == FINER * other;
        for &start in starts {
            if is_at(start) {
                states.push(simulation.save());
            }
            if is_at(start + length) {
                ends.push(simulation.positions().to_vec());
            }
        }
        if ends.len() == starts.len() {
            break;
        }
        simulation.step().map_err(LocalErrorFailure::Reference)?;
        if !proceeds() {
            return Ok(None);
        }
    }
    Ok(Some((states, ends)))
}

fn stepping_time(simulation: &Simulation) -> Duration {
    simulation.summary_without_energies().totals.stepping_time
}

impl Window {
    fn new(start: f64, x: &[Vector3<f64>], reference: &[Vector3<f64>]) -> Self {
        let distances: Vec<f64> = x.iter().zip(reference).map(|(x, y)| norm(subtract(*x, *y))).collect();
        let mean_square = distances.iter().map(|distance| distance * distance).sum::<f64>() / x.len().max(1) as f64;
        Self { start, rms: mean_square.sqrt(), largest: distances.into_iter().fold(0.0, f64::max) }
    }
}

/// Formats the error as a table of windows, with their cost per simulated second.
#[must_use]
pub fn table(error: &LocalError) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["from, s", "RMS, mm", "largest, mm"]);
    let millimetres = |length: f64| format!("{:.4}", 1e3 * length);
    for window in &error.windows {
        let start = format!("{:.3}", window.start);
        table.add_row([start, millimetres(window.rms), millimetres(window.largest)]);
    }
    table.add_row(["all".to_owned(), millimetres(error.rms), millimetres(error.largest)]);
    table.column_iter_mut().for_each(|column| column.set_cell_alignment(CellAlignment::Right));
    format!(
        "distance from a reference with a step of {} s after {:.3} s, by steps of {} s\n\n{table}\n\n\
         {:.0} linear solves and {:.0} ms per simulated second\n",
        error.reference_step,
        error.length,
        error.step,
        error.solves_per_second,
        1e3 * error.time_per_second,
    )
}
