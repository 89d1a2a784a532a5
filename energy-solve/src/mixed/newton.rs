//! Newton's method over mixed unknowns.

use super::body::MixedBody;
use super::error::MixedError;
use super::inertia::InertialPotential;
use super::problem::Problem;
use super::system::{MixedEnergy, MixedSystem};
use crate::linear::{BorderedError, BorderedSolver, KindSolver};
use crate::matrix::BorderedMatrix;
use crate::terms::Curvature;

/// Options of [`MixedNewton`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MixedNewtonOptions {
    /// Stop once a Newton step moves no unknown further than this, in m by its scale.
    pub tolerance: f64,
    /// Stop after this many iterations.
    pub iteration_limit: usize,
    /// Shorten steps that move an unknown further than this, in m by its scale. Rotations turn by one radian per step
    /// at most.
    pub stride: f64,
}

impl MixedNewtonOptions {
    /// Creates options with this tolerance, at most 100 iterations, and no limit of moves.
    #[must_use]
    pub const fn new(tolerance: f64) -> Self {
        Self { tolerance, iteration_limit: 100, stride: f64::INFINITY }
    }

    /// Sets the largest number of iterations.
    #[must_use]
    pub const fn with_iteration_limit(self, iteration_limit: usize) -> Self {
        Self { iteration_limit, ..self }
    }

    /// Sets the largest move per iteration, in m.
    #[must_use]
    pub const fn with_stride(self, stride: f64) -> Self {
        Self { stride, ..self }
    }
}

/// The reason why Newton's method stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MixedStop {
    /// A full Newton step with a positive definite exact Hessian met the tolerance.
    Converged,
    /// The gradient vanishes, but the Hessian is not positive definite: an equilibrium that is not stable, or that can
    /// move without a change of energy.
    Saddle,
    /// No step lowers the energy by more than rounding.
    Stalled,
    /// The tolerance was not met within the iteration limit.
    IterationLimit,
}

/// Statistics of one search for a minimum.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MixedNewtonReport {
    /// Linear systems that were solved for steps.
    pub iterations: usize,
    /// Steps for which element Hessians were projected.
    pub projected: usize,
    /// Halvings of steps by the line search.
    pub halvings: usize,
    /// Iterations of conjugate gradients; 0 with a banded factorisation.
    pub linear_iterations: usize,
    /// The energy at the end.
    pub energy: MixedEnergy,
    /// The longest move of an unknown in the last full step, in m by its scale.
    pub last_move: f64,
    /// The reason why the search stopped.
    pub stopped: MixedStop,
}

impl MixedNewtonReport {
    /// Whether the tolerance was met.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.stopped == MixedStop::Converged
    }
}

