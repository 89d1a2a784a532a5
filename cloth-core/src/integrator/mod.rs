//! Time stepping, one scheme to a file.

mod implicit_euler;
mod newton;
mod symplectic_euler;

use serde::Deserialize;

use energy_solve::{EvaluationError, StopReason};

pub use implicit_euler::ImplicitEuler;
pub use newton::{Newton, NewtonOptions, Phases};
pub use symplectic_euler::SymplecticEuler;

use crate::body::Body;

/// A scheme that advances a body.
pub trait Integrator: std::fmt::Debug {
    /// What it is called in scenes.
    fn name(&self) -> &'static str;

    /// Advances the body by `dt`, in s. On an error the body is left as it was.
    ///
    /// # Errors
    /// When the step cannot be completed with finite numbers.
    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError>;

    /// An estimate of the largest stable step, in s, at the body's state; `None` when any step is stable.
    ///
    /// # Errors
    /// When the body's forces are not finite.
    fn stable_step(&self, body: &mut Body) -> Result<Option<f64>, EvaluationError>;
}

/// What a step took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Linear systems solved.
    pub solves: u64,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Whether it was solved again with projected curvature; see [`ImplicitEuler`].
    pub projected: bool,
    /// How often a step of Newton's method was halved.
    pub halvings: u64,
    /// How long its parts took; measured by [`Newton`] only.
    pub phases: Phases,
}

impl std::ops::AddAssign for StepReport {
    fn add_assign(&mut self, other: Self) {
        self.solves += other.solves;
        self.iterations += other.iterations;
        self.projected |= other.projected;
        self.halvings += other.halvings;
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
    /// The new state is infinite or NaN.
    #[error("vertex {vertex} would move to {position:?}. The step is unstable; try a smaller dt")]
    NonFinite {
        /// The vertex.
        vertex: usize,
        /// Where it would go, in m.
        position: [f64; 3],
    },
}

/// The schemes on offer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// Linearised implicit Euler, one linear solve per step. The default.
    #[default]
    ImplicitEuler,
    /// Implicit Euler by Newton's method with line search.
    Newton,
    /// Symplectic Euler, explicit.
    SymplecticEuler,
}

impl Scheme {
    /// The integrator.
    #[must_use]
    pub fn integrator(self) -> Box<dyn Integrator> {
        match self {
            Self::ImplicitEuler => Box::new(ImplicitEuler::default()),
            Self::Newton => Box::new(Newton::default()),
            Self::SymplecticEuler => Box::new(SymplecticEuler),
        }
    }
}

/// Moves the free vertices with new velocities, x' = x + h v', unless a number is not finite.
fn advance(body: &mut Body, velocities: &[[f64; 3]], dt: f64) -> Result<(), StepError> {
    let free = body.system.dofs().free();
    let moved = |(&vertex, v): (&usize, &[f64; 3])| -> [f64; 3] {
        std::array::from_fn(|axis| body.x[vertex][axis] + dt * v[axis])
    };
    let positions: Vec<[f64; 3]> = free.iter().zip(velocities).map(moved).collect();
    if let Some(place) = positions.iter().position(|p| p.iter().any(|coordinate| !coordinate.is_finite())) {
        return Err(StepError::NonFinite { vertex: free[place], position: positions[place] });
    }
    for (place, &vertex) in free.iter().enumerate() {
        body.x[vertex] = positions[place];
        body.v[vertex] = velocities[place];
    }
    Ok(())
}
