use energy_solve::{EvaluationError, State};

use super::stability::Rates;
use super::{Integrator, StepError, StepReport, kicked, move_by};
use crate::body::Body;

/// Explicit Euler: x' = x + h v, v' = v + h M⁻¹ f(x, v). First order. Amplifies an undamped oscillation of frequency ω
/// by √(1 + h²ω²) per step: energy grows at every step size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExplicitEuler {
    as_printed: bool,
}

impl ExplicitEuler {
    /// The variant printed in the paper of the mass–spring cloth model, x' = x + v, which lacks the step size and is
    /// correct for h = 1 s only. Kept for comparison.
    #[must_use]
    pub fn as_printed() -> Self {
        Self { as_printed: true }
    }
}

impl Integrator for ExplicitEuler {
    fn name(&self) -> &'static str {
        if self.as_printed { "explicit-euler-as-printed" } else { "explicit-euler" }
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let force = body.system.forces(State { x: &body.x, v: &body.v })?;
        let step = if self.as_printed { 1.0 } else { dt };
        let before = body.system.dofs().gather(&body.v);
        let velocities = kicked(body, &body.v, &force, dt);
        move_by(body, &before, step, &velocities)?;
        Ok(StepReport::default())
    }

    /// min(d/ω², limit of symplectic Euler) for x″ = −ω²x − d x′; 0 without damping. Bounds on ω and d as for
    /// [`super::SymplecticEuler`]. If some motions are damped less than others, the true limit is smaller.
    fn stable_step(&self, body: &mut Body) -> Result<Option<f64>, EvaluationError> {
        let rates = Rates::of(body)?;
        let limit = |symplectic: f64| symplectic.min(rates.damping / rates.frequency_squared);
        Ok(rates.symplectic_limit().map(limit))
    }
}
