//! Time steps over mixed unknowns.

use super::error::MixedError;
use super::inertia::{self, Inertia, InertialPotential, mean_rates};
use super::newton::{MixedNewton, MixedNewtonError, MixedNewtonOptions, MixedNewtonReport};
use super::system::MixedSystem;
use crate::linear::KindSolver;

/// A rule of integration. Both are implicit and minimise the potential plus that of inertia.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MixedScheme {
    /// Implicit Euler: first order, damps motions faster than the step.
    #[default]
    ImplicitEuler,
    /// The implicit midpoint rule: second order, does not damp. Half a step of implicit Euler leads to the midpoint,
    /// and the same move again to the end.
    ImplicitMidpoint,
}

/// Unknowns and their rates.
#[derive(Clone, Debug, PartialEq)]
pub struct MixedState {
    /// The configuration: see [`MixedBody`](super::MixedBody).
    pub u: Vec<f64>,
    /// The rates of all unknowns, one number per increment: in m/s for points, in rad/s for angles; for rotations the
    /// angular velocity in space, in rad/s.
    pub rates: Vec<f64>,
}

impl MixedState {
    /// Creates a state at rest.
    #[must_use]
    pub fn at_rest(system: &MixedSystem, u: Vec<f64>) -> Self {
        Self { u, rates: vec![0.0; system.body().increments()] }
    }
}

/// Integrates the motion of a body with inertia under the potential of a system.
///
/// A step of implicit Euler minimises U(u) + Σ ½ m ‖x − x̃‖²/h² + Σ (2/h²) vᵀ J v. Free motion leads to x̃ = x + h ẋ
/// and q̃. J is the inertia tensor there, and v the vector part of q q̃⁻¹. Free motion keeps the angular momentum
/// (midpoint rule). The change of the momentum is the torque at the minimum times h, so that it is exact up to rounding
/// and the tolerance.
///
/// Unknowns without inertia, and shared ones, are in equilibrium with the others at the end of each step; with the
/// midpoint rule, at its middle.
///
/// ```
/// use energy_elements::Gravity;
/// use energy_solve::{
///     Inertia, KindSolver, MixedBody, MixedIntegrator, MixedNewtonOptions, MixedScheme, MixedState, MixedSystem,
///     MixedTerm, UnknownKind,
/// };
///
/// // A rigid body of 2 kg, an orientation and a centre, falls and spins about its second axis.
/// let body = MixedBody::new(&[UnknownKind::Rotation, UnknownKind::Vector3], 0.1);
/// let weight = MixedTerm::of_points("weight", vec![Gravity::new(2.0, [0.0, 0.0, -9.81])], &[[1]])?;
/// let system = MixedSystem::new(body, vec![weight])?;
/// let tensor = [[0.01, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.03]];
/// let inertia = vec![Inertia::Tensor(tensor), Inertia::Mass(2.0)];
/// let (scheme, options) = (MixedScheme::ImplicitMidpoint, MixedNewtonOptions::new(1e-12));
/// let mut integrator = MixedIntegrator::new(system, inertia, scheme, &KindSolver::Automatic, options)?;
/// let mut state = MixedState::at_rest(integrator.system(), vec![1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0]);
/// state.rates[1] = 3.0;
/// for _ in 0..100 {
///     integrator.step(&mut state, 0.01)?;
/// }
/// assert!((state.u[6] - (5.0 - 9.81 / 2.0)).abs() < 1e-9); // after 1 s
/// assert!((state.u[2].abs() - 1.5_f64.sin()).abs() < 1e-9); // turned by 3 rad about y
/// # Ok::<(), energy_solve::MixedNewtonError>(())
/// ```
#[derive(Debug)]
pub struct MixedIntegrator {
    system: MixedSystem,
    newton: MixedNewton,
    inertia: Vec<Inertia>,
    scheme: MixedScheme,
}

impl MixedIntegrator {
    /// Creates an integrator. Unknown i has `inertia[i]`.
    ///
    /// # Errors
    /// If an unknown has no inertia of its kind.
    pub fn new(
        system: MixedSystem,
        inertia: Vec<Inertia>,
        scheme: MixedScheme,
        solver: &KindSolver,
        options: MixedNewtonOptions,
    ) -> Result<Self, MixedError> {
        inertia::check(system.body(), &inertia)?;
        let newton = MixedNewton::new(&system, solver, options);
        Ok(Self { system, newton, inertia, scheme })
    }

    /// Returns the system.
    #[must_use]
    pub fn system(&self) -> &MixedSystem {
        &self.system
    }

    /// Returns the system for changes of its elements' states.
    pub fn system_mut(&mut self) -> &mut MixedSystem {
        &mut self.system
    }

    /// Advances a state by the time `h`, in s, and the states of the elements with it. If the step fails, nothing has
    /// changed: try a shorter one.
    ///
    /// # Errors
    /// If the state does not fit the body, `h` is not a positive number, Newton's method does not converge, or the next
    /// state of an element is not finite.
    pub fn step(&mut self, state: &mut MixedState, h: f64) -> Result<MixedNewtonReport, MixedNewtonError> {
        if !(h.is_finite() && h > 0.0) {
            return Err(MixedNewtonError::WrongTimeStep(h));
        }
        let body = self.system.body();
        body.check(&state.u)?;
        body.check_vector("rates", &state.rates, body.increments())?;
        self.system.set_time_step(h);
        let body = self.system.body();
        let (time, reference) = match self.scheme {
            MixedScheme::ImplicitEuler => (h, 0.5),
            MixedScheme::ImplicitMidpoint => (0.5 * h, 1.0),
        };
        let start = (&*state.u, &*state.rates);
        let inertial = InertialPotential::new(body, &self.inertia, start, time, reference);
        let (found, report) = self.newton.step(&mut self.system, &inertial, &state.u)?;
        if !report.converged() {
            return Err(MixedNewtonError::NotConverged(report));
        }
        let body = self.system.body();
        let end = match self.scheme {
            MixedScheme::ImplicitEuler => found.clone(),
            MixedScheme::ImplicitMidpoint => self.extrapolated(&state.u, &found),
        };
        let rates = inertial.rates_after(body, &self.inertia, start, (&found, &end), h);
        let after = MixedState { u: end, rates };
        self.system.advance(&after.u)?;
        *state = after;
        Ok(report)
    }

    /// Moves unknowns with inertia on from the middle of a step as far as they moved until there.
    fn extrapolated(&self, start: &[f64], middle: &[f64]) -> Vec<f64> {
        let body = self.system.body();
        let mut moves = mean_rates(body, start, middle, 1.0);
        for (index, unknown) in body.all().iter().enumerate() {
            if self.inertia.get(index).is_none_or(|inertia| *inertia == Inertia::None) {
                moves[unknown.increment..][..unknown.kind.increments()].fill(0.0);
            }
        }
        body.moved(middle, 1.0, &moves)
    }
}
