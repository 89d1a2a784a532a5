use std::time::Instant;

use energy_dsl::Vector3;
use energy_solve::{
    Curvature, EvaluationError, OverRelaxation, Pressed, SlidingStiffness, SolveOptions, SolveReport, StopReason, dot,
};

use super::super::projection::{Progress, Projection};
use super::super::trial::Trials;
use super::super::{StepError, StepReport};
use super::forcing::Forcing;
use super::incremental_potential::{Energy, EnergyAndGradient, IncrementalPotential};
use super::line_search::{AcceptedStep, Prefetch};
use super::local::Few;
use super::{Memory, NewtonOptions, largest};

/// The current iterate of a step, with the quantities evaluated there.
pub(super) struct Iterate<'a> {
    pub(super) options: NewtonOptions,
    pub(super) potential: IncrementalPotential<'a>,
    memory: &'a mut Memory,
    trials: &'a mut Trials,
    pub(super) projection: Projection,
    pub(super) x: Vec<Vector3<f64>>,
    pub(super) energy: Energy,
    /// −∇E at x, if it is known but the Hessian is not.
    pub(super) gradient: Option<Vec<Vector3<f64>>>,
    /// −∇E at x, if the matrix holds the exact Hessian at x.
    pub(super) linearised: Option<Vec<Vector3<f64>>>,
    /// The accuracy of the last linear system.
    last: Option<Forcing>,
    /// The largest change of a velocity component in the last iteration, in m/s.
    pub(super) change: f64,
    /// Whether the last line search took a full step; the next one then probably will.
    pub(super) took_full_step: bool,
    converged: bool,
    /// The part of their way that pins have gone; below 1 if contact stopped them.
    pub(super) pins: f64,
    /// Moves of pins that contact had stopped.
    pub(super) pin_moves: usize,
    /// Whether the next iteration lets pins wait.
    pub(super) pins_wait: bool,
    /// `false` once a term turned out not to be restrictable.
    may_eliminate: bool,
    /// Iterations that still take the secant stiffness of friction.
    secants: u32,
}

/// Iterations that take the secant stiffness of friction after a step that contact or the line search shortened.
const SECANTS: u32 = 3;

/// A search direction.
pub(super) struct Direction {
    /// Displacements of the free vertices.
    pub vectors: Vec<Vector3<f64>>,
    /// dᵀ ∇E.
    pub slope: f64,
    /// Whether the Hessian was projected.
    pub is_projected: bool,
    /// The largest component of the displacements, in m.
    pub length: f64,
    forcing: Forcing,
    solved: SolveReport,
}

impl Direction {
    /// Creates the direction that a solve found for `downhill`, which is −∇E. It is zero if the solve met a NaN.
    pub(super) fn new(
        downhill: &[Vector3<f64>],
        mut vectors: Vec<Vector3<f64>>,
        curvature: Curvature,
        forcing: Forcing,
        solved: SolveReport,
    ) -> Self {
        if solved.stopped == StopReason::NonFinite {
            vectors.fill([0.0; 3]);
        }
        let (slope, length) = (-dot(downhill, &vectors), largest(&vectors));
        Self { vectors, slope, is_projected: curvature != Curvature::Exact, length, forcing, solved }
    }
}

impl<'a> Iterate<'a> {
    /// Starts at x, or at the positions before the step if E is not finite at x.
    pub(super) fn new(
        options: NewtonOptions,
        mut potential: IncrementalPotential<'a>,
        memory: &'a mut Memory,
        trials: &'a mut Trials,
        mut x: Vec<Vector3<f64>>,
    ) -> Result<Self, EvaluationError> {
        let in_contact = potential.contact.is_some();
        let projection = Projection::on_demand(in_contact);
        let mut pins = if in_contact { potential.filter_warm_start(&mut x) } else { 1.0 };
        let mut found = potential.linearise_if_finite(&x, projection.curvature, &mut memory.matrix)?;
        if found.is_none() && in_contact {
            // Pins must not move before the cloth makes way for them.
            x.clone_from(&potential.body.x);
            pins = 0.0;
            found = potential.linearise_if_finite(&x, projection.curvature, &mut memory.matrix)?;
        }
        let (energy, linearised) = match found {
            Some(EnergyAndGradient { energy, downhill }) => (energy, Some(downhill)),
            None => {
                let body = &*potential.body;
                body.system.dofs().free().iter().for_each(|&vertex| x[vertex] = body.x[vertex]);
                (potential.energy(&x)?, None)
            }
        };
        Ok(Self {
            options,
            potential,
            memory,
            trials,
            projection,
            x,
            energy,
            gradient: None,
            linearised,
            last: None,
            change: f64::INFINITY,
            took_full_step: true,
            converged: false,
            pins,
            pin_moves: 0,
            pins_wait: false,
            may_eliminate: true,
            secants: 0,
        })
    }

