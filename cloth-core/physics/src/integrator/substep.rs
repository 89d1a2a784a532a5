//! Implicit Euler from a state other than the body's. The midpoint rule, the trapezoidal rule and BDF2 reduce to it.

use energy_dsl::Vector3;
use serde::{Deserialize, Serialize};

use super::{Integrator, Newton, StepError, StepReport};
use crate::body::Body;

/// A starting state for implicit Euler.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Substep {
    /// Positions X, in m.
    pub x: Vec<Vector3<f64>>,
    /// Velocities V, in m/s.
    pub v: Vec<Vector3<f64>>,
}

impl Substep {
    /// Returns the body's own state.
    pub fn of(body: &Body) -> Self {
        Self { x: body.x.clone(), v: body.v.clone() }
    }
}

/// Solves x' = X + h v', v' = V + h M⁻¹ f(x', v'). On an error the body is reset to `before`.
pub(super) fn start_from(
    body: &mut Body,
    before: &Substep,
    from: &Substep,
    newton: &mut Newton,
    dt: f64,
) -> Result<StepReport, StepError> {
    body.x.clone_from(&from.x);
    body.v.clone_from(&from.v);
    let report = newton.step(body, dt);
    if report.is_err() {
        body.x.clone_from(&before.x);
        body.v.clone_from(&before.v);
    }
    report
}
