//! Time stepping, one scheme to a file.

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

/// A scheme that advances a body.
pub trait Integrator: std::fmt::Debug {
    /// What it is called in scenes.
    fn name(&self) -> &'static str;

    /// Advances the body by `dt`, in s: free vertices as forces will, pinned ones by `dt` times their velocities. On an error the body is left
    /// as it was.
    ///
    /// # Errors
    /// When the step cannot be completed with finite numbers.
    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError>;

    /// What it remembers of earlier steps, to go on with later.
    fn memory(&self) -> IntegratorMemory {
        IntegratorMemory::default()
    }

    /// Goes on with what another one remembered.
    fn restore(&mut self, _memory: IntegratorMemory) {}

    /// An estimate of the largest stable step, in s, at the body's state; `None` when any step is stable.
    ///
    /// # Errors
    /// When the body's forces are not finite.
    fn stable_step(&self, body: &mut Body) -> Result<Option<f64>, EvaluationError>;
}

/// What integrators remember of earlier steps beyond what can be had again from the body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IntegratorMemory {
    /// Of [`Bdf2`].
    pub(crate) last_step: Option<bdf2::History>,
    /// Of [`Adaptive`]: halvings of the step, and successes since the last change.
    pub(crate) adaptive: [u32; 2],
    /// Which linear solver is in use, and why.
    #[serde(default)]
    pub(crate) trial: trial::Trial,
    /// Where [`Newton`] begins the next step.
    #[serde(default)]
    pub(crate) warm_start: warm_start::WarmStart,
}

/// What a step took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// Linear systems solved.
    pub solves: u64,
    /// And by what, if they were symmetric.
    pub solved_by: SolvedBy,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Whether exact curvature turned out to be negative, and was projected; see [`ImplicitEuler`].
    pub projected: bool,
    /// How often a step of Newton's method was halved.
    pub halvings: u64,
    /// Steps that were rejected and tried again with a smaller size; see [`Adaptive`].
    pub rejected: u64,
    /// How long its parts took; measured by [`Newton`] only.
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
pub enum StepError {
    /// The forces could not be evaluated.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// A free vertex has neither mass nor stiffness.
    #[error(transparent)]
    Singular(#[from] energy_solve::SingularBlock),
    /// A matrix could not be factored.
    #[error(transparent)]
    Factor(#[from] energy_solve::CholeskyError),
    /// The linear solver gave up.
    #[error(
        "the linear solver stopped after {iterations} iterations: {stopped}; \
         residual {residual:.3e} of {target:.3e}, the worst at vertex {vertex}. Try a smaller dt"
    )]
    NotSolved {
        /// Iterations done.
        iterations: usize,
        /// Why it stopped.
        stopped: StopReason,
        /// The final residual.
        residual: f64,
        /// What was asked for.
        target: f64,
        /// The vertex with the largest entry of the residual.
        vertex: usize,
    },
    /// No step along the search direction lowers the energy.
    #[error(
        "no step along the direction of Newton iteration {iterations} lowers the energy (its linear system: {stopped}). Try a smaller dt"
    )]
    Stuck {
        /// Newton iterations done.
        iterations: u64,
        /// Why the linear solver stopped.
        stopped: StopReason,
    },
    /// Newton's method did not converge.
    #[error(
        "Newton's method did not converge in {iterations} iterations: the last changed a velocity by {change:.3e} m/s. Try a smaller dt"
    )]
    NotConverged {
        /// Iterations done.
        iterations: u64,
        /// The largest change of a velocity in the last, in m/s.
        change: f64,
    },
    /// A force that is no gradient, also not within a step.
    #[error(
        "{term}: its forces come from no energy that Newton's method could lower; use the integrator implicit-euler"
    )]
    NotSymmetric {
        /// The term's name.
        term: String,
    },
    /// An adaptive step that failed at every size.
    #[error("rejected down to a step of {dt:.3e} s: {reason}")]
    Hopeless {
        /// The smallest size tried, in s.
        dt: f64,
        /// Why it was rejected.
        reason: Box<StepError>,
    },
    /// The new state is infinite or NaN.
    #[error("vertex {vertex} would move to {position:?}. The step is unstable; try a smaller dt")]
    NonFinite {
        /// The vertex.
        vertex: usize,
        /// Where it would go, in m.
        position: [f64; 3],
    },
}

