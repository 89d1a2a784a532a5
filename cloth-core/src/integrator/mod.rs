//! Time integration, one scheme per file.

mod adaptive;
mod bdf2;
mod explicit_euler;
mod implicit_euler;
mod implicit_midpoint;
mod linear_solver;
mod newton;
mod projection;
mod stability;
mod substep;
mod symplectic_euler;
mod trapezoid;
mod trial;
mod verlet;
mod warm_start;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use energy_solve::{EvaluationError, StopReason};

pub use adaptive::{Adaptive, Rejection};
pub use bdf2::Bdf2;
pub use explicit_euler::ExplicitEuler;
pub use implicit_euler::ImplicitEuler;
pub use implicit_midpoint::ImplicitMidpoint;
pub use linear_solver::{LinearSolverChoice, SolvedBy};
pub use newton::{Newton, NewtonOptions, Phases};
pub use symplectic_euler::SymplecticEuler;
pub use trapezoid::Trapezoid;
pub use verlet::Verlet;

use energy_dsl::Vector3;

use crate::body::Body;

/// An integration scheme for a body.
pub trait Integrator: std::fmt::Debug {
    /// The scheme's name in scene files.
    fn name(&self) -> &'static str;

    /// Advances the body by `dt`, in s. Free vertices follow the forces, pinned vertices move by `dt` times their
    /// velocities. On an error the body is unchanged.
    ///
    /// # Errors
    /// Returns an error if the step cannot be completed with finite numbers.
    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError>;

    /// Returns the history that later steps depend on, for a checkpoint.
    fn memory(&self) -> IntegratorMemory {
        IntegratorMemory::default()
    }

    /// Restores the history of a checkpoint.
    fn restore(&mut self, _memory: IntegratorMemory) {}

    /// Returns an estimate of the largest stable step at the body's state, in s; `None` if every step is stable.
    ///
    /// # Errors
    /// Returns an error if the body's forces are not finite.
    fn stable_step(&self, body: &mut Body) -> Result<Option<f64>, EvaluationError>;
}

/// The history of an integrator: everything that later steps depend on and the body does not hold.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IntegratorMemory {
    /// The last step of [`Bdf2`].
    pub(crate) last_step: Option<bdf2::History>,
    /// State of [`Adaptive`]: halvings of the step, and successes since the last change.
    pub(crate) adaptive: [u32; 2],
    /// The linear solver in use, and the iteration counts that led to it.
    #[serde(default)]
    pub(crate) trial: trial::Trial,
    /// Data for the first iterate of [`Newton`]'s next step.
    #[serde(default)]
    pub(crate) warm_start: warm_start::WarmStart,
}

/// The work that a step took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// Linear systems solved.
    pub solves: u64,
    /// Solves of symmetric systems, by linear solver.
    pub solved_by: SolvedBy,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Whether an indefinite system made the step use projected Hessians; see [`ImplicitEuler`] and [`Newton`].
    pub projected: bool,
    /// Halvings by the line search of Newton's method.
    pub halvings: u64,
    /// Steps rejected and retried with a smaller size; see [`Adaptive`].
    pub rejected: u64,
    /// Wall time by phase; only [`Newton`] measures it.
    pub phases: Phases,
}

impl std::ops::AddAssign for StepReport {
    fn add_assign(&mut self, other: Self) {
        self.solves += other.solves;
        self.solved_by += other.solved_by;
        self.iterations += other.iterations;
        self.projected |= other.projected;
        self.halvings += other.halvings;
        self.rejected += other.rejected;
        self.phases += other.phases;
    }
}

