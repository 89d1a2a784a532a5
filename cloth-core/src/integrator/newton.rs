use std::borrow::Cow;
use std::time::{Duration, Instant};

use energy_dsl::Vector3;
use energy_solve::{
    BlockMatrix, Curvature, EvaluationError, LinearisationOptions, OverRelaxation, PlacedTerm, Precision, SolveOptions,
    SolveReport, State, StopReason, System, Weights, dot,
};
use serde::{Deserialize, Serialize};

use super::linear_solver::{LinearSolver, LinearSolverChoice};
use super::projection::Projection;
use super::trial::Trial;
use super::warm_start::WarmStart;
use super::{Integrator, IntegratorMemory, StepError, StepReport, if_finite, moved_by_velocity};
use crate::body::Body;

/// Implicit Euler by Newton's method on the incremental potential (Gast, Schroeder, Stomakhin, Jiang and Teran 2015)
///
/// E(x) = ½ Σ m ‖x − x̂‖² + h² (U(x) + h R(x, v)),  x̂ = x₀ + h v₀,  v = (x − x₀)/h,
///
/// R the dissipation function of damping: half the power that linear damping takes. It begins where the last accelerations lead. Hessians are exact as long
/// as their sum is positive definite and steps shrink; where not, each element's is made positive semi-definite for the next steps (projection on demand,
/// Longva, Löschner, Fernández-Fernández, Larionov, Ascher and Bender 2023). Every step leads downhill, and is halved until it lowers E; those of projected
/// Hessians, which are stiffer than the truth, are doubled as long as that lowers it further. First order and dissipative, but the energy of a motion never
/// grows.
///
/// Needs an energy of every force but drag: with [`crate::fabric::Bending::BridsonForce`], which has none, and with springs damped along
/// their length, whose Jacobians are not symmetric, use [`super::ImplicitEuler`].
#[derive(Clone, Debug, Default)]
pub struct Newton {
    options: NewtonOptions,
    trial: Trial,
    warm_start: WarmStart,
    memory: Option<Memory>,
}

/// When a step is done, and how exactly its linear systems are solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonOptions {
    /// Done when an iteration changes no velocity by more, in m/s.
    pub velocity_tolerance: f64,
    /// Done when no vertex lacks more than this impulse, in N s.
    pub impulse_tolerance: f64,
    /// Give up after this many iterations.
    pub iteration_limit: usize,
    /// Each linear system's residual relative to its right-hand side; up to ten times as much where Newton's method is slow anyway.
    pub linear_tolerance: f64,
    /// What solves them.
    pub linear_solver: LinearSolverChoice,
}

impl Default for NewtonOptions {
    /// 10⁻⁴ m/s, whatever the impulse; 100 iterations; linear systems to 0.01, which Newton's method makes up for.
    fn default() -> Self {
        Self {
            velocity_tolerance: 1e-4,
            impulse_tolerance: 0.0,
            iteration_limit: 100,
            linear_tolerance: 0.01,
            linear_solver: LinearSolverChoice::Auto,
        }
    }
}

/// What stays from one step to the next.
#[derive(Clone, Debug)]
struct Memory {
    matrix: BlockMatrix<f32>,
    solver: LinearSolver<f32>,
}

/// How long the parts of a step took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Phases {
    /// Gradients, Hessians and assembly.
    pub assembly: Duration,
    /// The factorisation of what preconditions.
    pub factorisation: Duration,
    /// Conjugate gradients.
    pub solve: Duration,
    /// Energies along the search directions.
    pub line_search: Duration,
}

impl std::ops::AddAssign for Phases {
    fn add_assign(&mut self, other: Self) {
        self.assembly += other.assembly;
        self.factorisation += other.factorisation;
        self.solve += other.solve;
        self.line_search += other.line_search;
    }
}

/// The second system of a step is solved to this part of the square of what the first iteration left of ∇E, …
const PROGRESS: f64 = 0.9;
/// … and none more loosely than by this factor: an iteration of conjugate gradients is cheaper than one of Newton's method.
const LOOSENING: f64 = 10.0;
/// Halvings of a step before it counts as stuck: the last is 2⁻⁴⁰ of the first.
const HALVINGS: usize = 40;
/// The longest step.
const LONGEST: f64 = 1024.0;
/// How much of the decrease that the slope promises must come true (Armijo).
const DECREASE: f64 = 1e-4;
/// Decreases are not seen below this part of the energies they are differences of.
const ROUNDING: f64 = 1e-13;

