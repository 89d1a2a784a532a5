use energy_solve::EvaluationError;

use super::substep::{Substep, start_from};
use super::{Integrator, IntegratorMemory, Newton, NewtonOptions, StepError, StepReport};
use crate::body::Body;

/// The implicit midpoint rule: x' = x + h ½(v + v'), v' = v + h M⁻¹ f(½(x + x'), ½(v + v')). Second order. Conserves
/// momentum and angular momentum exactly, and has no numerical damping.
///
/// The midpoint is half a step of implicit Euler, which [`Newton`] solves; the end of the step is the reflection of the
/// start at the midpoint. Without damping in the scene nothing comes to rest, and wrinkles that the step does not
/// resolve keep ringing.
#[derive(Clone, Debug)]
pub struct ImplicitMidpoint {
    newton: Newton,
}

impl Default for ImplicitMidpoint {
    fn default() -> Self {
        Self::with_options(super::second_order_tolerances())
    }
}

impl ImplicitMidpoint {
    /// Creates an integrator with these tolerances.
    #[must_use]
    pub fn with_options(options: NewtonOptions) -> Self {
        Self { newton: Newton::with_options(options) }
    }
}

impl Integrator for ImplicitMidpoint {
    fn name(&self) -> &'static str {
        "implicit-midpoint"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let start = Substep::of(body);
        let report = start_from(body, &start, &start, &mut self.newton, 0.5 * dt)?;
        for vertex in 0..body.x.len() {
            for axis in 0..3 {
                body.x[vertex][axis] = 2.0 * body.x[vertex][axis] - start.x[vertex][axis];
                body.v[vertex][axis] = 2.0 * body.v[vertex][axis] - start.v[vertex][axis];
            }
        }
        Ok(report)
    }

    fn memory(&self) -> IntegratorMemory {
        self.newton.memory()
    }

    fn restore(&mut self, memory: IntegratorMemory) {
        self.newton.restore(memory);
    }

    fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(None)
    }
}