/// A search for a minimum that failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MixedNewtonError {
    /// The configuration does not fit, or a derivative is not finite.
    #[error(transparent)]
    Evaluation(#[from] MixedError),
    /// The linear system has no solution, even with projected Hessians.
    #[error(transparent)]
    Linear(#[from] BorderedError),
    /// The energy at the start is not finite.
    #[error("the start is outside of a formula's domain: its energy is {0}")]
    OutsideDomain(f64),
    /// A time step did not converge.
    #[error("Newton's method stopped after {} iterations: {:?}", .0.iterations, .0.stopped)]
    NotConverged(MixedNewtonReport),
    /// The length of a time step is not a positive number.
    #[error("expected a time step greater than 0, got {0}")]
    WrongTimeStep(f64),
}

/// Halvings of one step before the search gives up.
const MOST_HALVINGS: usize = 40;
/// More halvings than this in one step increase the damping.
const FEW_HALVINGS: usize = 3;
/// Least damping: an addition to the diagonal of projected Hessians, relative to the stiffest entry.
const LEAST_DAMPING: f64 = 1e-9;
const MOST_DAMPING: f64 = 100.0;
/// The part of the decrease of the linear model that a step must achieve (Armijo).
const SUFFICIENT: f64 = 1e-4;
/// Rounding of a sum of energies, relative to the sum of their magnitudes.
const ROUNDING: f64 = 1e-14;

/// Newton's method with a line search on the energy.
///
/// Each step solves K d = −∂U/∂u with the exact Hessian K. If K is not positive definite, element Hessians are
/// projected ([`Curvature::Clamped`]) and damped: 10⁻⁹ of the largest stiffness is added to the diagonal, and a hundred
/// times more after each step that was far too long, as projected Hessians may be singular.
///
/// Shared unknowns that are [maximised](super::Extremum::Maximum) are eliminated: steps minimise the potential
/// maximised over them. With [multipliers](super::Extremum::Multiplier), steps lower the potential without them plus a
/// penalty for broken constraints.
///
/// ```
/// use energy_elements::{Gravity, HookeSpring};
/// use energy_solve::{KindSolver, MixedBody, MixedNewton, MixedNewtonOptions, MixedSystem, MixedTerm, UnknownKind};
///
/// // A point of 2 kg hangs from a fixed one by a spring of 100 N/m that is 1 m long at rest.
/// let body = MixedBody::new(&[UnknownKind::Vector3; 2], 1.0).with_fixed(&[0])?;
/// let spring = MixedTerm::of_points("spring", vec![HookeSpring::new(100.0, 1.0)], &[[0, 1]])?;
/// let weight = MixedTerm::of_points("weight", vec![Gravity::new(2.0, [0.0, 0.0, -9.81])], &[[1]])?;
/// let mut system = MixedSystem::new(body, vec![spring, weight])?;
/// let mut newton = MixedNewton::new(&system, &KindSolver::Automatic, MixedNewtonOptions::new(1e-12));
/// let (u, report) = newton.minimise(&mut system, &[0.0, 0.0, 0.0, 0.3, 0.0, -0.9])?;
/// assert!(report.converged(), "{report:?}");
/// assert!((u[5] + 1.0 + 2.0 * 9.81 / 100.0).abs() < 1e-12);
/// # Ok::<(), energy_solve::MixedNewtonError>(())
/// ```
#[derive(Debug)]
pub struct MixedNewton {
    options: MixedNewtonOptions,
    solver: BorderedSolver,
    matrix: BorderedMatrix,
}

/// A direction of search.
struct Direction {
    /// Increments of all unknowns.
    increments: Vec<f64>,
    /// The derivative of the energy along it.
    slope: f64,
    exact: bool,
}

impl MixedNewton {
    /// Analyses the matrix of a system.
    #[must_use]
    pub fn new(system: &MixedSystem, solver: &KindSolver, options: MixedNewtonOptions) -> Self {
        Self { options, solver: BorderedSolver::new(system.pattern(), solver), matrix: system.matrix() }
    }

    /// Returns the solver of the linear systems.
    #[must_use]
    pub fn solver(&self) -> &BorderedSolver {
        &self.solver
    }

    /// Searches for a minimum of the system's potential from u. Returns the configuration where the search ended, which
    /// is an equilibrium if the report has converged. States of elements do not change.
    ///
    /// # Errors
    /// If u is not a configuration of the body, its energy is not finite, a derivative is not finite, a linear system
    /// has no solution, or the potential is not concave in a maximised unknown.
    ///
    /// # Panics
    /// If this was created for another system.
    pub fn minimise(
        &mut self,
        system: &mut MixedSystem,
        u: &[f64],
    ) -> Result<(Vec<f64>, MixedNewtonReport), MixedNewtonError> {
        self.search(&mut Problem { system, inertial: None }, u)
    }

    /// [`MixedNewton::minimise`] with the inertial potential of a time step.
    pub(super) fn step(
        &mut self,
        system: &mut MixedSystem,
        inertial: &InertialPotential,
        u: &[f64],
    ) -> Result<(Vec<f64>, MixedNewtonReport), MixedNewtonError> {
        self.search(&mut Problem { system, inertial: Some(inertial) }, u)
    }

    fn search(
        &mut self,
        problem: &mut Problem<'_>,
        start: &[f64],
    ) -> Result<(Vec<f64>, MixedNewtonReport), MixedNewtonError> {
        problem.system.body().check(start)?;
        let mut u = start.to_vec();
        let energy = problem.maximise(&mut u, &mut self.matrix)?;
        if !energy.value.is_finite() {
            return Err(MixedNewtonError::OutsideDomain(energy.value));
        }
        let mut report = MixedNewtonReport {
            iterations: 0,
            projected: 0,
            halvings: 0,
            linear_iterations: 0,
            energy,
            last_move: f64::INFINITY,
            stopped: MixedStop::IterationLimit,
        };
        let (mut trusted, mut damping) = (true, LEAST_DAMPING);
        while report.iterations < self.options.iteration_limit {
            let direction = self.direction(problem, &u, (trusted, damping), &mut report)?;
            report.last_move = problem.system.body().longest(&direction.increments);
            // Damped steps are short anywhere.
            let is_whole = direction.exact || damping <= LEAST_DAMPING;
            let is_last = is_whole && report.last_move <= self.options.tolerance;
            let halvings = report.halvings;
            let found = self.line_search(problem, &u, &direction, &mut report)?;
            let moved = found.is_some();
            let was_damped = !direction.exact && damping < MOST_DAMPING;
            if !direction.exact {
                // Projected Hessians may be singular: steps that are far too long need more damping.
                let too_long = report.halvings > halvings + FEW_HALVINGS;
                damping = if too_long { 100.0 * damping } else { 0.1 * damping }.clamp(LEAST_DAMPING, MOST_DAMPING);
            }
            if let Some((next, energy)) = found {
                (u, report.energy) = (next, energy);
            }
            report.stopped = match (is_last, direction.exact) {
                (true, true) => MixedStop::Converged,
                // A direction of an exact Hessian may fail where a projected one leads down.
                (true, false) if trusted => MixedStop::Saddle,
                _ if moved || direction.exact || was_damped => {
                    trusted = moved;
                    continue;
                }
                _ => MixedStop::Stalled,
            };
            return Ok((u, report));
        }
        report.stopped = MixedStop::IterationLimit;
        Ok((u, report))
    }

    /// Solves for a step, with the exact Hessian if it is `trusted` and positive definite.
    fn direction(
        &mut self,
        problem: &mut Problem<'_>,
        u: &[f64],
        (trusted, damping): (bool, f64),
        report: &mut MixedNewtonReport,
    ) -> Result<Direction, MixedNewtonError> {
        report.iterations += 1;
        if trusted {
            let (energy, gradient) = problem.linearise(u, Curvature::Exact, &mut self.matrix)?;
            report.energy = energy;
            match self.solve(problem.system, &gradient, true, report) {
                Err(BorderedError::Indefinite | BorderedError::Singular(_) | BorderedError::NotConverged { .. }) => {}
                solved => return Ok(solved?),
            }
        }
        report.projected += 1;
        let (energy, gradient) = problem.linearise(u, Curvature::Clamped, &mut self.matrix)?;
        report.energy = energy;
        let stiffest = self.stiffest(problem.system);
        let (mut shift, mut added) = (damping, 0.0);
        loop {
            self.add_to_diagonal(problem.system, (shift - added) * stiffest);
            added = shift;
            match self.solve(problem.system, &gradient, false, report) {
                Err(BorderedError::Indefinite | BorderedError::Singular(_)) if shift < MOST_DAMPING => shift *= 100.0,
                solved => return Ok(solved?),
            }
        }
    }

    fn solve(
        &mut self,
        system: &MixedSystem,
        gradient: &[f64],
        exact: bool,
        report: &mut MixedNewtonReport,
    ) -> Result<Direction, BorderedError> {
        let right: Vec<f64> = system.free_part(gradient).into_iter().map(|entry| -entry).collect();
        let mut part = vec![0.0; right.len()];
        report.linear_iterations += self.solver.solve(&self.matrix, &right, &mut part)?;
        let own = system.pattern().increments();
        let counts = |row: usize| row < own || !self.matrix.maximised[row - own];
        let slope = -(0..right.len()).filter(|&row| counts(row)).map(|row| right[row] * part[row]).sum::<f64>();
        Ok(Direction { increments: system.spread(&part), slope, exact })
    }

    /// Returns the largest diagonal entry by metres, in N/m.
    fn stiffest(&self, system: &MixedSystem) -> f64 {
        let largest = |(row, scale): (usize, f64)| {
            let diagonal = self.matrix.kinds.diagonal(row);
            (0..3).map(|i| diagonal[i][i].abs()).fold(0.0, f64::max) / (scale * scale)
        };
        let stiffest = scales(system).map(largest).fold(0.0, f64::max);
        if stiffest > 0.0 { stiffest } else { 1.0 }
    }

    /// Adds a stiffness, in N/m, to the diagonal.
    fn add_to_diagonal(&mut self, system: &MixedSystem, stiffness: f64) {
        if stiffness > 0.0 {
            for (row, scale) in scales(system) {
                let entry = stiffness * scale * scale;
                self.matrix.kinds.add(row, row, |i, j| if i == j { entry } else { 0.0 });
            }
        }
    }

    /// Halves the step until it lowers the energy. Returns the configuration and its energy; `None` if no step does.
    fn line_search(
        &mut self,
        problem: &mut Problem<'_>,
        u: &[f64],
        direction: &Direction,
        report: &mut MixedNewtonReport,
    ) -> Result<Option<(Vec<f64>, MixedEnergy)>, MixedNewtonError> {
        let before = report.energy;
        let penalty = problem.penalty(u, (&direction.increments, direction.slope), &mut self.matrix)?;
        let merit = before.value + problem.penalised(u, &penalty, &mut self.matrix)?;
        let mut scale = self.first_scale(problem.system.body(), direction, report.last_move);
        for halvings in 0..MOST_HALVINGS {
            let mut moved = problem.system.body().moved(u, scale, &direction.increments);
            let energy = match problem.maximise(&mut moved, &mut self.matrix) {
                // Far from the minimum, numbers may overflow or the potential may lose its concavity.
                Err(MixedNewtonError::Evaluation(_) | MixedNewtonError::Linear(_)) => {
                    MixedEnergy { value: f64::INFINITY, magnitude: 0.0 }
                }
                energy => energy?,
            };
            let added =
                if energy.value.is_finite() { problem.penalised(&moved, &penalty, &mut self.matrix)? } else { 0.0 };
            let slack = ROUNDING * before.magnitude.max(if energy.value.is_finite() { energy.magnitude } else { 0.0 });
            if energy.value + added <= merit + SUFFICIENT * scale * penalty.slope + slack {
                report.halvings += halvings;
                return Ok(Some((moved, energy)));
            }
            scale *= 0.5;
        }
        report.halvings += MOST_HALVINGS;
        Ok(None)
    }

    /// Returns the part of a step that the options allow.
    fn first_scale(&self, body: &MixedBody, direction: &Direction, longest: f64) -> f64 {
        let by_stride = if longest > self.options.stride { self.options.stride / longest } else { 1.0 };
        let turn = body.largest_turn(&direction.increments);
        by_stride.min(if turn > 1.0 { 1.0 / turn } else { 1.0 })
    }
}

/// Returns the row of each free unknown of a system's own, and its scale.
fn scales(system: &MixedSystem) -> impl Iterator<Item = (usize, f64)> {
    let own = system.body().all().iter().take(system.body().len());
    let free = own.filter(|unknown| !unknown.fixed);
    free.map(|unknown| unknown.scale).enumerate()
}