    /// Iterates until the step converges.
    pub(super) fn converge(&mut self) -> Result<(), StepError> {
        while !self.converged {
            let iterations = self.potential.report.solves;
            if iterations == self.options.iteration_limit as u64 {
                let pressed = self.pressed();
                return Err(StepError::NotConverged { iterations, change: self.change, pressed });
            }
            if self.is_balanced()? {
                break;
            }
            let waits = std::mem::take(&mut self.pins_wait);
            if self.pins < 1.0 && !waits && self.follow_pins()? {
                continue;
            }
            let direction = self.direction()?;
            let few = self.few_that_move(&direction);
            match self.search(&direction, few.is_some())? {
                Some(step) => {
                    let scale = step.scale;
                    self.accept(step, &direction);
                    if !waits {
                        self.move_pins()?;
                    }
                    if let Some(few) = few {
                        self.eliminate(&few, scale)?;
                    }
                }
                None if direction.is_projected => {
                    let iterations = self.potential.report.solves;
                    let (stopped, pressed) = (direction.solved.stopped, self.pressed());
                    return Err(StepError::Stuck { iterations, stopped, pressed });
                }
                None => self.projection.demand(),
            }
        }
        Ok(())
    }

    /// Returns the positions and the report of the step.
    pub(super) fn into_result(self) -> (Vec<Vector3<f64>>, StepReport) {
        (self.x, self.potential.report)
    }

    /// Returns where contact presses the most, if it shortened a move of this step.
    pub(super) fn pressed(&self) -> Option<Pressed> {
        let is_shortened = self.potential.report.contact.shortened > 0;
        is_shortened.then(|| self.potential.most_pressed(&self.x)).flatten()
    }

    /// Whether residual impulses are below the tolerance, if the last solve makes that likely. Never before the first
    /// iteration: on a fine mesh vertices are so light that even free fall leaves a small residual impulse.
    fn is_balanced(&mut self) -> Result<bool, EvaluationError> {
        let dt = self.potential.dt;
        if self.pins < 1.0 || !self.last.is_some_and(|last| self.options.may_be_balanced(last, dt)) {
            return Ok(false);
        }
        let mut downhill = match self.gradient.take() {
            Some(downhill) => downhill,
            None => self.potential.gradient(&self.x)?,
        };
        self.potential.add_contact(&self.x, &mut downhill);
        Ok(self.options.is_balanced(&downhill, dt))
    }

    /// Assembles the Hessian, unless it is known, and solves for the search direction.
    fn direction(&mut self) -> Result<Direction, StepError> {
        let curvature = self.projection.curvature;
        let downhill = self.linearise()?;
        let forcing = self.options.forcing(largest(&downhill), self.last);
        self.last = Some(forcing);
        let (vectors, solved) = self.solve(&downhill, curvature, forcing.tolerance)?;
        Ok(Direction::new(&downhill, vectors, curvature, forcing, solved))
    }