impl StepError {
    /// The same of a body whose vertices have these numbers in the whole.
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

/// The schemes on offer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// Linearised implicit Euler, one linear solve per step. The default.
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
    /// Explicit Euler as the mass–spring cloth model prints it, without the step in x' = x + v.
    ExplicitEulerAsPrinted,
}

impl Scheme {
    /// All.
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

    /// The integrator.
    #[must_use]
    pub fn integrator(self) -> Box<dyn Integrator> {
        self.with_options(Tolerances::default(), LinearSolverChoice::Auto)
    }

    /// The integrator with other tolerances and another linear solver, where it has some.
    #[must_use]
    pub fn with_options(self, tolerances: Tolerances, linear_solver: LinearSolverChoice) -> Box<dyn Integrator> {
        let of = |default: NewtonOptions| NewtonOptions { linear_solver, ..tolerances.of(default) };
        let (first, second) = (of(NewtonOptions::default()), of(second_order_tolerances()));
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

/// How exactly Newton's method solves a step. What is not given keeps the integrator's default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Tolerances {
    /// Done when an iteration changes no velocity by more, in m/s. Default 1e-4 for `newton`, 1e-7 for schemes of second order.
    #[serde(deserialize_with = "crate::bounded::some_positive")]
    pub velocity: Option<f64>,
    /// The residual of each linear system relative to its right-hand side. Default 0.01 for `newton`, 1e-3 for schemes of second order.
    #[serde(deserialize_with = "crate::bounded::some_positive")]
    pub linear: Option<f64>,
    /// A step fails after this many iterations. Default 100.
    pub iterations: Option<usize>,
}

impl Tolerances {
    fn of(self, default: NewtonOptions) -> NewtonOptions {
        NewtonOptions {
            velocity_tolerance: self.velocity.unwrap_or(default.velocity_tolerance),
            linear_tolerance: self.linear.unwrap_or(default.linear_tolerance),
            iteration_limit: self.iterations.unwrap_or(default.iteration_limit),
            ..default
        }
    }
}

/// Solved to 10⁻⁷ m/s, so that the solver's error lies below that of a scheme of second order.
fn second_order_tolerances() -> NewtonOptions {
    NewtonOptions { velocity_tolerance: 1e-7, linear_tolerance: 1e-3, ..NewtonOptions::default() }
}

/// v + h M⁻¹ f of the free vertices.
fn kicked(body: &Body, v: &[Vector3<f64>], force: &[Vector3<f64>], dt: f64) -> Vec<Vector3<f64>> {
    let one = |&vertex: &usize| -> Vector3<f64> {
        std::array::from_fn(|axis| v[vertex][axis] + dt / body.masses[vertex] * force[vertex][axis])
    };
    body.system.dofs().free().iter().map(one).collect()
}

/// Moves the free vertices with new velocities, x' = x + h v', unless a number is not finite.
fn advance(body: &mut Body, velocities: &[Vector3<f64>], dt: f64) -> Result<(), StepError> {
    place(body, velocities, dt, velocities)
}

/// Moves the free vertices by h u and gives them new velocities, unless a number is not finite.
fn place(body: &mut Body, u: &[Vector3<f64>], dt: f64, velocities: &[Vector3<f64>]) -> Result<(), StepError> {
    let free = body.system.dofs().free();
    let moved = |(&vertex, u): (&usize, &Vector3<f64>)| -> Vector3<f64> {
        std::array::from_fn(|axis| body.x[vertex][axis] + dt * u[axis])
    };
    let positions: Vec<Vector3<f64>> = free.iter().zip(u).map(moved).collect();
    if let Some(place) = positions.iter().position(|p| p.iter().any(|coordinate| !coordinate.is_finite())) {
        return Err(StepError::NonFinite { vertex: free[place], position: positions[place] });
    }
    // Those that are pinned go as they are told.
    body.x = moved_by_velocities(body, dt);
    for (place, &vertex) in body.system.dofs().free().iter().enumerate() {
        body.x[vertex] = positions[place];
        body.v[vertex] = velocities[place];
    }
    Ok(())
}

/// Nothing where positions are finite, but the sum or an element is not: a trial went where an energy has no value.
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
