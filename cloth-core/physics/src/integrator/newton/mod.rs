mod forcing;
mod in_contact;
mod incremental_potential;
mod iterate;
mod line_search;
mod local;
mod pins;

use std::time::{Duration, Instant};

use energy_dsl::Vector3;
use energy_solve::{BlockMatrix, ContactStep, EvaluationError, PlacedTerm, System};
use serde::{Deserialize, Serialize};

use super::linear_solver::{LinearSolver, LinearSolverChoice};
use super::trial::Trials;
use super::warm_start::WarmStart;
use super::{Integrator, IntegratorMemory, StepError, StepReport};
use crate::body::Body;
use incremental_potential::IncrementalPotential;
use iterate::Iterate;

/// Implicit Euler by Newton's method on the incremental potential (Gast, Schroeder, Stomakhin, Jiang and Teran 2015)
///
/// E(x) = ½ Σ m ‖x − x̂‖² + h² (U(x) + h R(x, v)),  x̂ = x₀ + h v₀,  v = (x − x₀)/h,
///
/// where U is the potential energy and R the dissipation function: half the dissipated power, if damping is linear.
/// First order and dissipative; the energy of a motion never grows.
///
/// - The first iterate extrapolates with the accelerations of the last step.
/// - Hessians are exact as long as their sum is positive definite and steps shrink. Otherwise the next iterations
///   project each element's Hessian to positive semi-definite: projection on demand (Longva, Löschner,
///   Fernández-Fernández, Larionov, Ascher and Bender 2023). A body that collides does so after directions that
///   lead nowhere, and after steps that contact shortened.
/// - After an iteration that moves fewer than 15 % of the free vertices by more than a tenth of the largest move, up to
///   four more iterations move these vertices alone: nonlinear elimination (Cai and Keyes 2002). Bodies with a term
///   that cannot be restricted ([`PlacedTerm::restricted`]) do without.
/// - Every step follows a descent direction and is halved until it lowers E. Projected Hessians are too stiff, so their
///   steps are doubled as long as that lowers E further.
///
/// If the body collides, every move is certified to have no crossing ([`ContactStep::filter_step`]): the warm start,
/// the motion of pins, each trial step and each lengthened step. Pins and obstacles that meet cloth move inside
/// Newton's direction, so that cloth makes way while they come.
///
/// Every force other than drag needs an energy or a dissipation function. [`crate::fabric::Bending::BridsonForce`] has
/// neither, and springs damped along their length have unsymmetric Jacobians: use [`super::ImplicitEuler`] for both.
#[derive(Clone, Debug, Default)]
pub struct Newton {
    options: NewtonOptions,
    trials: Trials,
    warm_start: WarmStart,
    memory: Option<Memory>,
    /// The work of steps that failed.
    failed: StepReport,
}

/// Stopping criteria of a step, and the accuracy of its linear systems.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonOptions {
    /// A step converges once an iteration changes no velocity component by more than this, in m/s.
    pub velocity_tolerance: f64,
    /// A step also converges once no component of a vertex's residual impulse exceeds this, in N s.
    pub impulse_tolerance: f64,
    /// A step fails after this many iterations.
    pub iteration_limit: usize,
    /// Residual of each linear system relative to its right-hand side. Loosened by up to a factor of four while Newton's
    /// method converges slowly.
    pub linear_tolerance: f64,
    /// The solver of the linear systems.
    pub linear_solver: LinearSolverChoice,
}

impl Default for NewtonOptions {
    /// 10⁻⁴ m/s, no impulse tolerance, 100 iterations, and linear systems to 1 %: Newton's method corrects the rest.
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

/// Allocations kept from one step to the next.
#[derive(Clone, Debug)]
struct Memory {
    matrix: BlockMatrix<f32>,
    solver: LinearSolver<f32>,
}

/// Wall time by phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Phases {
    /// Gradients, Hessians and assembly.
    pub assembly: Duration,
    /// Factorisation of the preconditioner.
    pub factorisation: Duration,
    /// Conjugate gradients.
    pub solve: Duration,
    /// Energies along the search directions.
    pub line_search: Duration,
    /// Search for pairs that may collide, and certificates of moves.
    #[serde(default)]
    pub collision: Duration,
    /// Forces and stiffness of pairs in contact, and their friction.
    #[serde(default)]
    pub contact: Duration,
    /// Matrices, solvers and contact at the start of a step, and the systems of local eliminations.
    #[serde(default)]
    pub preparation: Duration,
    /// The energy ledger, and the histories of terms.
    #[serde(default)]
    pub ledger: Duration,
}