/// A step that failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum StepError {
    /// A force could not be evaluated.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// A free vertex has neither mass nor stiffness, so its diagonal block is singular.
    #[error(transparent)]
    Singular(#[from] energy_solve::SingularBlock),
    /// The factorisation of a matrix failed.
    #[error(transparent)]
    Factor(#[from] energy_solve::CholeskyError),
    /// The linear solver did not converge.
    #[error(
        "the linear solver stopped after {iterations} iterations: {stopped}; \
         residual {residual:.3e} of {target:.3e}, the worst at vertex {vertex}. Try a smaller dt"
    )]
    NotSolved {
        /// Iterations of the linear solver.
        iterations: usize,
        /// Why it stopped.
        stopped: StopReason,
        /// The final residual.
        residual: f64,
        /// The largest residual that counts as converged.
        target: f64,
        /// The vertex with the largest residual.
        vertex: usize,
    },
    /// The line search of Newton's method failed: no step along the direction lowers the energy.
    #[error(
        "no step along the direction of Newton iteration {iterations} lowers the energy \
         (its linear system: {stopped}). Try a smaller dt"
    )]
    Stuck {
        /// Newton iterations.
        iterations: u64,
        /// Why the linear solver stopped.
        stopped: StopReason,
    },
    /// Newton's method did not converge.
    #[error(
        "Newton's method did not converge in {iterations} iterations: \
         the last changed a velocity by {change:.3e} m/s. Try a smaller dt"
    )]
    NotConverged {
        /// Newton iterations.
        iterations: u64,
        /// The largest change of a velocity component in the last iteration, in m/s.
        change: f64,
    },
    /// A force has neither an energy nor a dissipation function, so Newton's method cannot minimise anything.
    #[error(
        "{term}: its forces come from no energy that Newton's method could lower; \
         use the integrator implicit-euler"
    )]
    NotSymmetric {
        /// The term's name.
        term: String,
    },
    /// An adaptive step failed at every size.
    #[error("rejected down to a step of {dt:.3e} s: {reason}")]
    Hopeless {
        /// The smallest size tried, in s.
        dt: f64,
        /// Why it was rejected at that size.
        reason: Box<StepError>,
    },
    /// The new state is infinite or NaN.
    #[error("vertex {vertex} would move to {position:?}. The step is unstable; try a smaller dt")]
    NonFinite {
        vertex: usize,
        /// The computed position, in m.
        position: [f64; 3],
    },
}

impl StepError {
    /// Renumbers the vertices in the error, from the numbering of a body to `vertices[…]` of the scene.
    #[must_use]
    pub(crate) fn on_vertices(self, vertices: &[usize]) -> Self {
        match self {
            Self::Evaluation(EvaluationError::NonFiniteState { what, vertex, value }) => {
                EvaluationError::NonFiniteState { what, vertex: vertices[vertex], value }.into()
            }
            Self::Evaluation(EvaluationError::NonFiniteElement { term, element, vertices: stencil, what }) => {
                let vertices = stencil.iter().map(|&vertex| vertices[vertex]).collect();
                EvaluationError::NonFiniteElement { term, element, vertices, what }.into()
            }
            Self::NotSolved { iterations, stopped, residual, target, vertex } => {
                Self::NotSolved { iterations, stopped, residual, target, vertex: vertices[vertex] }
            }
            Self::NonFinite { vertex, position } => Self::NonFinite { vertex: vertices[vertex], position },
            Self::Hopeless { dt, reason } => Self::Hopeless { dt, reason: Box::new(reason.on_vertices(vertices)) },
            other => other,
        }
    }
}

/// The built-in integrators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// Linearised implicit Euler, one linear solve per step (default).
    #[default]
    ImplicitEuler,
    /// Implicit Euler by Newton's method with line search.
    Newton,
    /// The two-step backward differentiation formula, implicit.
    Bdf2,
    /// The implicit midpoint rule.
    ImplicitMidpoint,
    /// The trapezoidal rule, implicit: Newmark's average acceleration.
    Trapezoid,
    /// Symplectic Euler, explicit.
    SymplecticEuler,
    /// Velocity Verlet, explicit.
    Verlet,
    /// Explicit Euler.
    ExplicitEuler,
    /// Explicit Euler as printed in the paper of the mass–spring cloth model, without the step size in x' = x + v.
    ExplicitEulerAsPrinted,
}

impl Scheme {
    /// All schemes, in the order of the documentation.
    pub const ALL: [Self; 9] = [
        Self::ImplicitEuler,
        Self::Newton,
        Self::Bdf2,
        Self::ImplicitMidpoint,
        Self::Trapezoid,
        Self::SymplecticEuler,
        Self::Verlet,
        Self::ExplicitEuler,
        Self::ExplicitEulerAsPrinted,
    ];

    /// Creates the integrator with default options.
    #[must_use]
    pub fn integrator(self) -> Box<dyn Integrator> {
        self.with_options(Tolerances::default(), LinearSolverChoice::Auto)
    }

    /// Creates the integrator with these tolerances and this linear solver, if it uses them.
    #[must_use]
    pub fn with_options(self, tolerances: Tolerances, linear_solver: LinearSolverChoice) -> Box<dyn Integrator> {
        let applied = |default: NewtonOptions| NewtonOptions { linear_solver, ..tolerances.applied(default) };
        let (first, second) = (applied(NewtonOptions::default()), applied(second_order_tolerances()));
        match self {
            Self::ImplicitEuler => Box::new(ImplicitEuler::solved_by(linear_solver)),
            Self::Newton => Box::new(Newton::with_options(first)),
            Self::Bdf2 => Box::new(Bdf2::with_options(second)),
            Self::ImplicitMidpoint => Box::new(ImplicitMidpoint::with_options(second)),
            Self::Trapezoid => Box::new(Trapezoid::with_options(second)),
            Self::SymplecticEuler => Box::new(SymplecticEuler),
            Self::Verlet => Box::new(Verlet::default()),
            Self::ExplicitEuler => Box::new(ExplicitEuler::default()),
            Self::ExplicitEulerAsPrinted => Box::new(ExplicitEuler::as_printed()),
        }
    }
}