impl Newton {
    /// With other tolerances.
    #[must_use]
    pub fn with_options(options: NewtonOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// How exactly to solve for the next direction: as exactly as Newton's method, by its progress since the last, can make use of (Eisenstat and
    /// Walker 1996, choice 2). Where that takes a third system convergence is not quadratic, and no more is to be expected than was made last.
    fn forcing(&self, gradient: f64, last: Option<Forcing>) -> Forcing {
        let tightest = self.options.linear_tolerance;
        let useful = last.map_or(0.0, |last| {
            let left = gradient / last.gradient;
            if last.is_first { PROGRESS * left.powi(2) } else { left }
        });
        Forcing { gradient, tolerance: useful.min(LOOSENING * tightest).max(tightest), is_first: last.is_none() }
    }

    /// The matrix and solver of this system, those of the last step if it was the same.
    fn memory_for(&mut self, system: &System) -> Memory {
        self.memory.take().filter(|memory| system.owns(&memory.matrix)).unwrap_or_else(|| {
            let matrix = system.matrix_in();
            let solver = LinearSolver::new(self.options.linear_solver, &matrix, system.threads());
            Memory { matrix, solver }
        })
    }

    /// Whether no vertex lacks much of an impulse.
    fn is_enough(&self, down: &[Vector3<f64>], dt: f64) -> bool {
        largest(down) < dt * self.options.impulse_tolerance
    }

    /// What was solved to some part leaves about that part at least. Where that is too much there is no need to look; else forces are looked at before
    /// Hessians, which may not be needed.
    fn may_be_enough(&self, last: Forcing, dt: f64) -> bool {
        last.tolerance * last.gradient < dt * self.options.impulse_tolerance
    }
}

/// What a linear system was solved for, and how exactly.
#[derive(Clone, Copy, Debug)]
struct Forcing {
    /// The largest component of ∇E, in kg m.
    gradient: f64,
    /// The residual relative to it.
    tolerance: f64,
    /// Whether it was the first of its step.
    is_first: bool,
}

/// Where a line search ended.
struct Found {
    /// The part of the direction that it takes.
    scale: f64,
    /// E there, and the size of the numbers it is made of.
    energy: (f64, f64),
    /// −∇E there, if it was looked at, or came with the matrix.
    looked: Option<Vec<Vector3<f64>>>,
    linearised: Option<Vec<Vector3<f64>>>,
}

/// What is evaluated where a whole step leads, before it is known whether E is low enough there: E comes with it.
enum Ahead<'a> {
    Nothing,
    /// −∇E, which may turn out to be small enough.
    Gradient,
    /// −∇E and the matrix of the next iteration.
    Matrix(&'a mut BlockMatrix<f32>),
}

/// E and −∇E.
type Start = ((f64, f64), Vec<Vector3<f64>>);

/// A step on its way.
struct Step<'a> {
    body: &'a mut Body,
    dt: f64,
    report: StepReport,
}

