use energy_dsl::Vector3;
use energy_solve::EvaluationError;

use super::substep::{Substep, start_from};
use super::{ImplicitMidpoint, Integrator, Newton, NewtonOptions, StepError, StepReport};
use crate::body::Body;

/// The backward differentiation formula of two steps (Curtiss and Hirschfelder 1952): with y = (x, v) and y₋ that of the step before,
///
/// y' = (4 y − y₋)/3 + ⅔ h ẏ'.
///
/// Second order; it damps what it does not resolve in time, much less than implicit Euler what it does. It is implicit Euler with ⅔ of the
/// step from (4 y − y₋)/3, found by [`Newton`] on the incremental potential. The first step, and any after the step size or the body was
/// changed from outside, is one of the midpoint rule.
#[derive(Clone, Debug)]
pub struct Bdf2 {
    newton: Newton,
    first: ImplicitMidpoint,
    history: Option<History>,
}

/// The last step.
#[derive(Clone, Debug)]
struct History {
    dt: f64,
    before: Substep,
    after: Substep,
}

impl Default for Bdf2 {
    fn default() -> Self {
        Self::with_options(super::second_order_tolerances())
    }
}

impl Bdf2 {
    /// With other tolerances.
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
            Some(history) if history.dt == dt && history.after == here => {
                let from = Substep {
                    x: extrapolated(&here.x, &history.before.x),
                    v: extrapolated(&here.v, &history.before.v),
                };
                start_from(body, &here, &from, &mut self.newton, 2.0 / 3.0 * dt)?
            }
            _ => self.first.step(body, dt)?,
        };
        self.history = Some(History { dt, before: here, after: Substep::of(body) });
        Ok(report)
    }

    fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(None)
    }
}

/// (4 y − y₋)/3, written so that what does not move stays where it is to the last bit.
fn extrapolated(here: &[Vector3<f64>], before: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let one = |(y, last): (&Vector3<f64>, &Vector3<f64>)| -> Vector3<f64> {
        std::array::from_fn(|axis| y[axis] + (y[axis] - last[axis]) / 3.0)
    };
    here.iter().zip(before).map(one).collect()
}