/// Convergence criteria of Newton's method. Keys that are not given keep the integrator's default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Tolerances {
    /// A step converges once an iteration changes no velocity by more than this, in m/s. Default 1e-4 for `newton`,
    /// 1e-7 for schemes of second order.
    #[serde(deserialize_with = "crate::bounded::some_positive")]
    pub velocity: Option<f64>,
    /// Residual of each linear system relative to its right-hand side. Default 0.01 for `newton`, 1e-3 for schemes of
    /// second order.
    #[serde(deserialize_with = "crate::bounded::some_positive")]
    pub linear: Option<f64>,
    /// The largest number of iterations; a step that needs more fails. Default 100.
    pub iterations: Option<usize>,
}

impl Tolerances {
    fn applied(self, default: NewtonOptions) -> NewtonOptions {
        NewtonOptions {
            velocity_tolerance: self.velocity.unwrap_or(default.velocity_tolerance),
            linear_tolerance: self.linear.unwrap_or(default.linear_tolerance),
            iteration_limit: self.iterations.unwrap_or(default.iteration_limit),
            ..default
        }
    }
}

/// Tolerances for schemes of second order: 10⁻⁷ m/s keeps the solver's error below the scheme's.
fn second_order_tolerances() -> NewtonOptions {
    NewtonOptions { velocity_tolerance: 1e-7, linear_tolerance: 1e-3, ..NewtonOptions::default() }
}

/// Returns v + h M⁻¹ f of the free vertices.
fn kicked(body: &Body, v: &[Vector3<f64>], force: &[Vector3<f64>], dt: f64) -> Vec<Vector3<f64>> {
    let one = |&vertex: &usize| -> Vector3<f64> {
        std::array::from_fn(|axis| v[vertex][axis] + dt / body.masses[vertex] * force[vertex][axis])
    };
    body.system.dofs().free().iter().map(one).collect()
}

/// Moves the free vertices with new velocities, x' = x + h v'. Returns an error if a position is not finite.
fn advance(body: &mut Body, velocities: &[Vector3<f64>], dt: f64) -> Result<(), StepError> {
    move_by(body, velocities, dt, velocities)
}

/// Moves the free vertices by h u and sets their velocities. Returns an error if a position is not finite.
fn move_by(body: &mut Body, u: &[Vector3<f64>], dt: f64, velocities: &[Vector3<f64>]) -> Result<(), StepError> {
    let free = body.system.dofs().free();
    let moved = |(&vertex, u): (&usize, &Vector3<f64>)| -> Vector3<f64> {
        std::array::from_fn(|axis| body.x[vertex][axis] + dt * u[axis])
    };
    let positions: Vec<Vector3<f64>> = free.iter().zip(u).map(moved).collect();
    if let Some(place) = positions.iter().position(|p| p.iter().any(|coordinate| !coordinate.is_finite())) {
        return Err(StepError::NonFinite { vertex: free[place], position: positions[place] });
    }
    body.x = moved_by_velocities(body, dt);
    for (place, &vertex) in body.system.dofs().free().iter().enumerate() {
        body.x[vertex] = positions[place];
        body.v[vertex] = velocities[place];
    }
    Ok(())
}

/// Maps non-finite energies and forces to `None`: a trial point lies outside an element's domain. Non-finite positions
/// stay an error.
pub(crate) fn if_finite<T>(evaluated: Result<T, EvaluationError>) -> Result<Option<T>, EvaluationError> {
    match evaluated {
        Err(EvaluationError::NonFiniteElement { .. } | EvaluationError::NonFiniteSum { .. }) => Ok(None),
        evaluated => evaluated.map(Some),
    }
}

/// x + h v.
fn moved_by_velocities(body: &Body, dt: f64) -> Vec<Vector3<f64>> {
    body.x.iter().zip(&body.v).map(|(x, v)| moved_by_velocity(x, v, dt)).collect()
}

/// x + h v of one vertex.
fn moved_by_velocity(x: &Vector3<f64>, v: &Vector3<f64>, dt: f64) -> Vector3<f64> {
    std::array::from_fn(|axis| x[axis] + dt * v[axis])
}