impl Phases {
    /// Adds time to the ledger, unless no phase was measured: only [`Newton`] measures them.
    pub fn add_to_ledger(&mut self, time: Duration) {
        if *self != Self::default() {
            self.ledger += time;
        }
    }
}

impl std::ops::AddAssign for Phases {
    fn add_assign(&mut self, other: Self) {
        self.assembly += other.assembly;
        self.factorisation += other.factorisation;
        self.solve += other.solve;
        self.line_search += other.line_search;
        self.collision += other.collision;
        self.contact += other.contact;
        self.preparation += other.preparation;
        self.ledger += other.ledger;
    }
}

impl Newton {
    /// Creates an integrator with these options.
    #[must_use]
    pub fn with_options(options: NewtonOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// Returns the matrix and solver of the last step if it had the same system, or new ones.
    fn memory_for(&mut self, system: &System) -> Memory {
        self.memory.take().filter(|memory| system.owns(&memory.matrix)).unwrap_or_else(|| {
            let matrix = system.matrix_in();
            let solver = LinearSolver::new(self.options.linear_solver, &matrix, system.threads());
            Memory { matrix, solver }
        })
    }

    /// Moves the body to the minimum of E. On an error the body is unchanged. The step started at `started`.
    fn minimise(
        &mut self,
        body: &mut Body,
        contact: Option<Box<dyn ContactStep + '_>>,
        dt: f64,
        started: Instant,
    ) -> Result<StepReport, StepError> {
        let mut memory = self.memory_for(&body.system);
        let x = self.warm_start.begin(body, dt);
        let mut potential = IncrementalPotential::new(body, contact, dt);
        potential.report.phases.preparation += started.elapsed();
        let mut iterate = Iterate::new(self.options, potential, &mut memory, &mut self.trials, x)?;
        let converged = iterate.converge();
        let (x, report) = iterate.into_result();
        if let Err(reason) = converged {
            self.failed += report;
            return Err(reason);
        }
        let v = incremental_potential::velocities(&x, &body.x, dt);
        self.warm_start = WarmStart::after(body, &v, dt, report.solves);
        (body.x, body.v) = (x, v);
        self.memory = Some(memory);
        Ok(report)
    }
}

impl Integrator for Newton {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let started = Instant::now();
        check_terms(&body.system)?;
        let mut contact = body.system.take_contact();
        let step = contact.as_mut().map(|contact| contact.begin_step(&body.x));
        let report = self.minimise(body, step, dt, started);
        contact.into_iter().for_each(|contact| body.system.set_contact(contact));
        report
    }

    fn take_failed_work(&mut self) -> StepReport {
        std::mem::take(&mut self.failed)
    }

    fn memory(&self) -> IntegratorMemory {
        let warm_start = self.warm_start.clone();
        IntegratorMemory { trials: self.trials, warm_start, ..IntegratorMemory::default() }
    }

    fn restore(&mut self, memory: IntegratorMemory) {
        (self.trials, self.warm_start) = (memory.trials, memory.warm_start);
    }

    fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(None)
    }
}

/// Returns an error if a term has no part in an incremental potential: its forces have neither an energy nor a
/// dissipation function.
fn check_terms(system: &System) -> Result<(), StepError> {
    let fits = |term: &dyn PlacedTerm| {
        let character = term.character();
        character.symmetric && (term.has_energy() || character.velocity_dependent)
    };
    match system.terms().find(|(term, _)| !fits(*term)) {
        Some((term, _)) => Err(StepError::NotSymmetric { term: term.name().to_owned() }),
        None => Ok(()),
    }
}

/// Returns the largest absolute component.
fn largest(vectors: &[Vector3<f64>]) -> f64 {
    vectors.as_flattened().iter().fold(0.0, |largest, component| component.abs().max(largest))
}