    /// Assembles the Hessian, unless it is known, and returns −∇E.
    pub(super) fn linearise(&mut self) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        let mut downhill = match self.linearised.take().filter(|_| self.projection.is_exact()) {
            Some(downhill) => downhill,
            None => self.potential.linearise(&self.x, self.projection.curvature, &mut self.memory.matrix)?,
        };
        self.potential.add_contact(&self.x, &mut downhill);
        Ok(downhill)
    }

    /// Solves H d = −∇E. If an exact Hessian turns out to be indefinite, returns the truncated direction of conjugate
    /// gradients: a descent direction, or zero.
    pub(super) fn solve(
        &mut self,
        downhill: &[Vector3<f64>],
        curvature: Curvature,
        relative_tolerance: f64,
    ) -> Result<(Vec<Vector3<f64>>, SolveReport), StepError> {
        let options = SolveOptions::new(relative_tolerance);
        let contacts = self.potential.contacts(&self.x, self.sliding());
        let (scale, threads) = (self.potential.dt * self.potential.dt, self.potential.body.system.threads());
        let Memory { matrix, solver } = &mut *self.memory;
        let started = Instant::now();
        let contacts = matrix.add_contacts(&contacts, scale, threads);
        let prepared = solver.prepare(matrix, &contacts.cross, self.trials);
        self.potential.report.phases.factorisation += started.elapsed();

        let started = Instant::now();
        let mut direction = vec![[0.0; 3]; downhill.len()];
        let mut solved = SolveReport::indefinite();
        if prepared.is_ok() {
            let (report, solved_by) = solver.solve(downhill, &mut direction, &options, self.trials);
            solved = report;
            self.potential.report.solved_by += solved_by;
        }
        matrix.remove_contacts(contacts);
        if curvature != Curvature::Exact {
            prepared?;
        }
        if curvature != Curvature::Exact && !solved.converged() {
            solved = self.solve_in_double(downhill, curvature, &options, &mut direction)?;
        }
        let report = &mut self.potential.report;
        report.phases.solve += started.elapsed();
        report.solves += 1;
        report.iterations += solved.iterations as u64;
        report.projected |= curvature != Curvature::Exact;
        Ok((direction, solved))
    }

    /// Solves in double precision. Rounding to single precision can make a very stiff projected Hessian indefinite.
    fn solve_in_double(
        &mut self,
        downhill: &[Vector3<f64>],
        curvature: Curvature,
        options: &SolveOptions,
        direction: &mut [Vector3<f64>],
    ) -> Result<SolveReport, StepError> {
        let mut matrix = self.potential.body.system.matrix();
        self.potential.linearise(&self.x, curvature, &mut matrix)?;
        let contacts = self.potential.contacts(&self.x, self.sliding());
        let (scale, threads) = (self.potential.dt * self.potential.dt, self.potential.body.system.threads());
        let contacts = matrix.add_contacts(&contacts, scale, threads);
        let mut solver = OverRelaxation::<f64>::with_threads(matrix.pattern(), threads);
        solver.scale_with(&matrix, &contacts.cross)?;
        Ok(solver.solve(downhill, direction, options))
    }

    /// Decides whether the next iterations take the secant stiffness of friction, after a step of this length.
    pub(super) fn count_secants(&mut self, scale: f64) {
        self.secants = if scale < 1.0 { SECANTS } else { self.secants.saturating_sub(1) };
    }

    /// How friction enters the Hessian.
    fn sliding(&self) -> SlidingStiffness {
        if self.secants > 0 { SlidingStiffness::Secant } else { SlidingStiffness::Exact }
    }

    /// Returns the vertices to eliminate after a step along the direction; `None` if all are to move together, or the
    /// step may be the last.
    fn few_that_move(&self, direction: &Direction) -> Option<Few> {
        let may_be_last = self.options.may_be_balanced(direction.forcing, self.potential.dt);
        let may_eliminate = self.may_eliminate && self.pins == 1.0 && !may_be_last;
        may_eliminate.then(|| self.potential.few_that_move(direction)).flatten()
    }

    /// Lets the few vertices that a step of this scale moved far proceed on their own, unless the iterate converged.
    fn eliminate(&mut self, few: &Few, scale: f64) -> Result<(), EvaluationError> {
        if self.converged {
            return Ok(());
        }
        let shortest = (scale * few.far).max(self.potential.dt * self.options.velocity_tolerance);
        match self.potential.eliminate(few, &mut self.x, shortest)? {
            Some(change) => self.energy.value += change,
            None => self.may_eliminate = false,
        }
        (self.gradient, self.linearised) = (None, None);
        Ok(())
    }

    /// Searches along the direction; `None` if no step lowers E. Nothing is prefetched if the iterate moves on before
    /// the next iteration.
    fn search(&mut self, direction: &Direction, moves_on: bool) -> Result<Option<AcceptedStep>, EvaluationError> {
        if direction.length == 0.0 && direction.forcing.gradient > 0.0 {
            return Ok(None);
        }
        let dt = self.potential.dt;
        let is_last = direction.length < dt * self.options.velocity_tolerance;
        let prefetch = if moves_on {
            Prefetch::Nothing
        } else if self.options.may_be_balanced(direction.forcing, dt) {
            Prefetch::Gradient
        } else if direction.is_projected || is_last || !self.took_full_step || !direction.solved.converged() {
            Prefetch::Nothing
        } else {
            Prefetch::Matrix(&mut self.memory.matrix)
        };
        self.potential.line_search(&self.x, self.energy, direction, prefetch)
    }

    /// Moves to the next iterate, tests for convergence, and decides whether the next Hessian is projected.
    fn accept(&mut self, step: AcceptedStep, direction: &Direction) {
        self.potential.advance(&mut self.x, step.scale, &direction.vectors);
        (self.energy, self.gradient, self.linearised) = (step.energy, step.gradient, step.linearised);
        self.took_full_step = step.scale >= step.allowed;
        self.count_secants(step.scale);
        let change = step.scale * direction.length / self.potential.dt;
        let before = std::mem::replace(&mut self.change, change);
        let is_solution = direction.is_projected || direction.solved.converged();
        let (is_whole, shrinks) = (step.allowed == 1.0, self.took_full_step && change < before);
        // A step that contact shortens, or along a truncated direction, says nothing about the distance to the minimum.
        self.converged = is_solution && is_whole && self.pins == 1.0 && change < self.options.velocity_tolerance;
        // The next step finds the pairs near the last iterate.
        if !self.converged {
            self.energy.value += self.potential.update_active_set(&self.x);
        }
        self.projection.proceed(Progress { is_solution, is_whole, shrinks });
    }
}
