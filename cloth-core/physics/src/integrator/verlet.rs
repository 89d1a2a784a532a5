use energy_dsl::Vector3;
use energy_solve::{EvaluationError, State};

use super::stability::Rates;
use super::{Integrator, StepError, StepReport, kicked, move_by};
use crate::body::Body;

/// Velocity Verlet (Swope, Andersen, Berens and Wilson 1982):
///
/// v½ = v + ½ h M⁻¹ f(x, v),  x' = x + h v½,  v' = v½ + ½ h M⁻¹ f(x', v + h M⁻¹ f(x, v)). Second order, stable for
/// small steps only. Without damping it is symplectic, conserves momentum and angular momentum, and evaluates the
/// forces once per step, because the forces at the end are those at the start of the next step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verlet {
    last: Option<Forces>,
}

/// Forces that depend on positions only, with the positions of their evaluation.
#[derive(Clone, Debug, PartialEq)]
struct Forces {
    x: Vec<Vector3<f64>>,
    force: Vec<Vector3<f64>>,
}

impl Integrator for Verlet {
    fn name(&self) -> &'static str {
        "verlet"
    }

    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let damped = body.system.character().velocity_dependent;
        let force = match self.last.take() {
            Some(last) if !damped && last.x == body.x => last.force,
            _ => body.system.forces(State { x: &body.x, v: &body.v })?,
        };
        let (x, v) = (body.x.clone(), body.v.clone());
        let half = kicked(body, &v, &force, 0.5 * dt);
        let predicted = if damped { kicked(body, &v, &force, dt) } else { half.clone() };
        move_by(body, &half, dt, &predicted)?;
        let force = match body.system.forces(State { x: &body.x, v: &body.v }) {
            Ok(force) => force,
            Err(error) => {
                (body.x, body.v) = (x, v);
                return Err(error.into());
            }
        };
        for (at, &vertex) in body.system.dofs().free().iter().enumerate() {
            let kick = 0.5 * dt / body.masses[vertex];
            body.v[vertex] = std::array::from_fn(|axis| half[at][axis] + kick * force[vertex][axis]);
        }
        self.last = (!damped).then(|| Forces { x: body.x.clone(), force });
        Ok(StepReport::default())
    }

    /// The limit of [`super::SymplecticEuler`].
    fn stable_step(&self, body: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(Rates::of(body)?.symplectic_limit())
    }
}
