use energy_solve::EvaluationError;

use super::substep::{Substep, start_from};
use super::{Integrator, IntegratorMemory, Newton, NewtonOptions, StepError, StepReport};
use crate::body::Body;

/// The implicit midpoint rule: x' = x + h ½(v + v'), v' = v + h M⁻¹ f(½(x + x'), ½(v + v')). Second order; keeps momentum and
/// angular momentum exactly, and does not damp.
///
/// Its midpoint is what implicit Euler yields after half a step, found by [`Newton`] on the incremental potential; the end of the step lies
/// as far beyond it. So nothing tends to rest that is not damped, and wrinkles that are not resolved in time ring on.
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
    /// With other tolerances.
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
