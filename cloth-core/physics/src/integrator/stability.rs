//! Stability limits of explicit steps.

use energy_solve::{Curvature, EvaluationError, LinearisationOptions, Weights};

use crate::body::Body;

/// Bounds on the rates of a body's motions about its state, x″ = −ω² x − d x′.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rates {
    /// ω², in 1/s².
    pub frequency_squared: f64,
    /// d, in 1/s.
    pub damping: f64,
}

impl Rates {
    /// Computes the largest absolute row sums of M⁻¹ ∂f/∂x and M⁻¹ ∂f/∂v (Gershgorin), which are slightly pessimistic.
    pub fn of(body: &mut Body) -> Result<Self, EvaluationError> {
        let frequency_squared = largest_row_sum(body, Weights { position: 1.0, velocity: 0.0 })?;
        let damping = if body.system.character().velocity_dependent {
            largest_row_sum(body, Weights { position: 0.0, velocity: 1.0 })?
        } else {
            0.0
        };
        Ok(Self { frequency_squared, damping })
    }

    /// The limit of symplectic Euler, 4/(d + √(d² + 4ω²)); `None` if every step is stable.
    pub fn symplectic_limit(self) -> Option<f64> {
        let rate = self.damping + (self.damping * self.damping + 4.0 * self.frequency_squared).sqrt();
        (rate > 0.0).then(|| 4.0 / rate)
    }
}

fn largest_row_sum(body: &mut Body, weights: Weights) -> Result<f64, EvaluationError> {
    let mut matrix = body.system.matrix();
    let state = energy_solve::State { x: &body.x, v: &body.v };
    let curvature = Curvature::Exact;
    let options = LinearisationOptions::new(weights, curvature);
    body.system.linearise(state, options, &mut matrix)?;
    let free = body.system.dofs().free();
    let sums = matrix.absolute_row_sums();
    let accelerations = sums.iter().zip(free).flat_map(|(sums, &vertex)| sums.map(|sum| sum / body.masses[vertex]));
    Ok(accelerations.fold(0.0, f64::max))
}
