use energy_solve::{Curvature, EvaluationError, LinearisationOptions, Weights};

use super::{Integrator, StepError, StepReport, advance};
use crate::body::Body;

/// Symplectic (semi-implicit) Euler: v' = v + h M⁻¹ f(x, v), x' = x + h v'. First order; stable for small steps only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SymplecticEuler;

impl Integrator for SymplecticEuler {
    fn name(&self) -> &'static str {
        "symplectic-euler"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let force = body.system.forces(energy_solve::State { x: &body.x, v: &body.v })?;
        let kicked = |&vertex: &usize| -> [f64; 3] {
            std::array::from_fn(|axis| body.v[vertex][axis] + dt / body.masses[vertex] * force[vertex][axis])
        };
        let velocities: Vec<[f64; 3]> = body.system.dofs().free().iter().map(kicked).collect();
        advance(body, &velocities, dt)?;
        Ok(StepReport::default())
    }

    /// 4/(d + √(d² + 4ω²)), the limit of x″ = −ω²x − d x′, with ω² and d bounded by the largest absolute row sums of M⁻¹ ∂f/∂x and
    /// M⁻¹ ∂f/∂v (Gershgorin): a little pessimistic.
    fn stable_step(&self, body: &mut Body) -> Result<Option<f64>, EvaluationError> {
        let frequency_squared = largest_row_sum(body, Weights { position: 1.0, velocity: 0.0 })?;
        let damping = if body.system.character().velocity_dependent {
            largest_row_sum(body, Weights { position: 0.0, velocity: 1.0 })?
        } else {
            0.0
        };
        let rate = damping + (damping * damping + 4.0 * frequency_squared).sqrt();
        Ok((rate > 0.0).then(|| 4.0 / rate))
    }
}

fn largest_row_sum(body: &mut Body, weights: Weights) -> Result<f64, EvaluationError> {
    let mut matrix = body.system.matrix();
    let state = energy_solve::State { x: &body.x, v: &body.v };
    let curvature = Curvature::Exact;
    let options = LinearisationOptions { weights, curvature, stiffness_times_velocity: false };
    body.system.linearise(state, options, &mut matrix)?;
    let free = body.system.dofs().free();
    let sums = matrix.absolute_row_sums();
    let accelerations = sums.iter().zip(free).flat_map(|(sums, &vertex)| sums.map(|sum| sum / body.masses[vertex]));
    Ok(accelerations.fold(0.0, f64::max))
}