impl Step<'_> {
    /// x̂ of a vertex.
    fn inertial(&self, vertex: usize) -> Vector3<f64> {
        moved_by_velocity(&self.body.x[vertex], &self.body.v[vertex], self.dt)
    }

    /// E and the size of the numbers it is made of; infinite where an element's energy is.
    fn energy(&mut self, x: &[Vector3<f64>]) -> Result<(f64, f64), EvaluationError> {
        let started = Instant::now();
        let (mut sum, mut size) = (0.0, 0.0);
        for &vertex in self.body.system.dofs().free() {
            let inertial = self.inertial(vertex);
            let away: Vector3<f64> = std::array::from_fn(|axis| x[vertex][axis] - inertial[axis]);
            sum += 0.5 * self.body.masses[vertex] * away.iter().map(|component| component * component).sum::<f64>();
        }
        size += sum;
        let Some(energies) = if_finite(self.body.system.energies(x))? else {
            return Ok((f64::INFINITY, f64::INFINITY));
        };
        for energy in energies.iter().filter_map(|term| term.energy) {
            sum += self.dt * self.dt * energy;
            size += self.dt * self.dt * energy.abs();
        }
        if self.body.system.character().velocity_dependent {
            let v = velocities(x, &self.body.x, self.dt);
            let dissipation = self.body.system.dissipation(State { x, v: &v })?;
            sum += self.dt.powi(3) * dissipation;
            size += self.dt.powi(3) * dissipation.abs();
        }
        self.report.phases.line_search += started.elapsed();
        Ok((sum, size))
    }

    /// The matrix, M − h² ∂f/∂x − h ∂f/∂v, and −∇E = M (x̂ − x) + h² f of the free vertices.
    fn linearise<T: Precision>(
        &mut self,
        x: &[Vector3<f64>],
        curvature: Curvature,
        matrix: &mut BlockMatrix<T>,
    ) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        let started = Instant::now();
        let Body { system, masses, x: start, v: before, .. } = &mut *self.body;
        let v = if_dependent(system, before, || velocities(x, start, self.dt));
        let weights = Weights { position: -self.dt * self.dt, velocity: -self.dt };
        let options = LinearisationOptions { weights, curvature, stiffness_times_velocity: false };
        let linear = system.linearise_with_masses(State { x, v: &v }, options, masses, matrix)?;
        let down = self.downhill(x, linear.force);
        self.report.phases.assembly += started.elapsed();
        Ok(down)
    }

    /// E, −∇E and the matrix; nothing where they are not finite.
    fn linearise_where_finite(
        &mut self,
        x: &[Vector3<f64>],
        curvature: Curvature,
        matrix: &mut BlockMatrix<f32>,
    ) -> Result<Option<Start>, EvaluationError> {
        let Some(down) = if_finite(self.linearise(x, curvature, matrix))? else { return Ok(None) };
        let energy = self.energy(x)?;
        Ok(energy.0.is_finite().then_some((energy, down)))
    }

    /// −∇E alone.
    fn gradient(&mut self, x: &[Vector3<f64>]) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        let started = Instant::now();
        let Body { system, x: start, v: before, .. } = &mut *self.body;
        let v = if_dependent(system, before, || velocities(x, start, self.dt));
        let force = system.forces(State { x, v: &v })?;
        let down = self.downhill(x, force);
        self.report.phases.assembly += started.elapsed();
        Ok(down)
    }

    /// M (x̂ − x) + h² f of the free vertices.
    fn downhill(&self, x: &[Vector3<f64>], mut force: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
        let free = self.body.system.dofs().free();
        // In place: free vertices are in ascending order.
        for (place, &vertex) in free.iter().enumerate() {
            let (mass, inertial, pull) = (self.body.masses[vertex], self.inertial(vertex), force[vertex]);
            force[place] =
                std::array::from_fn(|axis| mass * (inertial[axis] - x[vertex][axis]) + self.dt * self.dt * pull[axis]);
        }
        force.truncate(free.len());
        force
    }

    /// Solves for the direction. Of a matrix whose curvature is exact and turns out to be negative, as far as that goes: it leads downhill, or is zero.
    fn direction(
        &mut self,
        x: &[Vector3<f64>],
        down: &[Vector3<f64>],
        curvature: Curvature,
        Memory { matrix, solver }: &mut Memory,
        trial: &mut Trial,
        relative_tolerance: f64,
    ) -> Result<(Vec<Vector3<f64>>, SolveReport), StepError> {
        let options = SolveOptions { relative_tolerance, ..SolveOptions::default() };
        let started = Instant::now();
        let prepared = solver.prepare(matrix, trial);
        self.report.phases.factorisation += started.elapsed();

        let started = Instant::now();
        let mut direction = vec![[0.0; 3]; down.len()];
        let mut solved = SolveReport::indefinite();
        if curvature != Curvature::Exact || prepared.is_ok() {
            prepared?;
            let (report, solved_by) = solver.solve(matrix, down, &mut direction, &options, trial);
            solved = report;
            self.report.solved_by += solved_by;
        }
        if curvature != Curvature::Exact && !solved.converged() {
            // Single precision made the stiffest of matrices indefinite.
            let mut precise = self.body.system.matrix();
            self.linearise(x, curvature, &mut precise)?;
            let mut solver = OverRelaxation::<f64>::with_threads(precise.pattern(), self.body.system.threads());
            solver.scale(&precise)?;
            solved = solver.solve(down, &mut direction, &options);
        }
        if solved.stopped == StopReason::NonFinite {
            direction.fill([0.0; 3]);
        }
        self.report.phases.solve += started.elapsed();
        self.report.solves += 1;
        self.report.iterations += solved.iterations as u64;
        self.report.projected |= curvature == Curvature::Exact && !solved.converged();
        Ok((direction, solved))
    }

    /// The first of x + d, x + d/2, … that lowers E as the slope promises (Armijo); `None` if none does. A projected direction is too short rather than too
    /// long: of x + d, x + 2 d, … the last before E grows. `slope` is dᵀ ∇E. With E at x + d comes what will be needed there (`ahead`).
    fn line_search(
        &mut self,
        x: &[Vector3<f64>],
        energy: (f64, f64),
        slope: f64,
        direction: &[Vector3<f64>],
        projected: bool,
        mut ahead: Ahead<'_>,
    ) -> Result<Option<Found>, EvaluationError> {
        let mut scale = 1.0;
        for _ in 0..=HALVINGS {
            let moved = self.moved(x, scale, direction);
            let (mut looked, mut linearised) = (None, None);
            match std::mem::replace(&mut ahead, Ahead::Nothing) {
                Ahead::Nothing => {}
                Ahead::Gradient => looked = if_finite(self.gradient(&moved))?,
                Ahead::Matrix(matrix) => linearised = if_finite(self.linearise(&moved, Curvature::Exact, matrix))?,
            }
            let trial = self.energy(&moved)?;
            if trial.0 <= energy.0 + DECREASE * scale * slope + ROUNDING * energy.1.min(trial.1) {
                drop(moved);
                let found = Found { scale, energy: trial, looked, linearised };
                let too_short = projected && scale == 1.0;
                return Ok(Some(if too_short { self.lengthen(x, found, direction)? } else { found }));
            }
            scale *= 0.5;
            self.report.halvings += 1;
        }
        Ok(None)
    }

    /// Doubles a step as long as that lowers E.
    fn lengthen(
        &mut self,
        x: &[Vector3<f64>],
        mut found: Found,
        direction: &[Vector3<f64>],
    ) -> Result<Found, EvaluationError> {
        while found.scale < LONGEST {
            let scale = 2.0 * found.scale;
            let moved = self.moved(x, scale, direction);
            let energy = self.energy(&moved)?;
            if energy.0 >= found.energy.0 {
                break;
            }
            found = Found { scale, energy, looked: None, linearised: None };
        }
        Ok(found)
    }

    /// x + s d on the free vertices.
    fn moved(&self, x: &[Vector3<f64>], scale: f64, direction: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut moved = x.to_vec();
        self.advance(&mut moved, scale, direction);
        moved
    }

    /// x ← x + s d on the free vertices.
    fn advance(&self, x: &mut [Vector3<f64>], scale: f64, direction: &[Vector3<f64>]) {
        for (&vertex, d) in self.body.system.dofs().free().iter().zip(direction) {
            for axis in 0..3 {
                x[vertex][axis] += scale * d[axis];
            }
        }
    }
}

