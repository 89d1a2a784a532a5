//! Time integration, one scheme per file.

mod adaptive;
mod bdf2;
mod contact_work;
mod error;
mod explicit_euler;
mod implicit_euler;
mod implicit_midpoint;
mod linear_solver;
mod newton;
mod projection;
mod scheme;
mod stability;
mod substep;
mod symplectic_euler;
mod trapezoid;
mod trial;
mod verlet;
mod warm_start;

use serde::{Deserialize, Serialize};

use energy_solve::EvaluationError;

pub use adaptive::Adaptive;
pub use bdf2::Bdf2;
pub use contact_work::ContactWork;
pub use error::{Rejection, StepError};
pub use explicit_euler::ExplicitEuler;
pub use implicit_euler::ImplicitEuler;
pub use implicit_midpoint::ImplicitMidpoint;
pub use linear_solver::{LinearSolverChoice, SolvedBy};
pub use newton::{Newton, NewtonOptions, Phases};
use scheme::second_order_tolerances;
pub use scheme::{Scheme, Tolerances};
pub use symplectic_euler::SymplecticEuler;
pub use trapezoid::Trapezoid;
pub use verlet::Verlet;

use energy_dsl::Vector3;

use crate::body::Body;

/// An integration scheme for a body.
pub trait Integrator: std::fmt::Debug + Send {
    /// The scheme's name in scene files.
    fn name(&self) -> &'static str;

    /// Advances the body by `dt`, in s. Free vertices follow the forces, pinned vertices move by `dt` times their
    /// velocities. On an error the body is unchanged.
    ///
    /// # Errors
    /// Returns an error if the step cannot be completed with finite numbers.
    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError>;

    /// Returns the work of the steps that failed since the last call. Default none: it is not counted.
    fn take_failed_work(&mut self) -> StepReport {
        StepReport::default()
    }

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
    pub(crate) trials: trial::Trials,
    /// Data for the first iterate of [`Newton`]'s next step.
    #[serde(default)]
    pub(crate) warm_start: warm_start::WarmStart,
}

/// The work that a step took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StepReport {
    /// Linear systems solved.
    pub solves: u64,
    /// Linear systems of local eliminations, which are not among [`StepReport::solves`].
    #[serde(default)]
    pub local_solves: u64,
    /// Vertices of these systems.
    #[serde(default)]
    pub local_vertices: u64,
    /// Solves of symmetric systems, by linear solver.
    pub solved_by: SolvedBy,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Whether an indefinite system made the step use projected Hessians; see [`ImplicitEuler`] and [`Newton`].
    pub projected: bool,
    /// Evaluations of the energy of all vertices by [`Newton`].
    #[serde(default)]
    pub energies: u64,
    /// Halvings by the line search of Newton's method.
    pub halvings: u64,
    /// Steps rejected and retried with a smaller size; see [`Adaptive`].
    pub rejected: u64,
    /// Work of certified contact.
    pub contact: ContactWork,
    /// Wall time by phase; only [`Newton`] measures it.
    pub phases: Phases,
}

impl std::ops::AddAssign for StepReport {
    fn add_assign(&mut self, other: Self) {
        self.solves += other.solves;
        self.local_solves += other.local_solves;
        self.local_vertices += other.local_vertices;
        self.solved_by += other.solved_by;
        self.iterations += other.iterations;
        self.projected |= other.projected;
        self.energies += other.energies;
        self.halvings += other.halvings;
        self.rejected += other.rejected;
        self.contact += other.contact;
        self.phases += other.phases;
    }
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
    if let Some(row) = positions.iter().position(|p| p.iter().any(|coordinate| !coordinate.is_finite())) {
        return Err(StepError::NonFinite { vertex: free[row], position: positions[row] });
    }
    body.x = moved_by_velocities(body, dt);
    for (row, &vertex) in body.system.dofs().free().iter().enumerate() {
        body.x[vertex] = positions[row];
        body.v[vertex] = velocities[row];
    }
    Ok(())
}

/// Maps non-finite energies and forces to `None`: a trial point lies outside an element's domain. Non-finite positions
/// stay an error.
pub fn if_finite<T>(evaluated: Result<T, EvaluationError>) -> Result<Option<T>, EvaluationError> {
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
