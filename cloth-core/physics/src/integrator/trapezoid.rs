use energy_solve::{EvaluationError, State};

use super::substep::{Substep, start_from};
use super::{Integrator, IntegratorMemory, Newton, NewtonOptions, StepError, StepReport, moved_by_velocities};
use crate::body::Body;

/// The trapezoidal rule, equal to Newmark's method of average acceleration (β = ¼, γ = ½; Newmark 1959):
///
/// x' = x + ½ h (v + v'),  v' = v + ½ h M⁻¹ (f(x, v) + f(x', v')).
///
/// Second order, without numerical damping. It equals an explicit half step followed by an implicit half step, which
/// [`Newton`] solves.
#[derive(Clone, Debug)]
pub struct Trapezoid {
    newton: Newton,
}

impl Default for Trapezoid {
    fn default() -> Self {
        Self::with_options(super::second_order_tolerances())
    }
}

impl Trapezoid {
    /// Creates an integrator with these tolerances.
    #[must_use]
    pub fn with_options(options: NewtonOptions) -> Self {
        Self { newton: Newton::with_options(options) }
    }
}

impl Integrator for Trapezoid {
    fn name(&self) -> &'static str {
        "trapezoid"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let half = 0.5 * dt;
        let before = Substep::of(body);
        let force = body.system.forces(State { x: &body.x, v: &body.v })?;
        let mut from = Substep { x: moved_by_velocities(body, half), v: before.v.clone() };
        for &vertex in body.system.dofs().free() {
            let kick = half / body.masses[vertex];
            from.v[vertex] = std::array::from_fn(|axis| body.v[vertex][axis] + kick * force[vertex][axis]);
        }
        start_from(body, &before, &from, &mut self.newton, half)
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
