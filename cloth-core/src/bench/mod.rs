//! The benchmark: a square metre of cloth hung by two corners, on meshes of increasing resolution.

pub mod sleep;
pub mod trajectory_error;

use std::time::{Duration, Instant};

use comfy_table::{CellAlignment, Table, presets};
use energy_elements::ZeroLengthSpring;
use energy_solve::{ElementList, ListError, PotentialTerm, System, SystemError};
use serde::{Deserialize, Serialize};

use crate::body::Body;
use crate::fabric::{self, Bending, Fabric, FabricError, Material, Membrane, Surroundings};
use crate::integrator::{Integrator, LinearSolverChoice, Newton, NewtonOptions, Phases, StepError, StepReport};
use crate::mesh::{Diagonals, MeshError, Plane, Sheet, SpringNetwork};

/// A fabric of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cloth {
    /// Fifty times softer than cotton: σ = 0.2 kg/m², E h = 5 N/m, ν = 0.3, k = 10⁻⁶ N m.
    Soft,
    /// Cotton: σ = 0.1503 kg/m², E h = 261 N/m, ν = 0.243, k = 1.56·10⁻⁶ N m.
    Cotton,
}

impl Cloth {
    /// Both fabrics.
    pub const ALL: [Self; 2] = [Self::Soft, Self::Cotton];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Soft => "soft",
            Self::Cotton => "cotton",
        }
    }

    fn fabric(self) -> Fabric {
        let (density, stretch_stiffness, poisson_ratio, stiffness) = match self {
            Self::Soft => (0.2, 5.0, 0.3, 1e-6),
            Self::Cotton => (0.1503, 261.0, 0.243, 1.56e-6),
        };
        let bending = Bending::Flat { stiffness };
        Fabric::new(density, Material::NeoHookean(Membrane { stretch_stiffness, poisson_ratio, bending }))
    }
}

