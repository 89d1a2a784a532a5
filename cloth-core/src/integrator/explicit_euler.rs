use energy_solve::{EvaluationError, State};

use super::stability::Rates;
use super::{Integrator, StepError, StepReport, kicked, place};
use crate::body::Body;

/// Explicit Euler: x' = x + h v, v' = v + h M⁻¹ f(x, v). First order. Each step multiplies an undamped oscillation ω by √(1 + h²ω²): it
/// gains energy at any step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExplicitEuler {
    as_printed: bool,
}

impl ExplicitEuler {
    /// As the mass–spring cloth model prints it, x' = x + v, where the step is missing: right for h = 1 s only. To compare with.
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
        let reach = if self.as_printed { 1.0 } else { dt };
        let before = body.system.dofs().gather(&body.v);
        let velocities = kicked(body, &body.v, &force, dt);
        place(body, &before, reach, &velocities)?;
        Ok(StepReport::default())
    }

    /// d/ω² of x″ = −ω²x − d x′, which is 0 without damping, at most what symplectic Euler allows; bounds as for
    /// [`super::SymplecticEuler`]. Where some motions are damped less than others the true limit is smaller.
    fn stable_step(&self, body: &mut Body) -> Result<Option<f64>, EvaluationError> {
        let rates = Rates::of(body)?;
        let limit = |symplectic: f64| symplectic.min(rates.damping / rates.frequency_squared);
        Ok(rates.symplectic_limit().map(limit))
    }
}
