use energy_solve::EvaluationError;

use super::stability::Rates;
use super::{Integrator, StepError, StepReport, advance, kicked};
use crate::body::Body;

/// Symplectic (semi-implicit) Euler: v' = v + h M⁻¹ f(x, v), x' = x + h v'. First order, stable for small steps only.
/// Conserves momentum and angular momentum without damping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SymplecticEuler;

impl Integrator for SymplecticEuler {
    fn name(&self) -> &'static str {
        "symplectic-euler"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let force = body.system.forces(energy_solve::State { x: &body.x, v: &body.v })?;
        let velocities = kicked(body, &body.v, &force, dt);
        advance(body, &velocities, dt)?;
        Ok(StepReport::default())
    }

    /// 4/(d + √(d² + 4ω²)), the limit of x″ = −ω²x − d x′. The largest absolute row sums of M⁻¹ ∂f/∂x and M⁻¹ ∂f/∂v
    /// (Gershgorin) bound ω² and d, so the estimate is slightly pessimistic.
    fn stable_step(&self, body: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(Rates::of(body)?.symplectic_limit())
    }
}
