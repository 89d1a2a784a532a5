use energy_dsl::Vector3;
use energy_solve::EvaluationError;
use serde::{Deserialize, Serialize};

use super::substep::{Substep, start_from};
use super::{
    ImplicitMidpoint, Integrator, IntegratorMemory, Newton, NewtonOptions, StepError, StepReport, moved_by_velocities,
};
use crate::body::Body;

/// The two-step backward differentiation formula (Curtiss and Hirschfelder 1952): with y = (x, v) and y₋ one step
/// earlier,
///
/// y' = (4 y − y₋)/3 + ⅔ h ẏ'.
///
/// Second order. Damps motions that the step does not resolve, and resolved ones much less than implicit Euler. It
/// equals implicit Euler with ⅔ of the step from (4 y − y₋)/3, which [`Newton`] solves. The first step, and every step
/// after a change of the step size or of the body from outside, is a step of the implicit midpoint rule.
#[derive(Clone, Debug)]
pub struct Bdf2 {
    newton: Newton,
    first: ImplicitMidpoint,
    history: Option<History>,
}

/// The last step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct History {
    dt: f64,
    before: Substep,
    after: Substep,
}

impl History {
    /// Whether the free vertices are still at the end of that step.
    fn leads_to(&self, body: &Body) -> bool {
        // The history of a damaged checkpoint may have other vertices.
        let states = [&self.before, &self.after];
        if states.into_iter().flat_map(|state| [&state.x, &state.v]).any(|vectors| vectors.len() != body.x.len()) {
            return false;
        }
        let same = |&vertex: &usize| self.after.x[vertex] == body.x[vertex] && self.after.v[vertex] == body.v[vertex];
        body.system.dofs().free().iter().all(same)
    }
}

impl Default for Bdf2 {
    fn default() -> Self {
        Self::with_options(super::second_order_tolerances())
    }
}

impl Bdf2 {
    /// Creates an integrator with these tolerances.
    #[must_use]
    pub fn with_options(options: NewtonOptions) -> Self {
        Self { newton: Newton::with_options(options), first: ImplicitMidpoint::with_options(options), history: None }
    }
}

impl Integrator for Bdf2 {
    fn name(&self) -> &'static str {
        "bdf2"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let here = Substep::of(body);
        let report = match self.history.take() {
            Some(history) if history.dt == dt && history.leads_to(body) => {
                let mut from = Substep {
                    x: extrapolated(&here.x, &history.before.x),
                    v: extrapolated(&here.v, &history.before.v),
                };
                // Pinned vertices move by their velocities: Newton's step will add the other two thirds.
                let third = moved_by_velocities(body, dt / 3.0);
                for vertex in (0..third.len()).filter(|&vertex| body.system.dofs().row(vertex).is_none()) {
                    (from.x[vertex], from.v[vertex]) = (third[vertex], here.v[vertex]);
                }
                start_from(body, &here, &from, &mut self.newton, 2.0 / 3.0 * dt)?
            }
            _ => {
                self.first.restore(self.newton.memory());
                let report = self.first.step(body, dt);
                self.newton.restore(self.first.memory());
                report?
            }
        };
        self.history = Some(History { dt, before: here, after: Substep::of(body) });
        Ok(report)
    }

    fn memory(&self) -> IntegratorMemory {
        IntegratorMemory { last_step: self.history.clone(), ..self.newton.memory() }
    }

    fn restore(&mut self, memory: IntegratorMemory) {
        self.history = memory.last_step.clone();
        self.newton.restore(memory);
    }

    fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(None)
    }
}

/// (4 y − y₋)/3, written so that points at rest stay bit-identical.
fn extrapolated(here: &[Vector3<f64>], before: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let one = |(y, last): (&Vector3<f64>, &Vector3<f64>)| -> Vector3<f64> {
        std::array::from_fn(|axis| y[axis] + (y[axis] - last[axis]) / 3.0)
    };
    here.iter().zip(before).map(one).collect()
}
