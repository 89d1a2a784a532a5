//! The benchmark: a square metre of cloth hung by two corners, on meshes of increasing resolution.

mod hang;
pub mod local_error;
pub mod sleep;
mod table;
pub mod trajectory_error;

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

pub use hang::{BenchError, Cloth, hang};
pub use table::{growth, table};

use crate::integrator::{Integrator, LinearSolverChoice, Newton, NewtonOptions, StepReport};

/// Time step, in s.
const DT: f64 = 0.01;

/// Measurements of one run.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Measured {
    /// The fabric that hangs.
    pub cloth: Cloth,
    /// Number of vertices.
    pub vertices: usize,
    /// Maximum number of threads.
    pub threads: usize,
    /// The linear solver.
    pub linear_solver: LinearSolverChoice,
    /// Whether the cloth may touch itself.
    pub contact: bool,
    /// Number of steps.
    pub steps: u64,
    /// Totals of the steps.
    pub report: StepReport,
    /// Wall time from the mesh to the first step.
    pub set_up: Duration,
    /// Wall time of all steps.
    pub time: Duration,
    /// The lowest z coordinate at the end, in m.
    pub lowest: f64,
    /// Peak memory of the process, in bytes; `None` if the system does not report it.
    pub peak_memory: Option<u64>,
}

impl Measured {
    /// The key that runs of different sizes share.
    fn kind(&self) -> (Cloth, usize, LinearSolverChoice, bool) {
        (self.cloth, self.threads, self.linear_solver, self.contact)
    }

    /// Mean wall time of a step, in s.
    fn step_time(&self) -> f64 {
        self.time.as_secs_f64() / self.steps as f64
    }

    /// Returns the number of vertices and the mean wall time of a step.
    fn point(&self) -> [f64; 2] {
        [self.vertices as f64, self.step_time()]
    }
}

/// Simulates a cloth for `seconds` of simulated time, at least one step; with `contact`, it may touch itself. Calls
/// `progress` after every step.
///
/// # Errors
/// Returns an error if a step fails.
pub fn measure(
    cloth: Cloth,
    cells: usize,
    threads: usize,
    linear_solver: LinearSolverChoice,
    contact: bool,
    seconds: f64,
    mut progress: impl FnMut(),
) -> Result<Measured, BenchError> {
    let started = Instant::now();
    let mut body = hang(cloth, cells)?;
    if contact {
        hang::add_contact(&mut body, cloth, cells)?;
    }
    body.system.set_threads(threads);
    // The absolute stopping criterion of the published comparison, at the scale of this scene.
    let tolerances = NewtonOptions { velocity_tolerance: 1e-3, impulse_tolerance: 1e-6, ..NewtonOptions::default() };
    let options = NewtonOptions { linear_solver, ..tolerances };
    let mut integrator = Newton::with_options(options);
    let set_up = started.elapsed();
    let vertices = (cells + 1) * (cells + 1);
    let steps = ((seconds / DT).round() as u64).max(1);
    let mut report = StepReport::default();
    let started = Instant::now();
    for step in 1..=steps {
        let done = integrator.step(&mut body, DT);
        report += done.map_err(|source| BenchError::Step { cloth: cloth.name(), vertices, step, source })?;
        progress();
    }
    let time = started.elapsed();
    let lowest = body.x.iter().fold(f64::INFINITY, |lowest, x| lowest.min(x[2]));
    Ok(Measured {
        cloth,
        vertices,
        threads,
        linear_solver,
        contact,
        steps,
        report,
        set_up,
        time,
        lowest,
        peak_memory: peak_memory(),
    })
}

/// The high-water mark of the resident set, as Linux reports it.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kilobytes)
}