/// v = (x − x₀)/h.
fn velocities(x: &[Vector3<f64>], start: &[Vector3<f64>], dt: f64) -> Vec<Vector3<f64>> {
    let velocity = |(x, start): (&Vector3<f64>, &Vector3<f64>)| -> Vector3<f64> {
        std::array::from_fn(|axis| (x[axis] - start[axis]) / dt)
    };
    x.iter().zip(start).map(velocity).collect()
}

/// The velocities where some force depends on them; elsewhere any will do, and those before the step are at hand.
fn if_dependent<'a>(
    system: &System,
    before: &'a [Vector3<f64>],
    velocities: impl FnOnce() -> Vec<Vector3<f64>>,
) -> Cow<'a, [Vector3<f64>]> {
    if system.character().velocity_dependent { velocities().into() } else { before.into() }
}

/// Forces without energy, but drag, have no incremental potential.
fn refuse_without_energy(system: &System) -> Result<(), StepError> {
    let fits = |term: &dyn PlacedTerm| {
        let character = term.character();
        character.symmetric && (term.has_energy() || character.velocity_dependent)
    };
    match system.terms().find(|(term, _)| !fits(*term)) {
        Some((term, _)) => Err(StepError::NotSymmetric { term: term.name().to_owned() }),
        None => Ok(()),
    }
}

fn largest(vectors: &[Vector3<f64>]) -> f64 {
    vectors.as_flattened().iter().fold(0.0, |largest, component| component.abs().max(largest))
}

