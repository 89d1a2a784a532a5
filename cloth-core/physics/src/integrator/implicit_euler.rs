use energy_dsl::Vector3;
use energy_solve::{
    BlockMatrix, CrossBlocks, Curvature, EvaluationError, LinearisationOptions, SolveOptions, SolveReport, State,
    StopReason, Weights, bicgstab,
};

use super::linear_solver::{LinearSolver, LinearSolverChoice, SolvedBy};
use super::trial::Trials;
use super::{Integrator, IntegratorMemory, StepError, StepReport, advance};
use crate::body::Body;

/// Linearised implicit Euler (Baraff & Witkin 1998), one linear solve per step:
///
/// (M − h ∂f/∂v − h² ∂f/∂x) Δv = h (f + h (∂f/∂x) v),  v' = v + Δv,  x' = x + h v',
///
/// with the complete ∂f/∂x and ∂f/∂v. First order and dissipative. Solved by conjugate gradients if the Jacobians of
/// all terms are symmetric, otherwise by BiCGSTAB.
///
/// Compressed elements can make the matrix indefinite, and the solution may then point uphill. If conjugate gradients
/// detect this, the step is solved again with each element's Hessian projected to positive semi-definite on both sides
/// of the equation, and [`StepReport::projected`] is set. One linear solve may overshoot when a single step undoes a
/// strong compression: energy is not guaranteed to fall.
#[derive(Clone, Debug, Default)]
pub struct ImplicitEuler {
    options: Options,
    linear_solver: LinearSolverChoice,
    trials: Trials,
    memory: Option<Memory>,
}

/// Allocations kept from one step to the next.
#[derive(Clone, Debug)]
struct Memory {
    matrix: BlockMatrix,
    /// The solver, if the matrix is symmetric; otherwise `None`, for BiCGSTAB.
    solver: Option<LinearSolver<f64>>,
}

/// Accuracy of the linear systems.
#[derive(Clone, Copy, Debug)]
struct Options(SolveOptions);

impl Default for Options {
    /// A relative residual of 10⁻⁵ is far below the scheme's own error at any useful step.
    fn default() -> Self {
        Self(SolveOptions::new(1e-5).with_iteration_limit(5_000))
    }
}

impl ImplicitEuler {
    /// Creates an integrator with these tolerances for the linear systems.
    #[must_use]
    pub fn with_options(options: SolveOptions) -> Self {
        Self { options: Options(options), ..Self::default() }
    }

    /// Creates an integrator with this solver for symmetric linear systems.
    #[must_use]
    pub fn solved_by(linear_solver: LinearSolverChoice) -> Self {
        Self { linear_solver, ..Self::default() }
    }

    fn solve(
        &mut self,
        body: &mut Body,
        dt: f64,
        curvature: Curvature,
        Memory { matrix, solver }: &mut Memory,
    ) -> Result<Solution, StepError> {
        let state = State { x: &body.x, v: &body.v };
        let weights = Weights { position: -dt * dt, velocity: -dt };
        let options = LinearisationOptions::new(weights, curvature).with_stiffness_times_velocity(true);
        let linear = body.system.linearise_with_masses(state, options, &body.masses, matrix)?;
        let rhs = |&vertex: &usize| -> Vector3<f64> {
            let (force, change) = (linear.force[vertex], linear.stiffness_times_velocity[vertex]);
            std::array::from_fn(|axis| dt * (force[axis] + dt * change[axis]))
        };
        let rhs: Vec<_> = body.system.dofs().free().iter().map(rhs).collect();
        let mut delta = vec![[0.0; 3]; rhs.len()];
        let options = &self.options.0;
        let unsymmetric = |report| (report, SolvedBy::default());
        let (report, solved_by) = match solver {
            None => unsymmetric(bicgstab(matrix, &rhs, &mut delta, options)?),
            Some(solver) => match solver.prepare(matrix, &CrossBlocks::default(), &mut self.trials) {
                Ok(()) => solver.solve(&rhs, &mut delta, options, &mut self.trials),
                // A diagonal block with negative curvature proves that the matrix is indefinite.
                Err(_) if curvature == Curvature::Exact => unsymmetric(SolveReport::indefinite()),
                Err(error) => return Err(error),
            },
        };
        Ok(Solution { delta, rhs, report, solved_by })
    }

    fn failure(&self, solution: &Solution, matrix: &BlockMatrix, free: &[usize]) -> StepError {
        let mut residual = vec![[0.0; 3]; free.len()];
        matrix.multiply(&solution.delta, &mut residual);
        let size = |row: usize| {
            let error: Vector3<f64> = std::array::from_fn(|axis| solution.rhs[row][axis] - residual[row][axis]);
            // Rank NaN as the largest.
            let size = crate::geometry::norm(error);
            if size.is_nan() { f64::INFINITY } else { size }
        };
        let worst = (0..free.len()).max_by(|&a, &b| size(a).total_cmp(&size(b))).map_or(0, |row| free[row]);
        let report = &solution.report;
        StepError::NotSolved {
            iterations: report.iterations,
            stopped: report.stopped,
            residual: report.final_residual,
            target: self.options.0.relative_tolerance * report.initial_residual,
            vertex: worst,
        }
    }
}

struct Solution {
    delta: Vec<Vector3<f64>>,
    rhs: Vec<Vector3<f64>>,
    report: SolveReport,
    solved_by: SolvedBy,
}

impl Integrator for ImplicitEuler {
    fn name(&self) -> &'static str {
        "implicit-euler"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let mut memory = match self.memory.take() {
            Some(memory) if body.system.owns(&memory.matrix) => memory,
            _ => {
                let matrix = body.system.matrix();
                let symmetric = body.system.character().symmetric;
                let solver = symmetric.then(|| LinearSolver::new(self.linear_solver, &matrix, body.system.threads()));
                Memory { matrix, solver }
            }
        };
        let mut solution = self.solve(body, dt, Curvature::Exact, &mut memory)?;
        let (iterations, solved_by) = (solution.report.iterations as u64, solution.solved_by);
        let mut step = StepReport { solves: 1, iterations, solved_by, ..StepReport::default() };
        if solution.report.stopped == StopReason::IndefiniteCurvature {
            solution = self.solve(body, dt, Curvature::Clamped, &mut memory)?;
            step.solves += 1;
            step.iterations += solution.report.iterations as u64;
            step.solved_by += solution.solved_by;
            step.projected = true;
        }
        let free = body.system.dofs().free();
        if !solution.report.converged() {
            return Err(self.failure(&solution, &memory.matrix, free));
        }
        let changed = |(&vertex, delta): (&usize, &Vector3<f64>)| -> Vector3<f64> {
            std::array::from_fn(|axis| body.v[vertex][axis] + delta[axis])
        };
        let velocities: Vec<Vector3<f64>> = free.iter().zip(&solution.delta).map(changed).collect();
        self.memory = Some(memory);
        advance(body, &velocities, dt)?;
        Ok(step)
    }

    fn memory(&self) -> IntegratorMemory {
        IntegratorMemory { trials: self.trials, ..IntegratorMemory::default() }
    }

    fn restore(&mut self, memory: IntegratorMemory) {
        self.trials = memory.trials;
    }

    fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(None)
    }
}