/// A scene of the benchmark that cannot be set up or run.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum BenchError {
    /// The mesh is invalid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The fabric does not fit the mesh.
    #[error(transparent)]
    Fabric(#[from] FabricError),
    /// The springs at the corners are invalid.
    #[error(transparent)]
    List(#[from] ListError),
    /// The terms cannot be assembled into a system.
    #[error(transparent)]
    System(#[from] SystemError),
    /// A step failed.
    #[error("{cloth}, {vertices} vertices, step {step}: {source}")]
    Step {
        /// Name of the fabric.
        cloth: &'static str,
        vertices: usize,
        /// The step that failed, from 1.
        step: u64,
        /// Why it failed.
        source: StepError,
    },
}

/// Time step, in s.
const DT: f64 = 0.01;
/// Stiffness of the springs that hold the corners, in N/m.
const CORNER_STIFFNESS: f64 = 1e6;

/// Creates a square metre of cloth at rest in z = 0, with `cells` cells along each side and all diagonals along (+, +).
/// Gravity acts along −z, with a drag of 0.1 m v; stiff springs hold the two corners of the edge y = ½.
///
/// # Errors
/// Returns an error if `cells` is 0.
pub fn hang(cloth: Cloth, cells: usize) -> Result<Body, BenchError> {
    let sheet = Sheet {
        cells: [cells, cells],
        size: [1.0, 1.0],
        diagonals: Diagonals::Regular,
        plane: Plane::Horizontal,
        pleats: None,
    };
    let mesh = sheet.mesh()?;
    let surroundings = Surroundings { gravity: [0.0, 0.0, -9.81], drag: 0.1 };
    let mut garment = fabric::terms(&cloth.fabric(), &mesh, &SpringNetwork::default(), &surroundings)?;
    let mut x = mesh.vertices().to_vec();
    let mut pinned = vec![false; x.len()];
    let corners = [sheet.vertex(0, cells), sheet.vertex(cells, cells)];
    garment.masses.reserve_exact(corners.len());
    let mut held = Vec::new();
    for corner in corners {
        held.push([corner, x.len()]);
        x.push(x[corner]);
        garment.masses.push(0.0);
        pinned.push(true);
    }
    let springs = vec![ZeroLengthSpring::new(CORNER_STIFFNESS, 0.0); held.len()];
    garment.terms.push(Box::new(PotentialTerm::new(ElementList::new("corners", springs, &held)?)));
    let system = System::new(garment.terms, &pinned)?;
    Ok(Body { v: vec![[0.0; 3]; x.len()], x, masses: garment.masses, system })
}

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
    fn kind(&self) -> (Cloth, usize, LinearSolverChoice) {
        (self.cloth, self.threads, self.linear_solver)
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

/// Simulates a cloth for `seconds` of simulated time, at least one step. Calls `progress` after every step.
///
/// # Errors
/// Returns an error if a step fails.
pub fn measure(
    cloth: Cloth,
    cells: usize,
    threads: usize,
    linear_solver: LinearSolverChoice,
    seconds: f64,
    mut progress: impl FnMut(),
) -> Result<Measured, BenchError> {
    let started = Instant::now();
    let mut body = hang(cloth, cells)?;
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

/// Formats the runs as a table, with the growth of the step time from mesh to mesh.
#[must_use]
pub fn table(runs: &[Measured]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header([
        "cloth",
        "vertices",
        "threads",
        "solver",
        "ms/step",
        "Newton/step",
        "CG/Newton",
        "assembly",
        "factor",
        "solve",
        "line search",
        "set-up ms",
        "peak MB",
        "lowest m",
        "growth",
        "of one thread",
        "solved by",
    ]);
    for run in runs {
        let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
        let step_time = |run: &Measured| 1e3 * run.step_time();
        let share = |time: Duration| format!("{:.0} %", 100.0 * time.as_secs_f64() / run.time.as_secs_f64());
        let Phases { assembly, factorisation, solve, line_search } = run.report.phases;
        let comparable = runs.iter().filter(|other| other.kind() == run.kind());
        let smaller = comparable.filter(|other| other.vertices < run.vertices);
        let before = smaller.max_by_key(|other| other.vertices);
        let growth =
            before.map_or("–".to_owned(), |before| format!("{:.2}", exponent(&[before.point(), run.point()])));
        let same = |other: &&Measured| {
            other.cloth == run.cloth && other.vertices == run.vertices && other.linear_solver == run.linear_solver
        };
        let alone = runs.iter().filter(same).find(|other| other.threads == 1 && run.threads > 1);
        table.add_row([
            run.cloth.name().to_owned(),
            run.vertices.to_string(),
            run.threads.to_string(),
            run.linear_solver.name().to_owned(),
            format!("{:.2}", step_time(run)),
            format!("{:.1}", run.report.solves as f64 / run.steps as f64),
            format!("{:.1}", run.report.iterations as f64 / run.report.solves as f64),
            share(assembly),
            share(factorisation),
            share(solve),
            share(line_search),
            format!("{:.0}", milliseconds(run.set_up)),
            run.peak_memory.map_or("–".to_owned(), |bytes| format!("{:.0}", bytes as f64 / 1e6)),
            format!("{:.4}", run.lowest),
            growth,
            alone.map_or("–".to_owned(), |alone| format!("× {:.2}", step_time(run) / step_time(alone))),
            run.report.solved_by.to_string(),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Returns the exponent p of t ~ nᵖ, where t is the step time and n the number of vertices, by least squares of ln t.
/// One line per fabric, number of threads and solver with at least three sizes.
#[must_use]
pub fn growth(runs: &[Measured]) -> String {
    let mut lines = String::new();
    for (number, run) in runs.iter().enumerate() {
        if runs[..number].iter().any(|earlier| earlier.kind() == run.kind()) {
            continue;
        }
        let comparable = runs.iter().filter(|other| other.kind() == run.kind());
        let points: Vec<[f64; 2]> = comparable.map(Measured::point).collect();
        if points.len() >= 3 {
            let threads = if run.threads == 1 { "thread" } else { "threads" };
            let of = format!("{}, {} {threads}", run.cloth.name(), run.threads);
            lines += &format!("{of}: a step's time grows as vertices ^ {:.2}\n", exponent(&points));
        }
    }
    lines
}

/// Fits p of t = c nᵖ to points (n, t), by least squares of the logarithms.
fn exponent(points: &[[f64; 2]]) -> f64 {
    let count = points.len() as f64;
    let logarithms = points.iter().map(|point| point.map(f64::ln));
    let mean = |axis: usize| logarithms.clone().map(|point| point[axis]).sum::<f64>() / count;
    let [n, t] = [mean(0), mean(1)];
    let (mut across, mut along) = (0.0, 0.0);
    for [x, y] in logarithms.clone() {
        across += (x - n) * (y - t);
        along += (x - n) * (x - n);
    }
    across / along
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_fitted() {
        let points = |p: f64| [10.0_f64, 20.0, 70.0].map(|n| [n, 3.0 * n.powf(p)]);
        assert!((exponent(&points(1.2)) - 1.2).abs() < 1e-12);
        // The same factor off at both ends: the slope is unchanged.
        let off = [[1.0, 2.0], [4.0, 4.0], [16.0, 32.0]];
        assert!((exponent(&off) - 1.0).abs() < 1e-12);
    }
}