impl Integrator for Newton {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        refuse_without_energy(&body.system)?;
        let mut memory = self.memory_for(&body.system);
        let mut step = Step { body, dt, report: StepReport::default() };
        let mut x = self.warm_start.begin(step.body, dt);
        let mut projection = Projection::on_demand();
        let start = step.linearise_where_finite(&x, projection.curvature, &mut memory.matrix)?;
        let (mut energy, mut linearised) = match start {
            Some((energy, down)) => (energy, Some(down)),
            None => {
                step.body.system.dofs().free().iter().for_each(|&vertex| x[vertex] = step.body.x[vertex]);
                (step.energy(&x)?, None)
            }
        };
        let (mut converged, mut change) = (false, f64::INFINITY);
        let (mut last, mut looked) = (None, None);
        // Whether the last line search took a whole step: then the next one probably will.
        let mut whole = true;
        while !converged {
            if step.report.solves == self.options.iteration_limit as u64 {
                return Err(StepError::NotConverged { iterations: step.report.solves, change });
            }
            // One iteration at least: on a fine mesh no vertex weighs much, and not even free fall lacks a large impulse.
            if last.is_some_and(|last| self.may_be_enough(last, dt)) {
                let down = match looked.take() {
                    Some(down) => down,
                    None => step.gradient(&x)?,
                };
                if self.is_enough(&down, dt) {
                    break;
                }
            }
            let (curvature, projected) = (projection.curvature, !projection.is_exact());
            let down = match linearised.take().filter(|_| !projected) {
                Some(down) => down,
                None => step.linearise(&x, curvature, &mut memory.matrix)?,
            };
            let forcing = self.forcing(largest(&down), last);
            last = Some(forcing);
            let (direction, solved) =
                step.direction(&x, &down, curvature, &mut memory, &mut self.trial, forcing.tolerance)?;
            let slope = -dot(&down, &direction);
            // Not needed while lines are searched, which takes most memory.
            drop(down);
            let length = largest(&direction);
            let ends = length < dt * self.options.velocity_tolerance;
            let ahead = if self.may_be_enough(forcing, dt) {
                Ahead::Gradient
            } else if projected || ends || !whole || !solved.converged() {
                Ahead::Nothing
            } else {
                Ahead::Matrix(&mut memory.matrix)
            };
            let leads_nowhere = length == 0.0 && forcing.gradient > 0.0;
            let found =
                if leads_nowhere { None } else { step.line_search(&x, energy, slope, &direction, projected, ahead)? };
            let Some(found) = found else {
                if !projected {
                    projection.demand();
                    continue;
                }
                return Err(StepError::Stuck { iterations: step.report.solves, stopped: solved.stopped });
            };
            step.advance(&mut x, found.scale, &direction);
            (energy, looked, linearised) = (found.energy, found.looked, found.linearised);
            whole = found.scale >= 1.0;
            let before = std::mem::replace(&mut change, found.scale * length / dt);
            if projected || solved.converged() {
                converged = change < self.options.velocity_tolerance;
                projection.proceed(whole && change < before);
            } else {
                projection.demand();
            }
        }
        let v = velocities(&x, &step.body.x, dt);
        let report = step.report;
        self.warm_start = WarmStart::after(body, &v, dt, report.solves);
        (body.x, body.v) = (x, v);
        self.memory = Some(memory);
        Ok(report)
    }

    fn memory(&self) -> IntegratorMemory {
        let warm_start = self.warm_start.clone();
        IntegratorMemory { trial: self.trial, warm_start, ..IntegratorMemory::default() }
    }

    fn restore(&mut self, memory: IntegratorMemory) {
        (self.trial, self.warm_start) = (memory.trial, memory.warm_start);
    }

    fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_are_solved_as_exactly_as_progress_can_make_use_of() {
        let newton = Newton::default();
        let after = |is_first: bool, gradient: f64, last: f64| {
            let last = Forcing { gradient: last, tolerance: 0.01, is_first };
            newton.forcing(gradient, Some(last)).tolerance
        };
        let tolerance = |gradient: f64, last: f64| after(true, gradient, last);
        assert_eq!(newton.forcing(1.0, None).tolerance, 0.01);
        // A fifth is left: nine tenths of its square. No less than a hundredth, no more than a tenth.
        assert!((tolerance(0.2, 1.0) - 0.9 * 0.04).abs() < 1e-15);
        assert_eq!(tolerance(0.01, 1.0), 0.01);
        assert_eq!(tolerance(3.0, 1.0), 0.1);
        assert_eq!(tolerance(0.0, 0.0), 0.1);
        // A third system only down to what the second left.
        assert_eq!(after(false, 0.05, 1.0), 0.05);
        assert_eq!(after(false, 0.001, 1.0), 0.01);
        assert_eq!(after(false, 0.2, 1.0), 0.1);
    }

    #[test]
    fn impulses_are_looked_at_where_they_may_be_small() {
        let newton = Newton::with_options(NewtonOptions { impulse_tolerance: 1e-3, ..NewtonOptions::default() });
        let of =
            |gradient: f64, tolerance: f64| newton.may_be_enough(Forcing { gradient, tolerance, is_first: true }, 0.01);
        assert!(of(9e-4, 0.01) && !of(1.1e-3, 0.01) && !of(9e-4, 0.1));
        assert!(newton.is_enough(&[[0.0, -9e-6, 0.0]], 0.01) && !newton.is_enough(&[[0.0, -1.1e-5, 0.0]], 0.01));
    }
}
