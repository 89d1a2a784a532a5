//! Wall time against trajectory error of each integrator.

use std::fmt::Write as _;
use std::time::Instant;

use energy_cli::plot::{Curve, logarithmic};
use energy_solve::EvaluationError;

use super::{BenchError, Cloth, hang};
use crate::geometry::{norm, subtract};
use crate::integrator::{Scheme, StepError};
use crate::validate::{ValidateError, runge_kutta};

/// A run of an integrator.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The integrator's name.
    pub integrator: &'static str,
    /// Time step, in s.
    pub dt: f64,
    /// Wall time, in s.
    pub wall_time: f64,
    /// The largest distance of a vertex from its reference position at the end, in m; or why the run failed.
    pub error: Result<f64, StepError>,
    /// Observed order: log₂ of the reduction of the error since the last run, which had twice the step. `None` for the
    /// first run.
    pub order: Option<f64>,
}

/// A comparison that could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ComparisonError {
    /// The scene cannot be set up.
    #[error(transparent)]
    Scene(#[from] BenchError),
    /// The reference solution failed.
    #[error("the reference: {0}")]
    Reference(#[from] ValidateError),
    /// The stability limit cannot be evaluated.
    #[error(transparent)]
    Limit(#[from] EvaluationError),
}

/// Cells along each side of the sheet.
const CELLS: usize = 16;
/// Simulated time, in s.
const TIME: f64 = 0.32;
/// Steps of the reference, a Runge–Kutta method of fourth order.
const REFERENCE_STEPS: usize = 12_800;
/// Number of steps of the longest step size, 16 ms.
const FEWEST_STEPS: usize = 20;
/// Number of times the step is halved.
const HALVINGS: u32 = 5;
/// The same for methods with a stability limit.
const HALVINGS_OF_SHORT: u32 = 2;
/// The last halving to start from: explicit Euler is stable for no practical step.
const LAST_START: u32 = 10;
/// Error above which a run counts as unstable, in m.
const LOST: f64 = 1.0;

/// Simulates the hanging sheet of the benchmark, 17 × 17 vertices, with every integrator. Steps start at 16 ms and are
/// halved down to 0.5 ms. Methods with a stability limit start at the largest such step below it and are halved twice.
///
/// Calls `progress` with the number of completed runs and their total.
///
/// # Errors
/// Returns an error if the scene or the reference fails. A failed run is a result.
pub fn compare(cloth: Cloth, mut progress: impl FnMut(usize, usize)) -> Result<Vec<Run>, ComparisonError> {
    let plan: Vec<(Scheme, Vec<usize>)> = Scheme::ALL
        .into_iter()
        .map(|scheme| Ok((scheme, numbers_of_steps(scheme, cloth)?)))
        .collect::<Result<_, ComparisonError>>()?;
    let total = plan.iter().map(|(_, numbers)| numbers.len()).sum();
    progress(0, total);
    let mut truth = hang(cloth, CELLS)?;
    runge_kutta(&mut truth, TIME, REFERENCE_STEPS)?;
    let mut runs: Vec<Run> = Vec::new();
    for (scheme, numbers) in plan {
        let mut before: Option<f64> = None;
        for steps in numbers {
            let (mut body, mut scheme) = (hang(cloth, CELLS)?, scheme.integrator());
            let dt = TIME / steps as f64;
            let started = Instant::now();
            let stepped = (0..steps).try_for_each(|_| scheme.step(&mut body, dt).map(|_| ()));
            let wall_time = started.elapsed().as_secs_f64();
            let off = || body.x.iter().zip(&truth.x).map(|(x, y)| norm(subtract(*x, *y))).fold(0.0, f64::max);
            let error = stepped.map(|()| off());
            let order = before.zip(error.as_ref().ok()).map(|(before, after)| (before / after).log2());
            before = error.as_ref().ok().copied();
            runs.push(Run { integrator: scheme.name(), dt, wall_time, error, order });
            progress(runs.len(), total);
        }
    }
    Ok(runs)
}

/// Returns the numbers of steps to run a method with.
fn numbers_of_steps(scheme: Scheme, cloth: Cloth) -> Result<Vec<usize>, ComparisonError> {
    let limit = scheme.integrator().stable_step(&mut hang(cloth, CELLS)?)?;
    let halved = |number: u32| FEWEST_STEPS << number;
    let Some(limit) = limit else { return Ok((0..=HALVINGS).map(halved).collect()) };
    let first = (0..LAST_START).find(|&number| TIME / halved(number) as f64 <= limit).unwrap_or(LAST_START);
    Ok((first..=first + HALVINGS_OF_SHORT).map(halved).collect())
}

/// Formats the runs as CSV.
#[must_use]
pub fn csv(runs: &[Run]) -> String {
    let mut text = "integrator,dt_s,wall_s,error_m,order,failure\n".to_owned();
    for run in runs {
        let error = run.error.as_ref().map_or(String::new(), |error| format!("{error:.6e}"));
        let failure =
            run.error.as_ref().err().map_or(String::new(), |error| error.to_string().replace(['"', '\n'], " "));
        let order = run.order.map_or(String::new(), |order| format!("{order:.3}"));
        writeln!(text, "{},{},{:.6},{error},{order},\"{failure}\"", run.integrator, run.dt, run.wall_time)
            .expect("writing to a string succeeds");
    }
    text
}

/// Formats the runs as a Markdown table.
#[must_use]
pub fn markdown(runs: &[Run]) -> String {
    let mut text = "| integrator | dt, ms | time, ms | error, mm | order |\n|---|---:|---:|---:|---:|\n".to_owned();
    for run in runs {
        let error = match run.error {
            Ok(error) if error < 1e-6 => format!("{:.1e}", 1e3 * error),
            Ok(error) if error < LOST => format!("{:.4}", 1e3 * error),
            Ok(_) => "unstable".to_owned(),
            Err(_) => "failed".to_owned(),
        };
        let order = run.order.map_or("–".to_owned(), |order| format!("{order:.2}"));
        writeln!(text, "| {} | {} | {:.1} | {error} | {order} |", run.integrator, 1e3 * run.dt, 1e3 * run.wall_time)
            .expect("writing to a string succeeds");
    }
    text
}

/// Plots wall time against error as SVG, with logarithmic axes, without unstable runs.
///
/// # Errors
/// Returns an error if there is nothing to plot.
pub fn svg(runs: &[Run]) -> Result<String, String> {
    let mut curves: Vec<Curve> = Vec::new();
    for run in runs {
        let Some(&error) = run.error.as_ref().ok().filter(|error| **error < LOST) else { continue };
        let point = (run.wall_time, error);
        match curves.iter_mut().find(|curve| curve.name == run.integrator) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve { name: run.integrator.to_owned(), points: vec![point], joined: true }),
        }
    }
    let axes = ("time, s", "error, m");
    logarithmic("time against error of the trajectory", axes, &curves, (800, 500))
        .ok_or("no run came near the reference".into())
}
