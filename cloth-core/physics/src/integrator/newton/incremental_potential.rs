use std::borrow::Cow;
use std::time::Instant;

use energy_dsl::Vector3;
use energy_solve::threads::for_each;
use energy_solve::{
    BlockMatrix, ContactCounts, ContactStep, Curvature, EvaluationError, LinearisationOptions, Precision, Resistance,
    State, System, Weights,
};

use super::super::{StepReport, if_finite, moved_by_velocity};
use crate::body::Body;

/// Vertices that one thread takes at a time.
const PART: usize = 4096;

/// The incremental potential E of one step, and a record of its evaluations.
pub(super) struct IncrementalPotential<'a> {
    pub(super) body: &'a mut Body,
    /// Contact during the step; `None` if the body does not collide.
    pub(super) contact: Option<Box<dyn ContactStep + 'a>>,
    /// The resistance of the vertices at the first iterate; `None` before it was assembled.
    pub(super) resistance: Option<Resistance>,
    pub(super) dt: f64,
    pub(super) report: StepReport,
    /// Counts of contact before the step.
    pub(super) counted: ContactCounts,
}

/// E at one point.
#[derive(Clone, Copy)]
pub(super) struct Energy {
    /// E, infinite if an element's energy is.
    pub value: f64,
    /// Sum of the absolute values of its summands; bounds the rounding error.
    pub magnitude: f64,
}

/// E and −∇E at one point.
pub(super) struct EnergyAndGradient {
    pub energy: Energy,
    /// −∇E of the free vertices.
    pub downhill: Vec<Vector3<f64>>,
}

impl<'a> IncrementalPotential<'a> {
    pub(super) fn new(body: &'a mut Body, contact: Option<Box<dyn ContactStep + 'a>>, dt: f64) -> Self {
        let counted = contact.as_ref().map_or_else(ContactCounts::default, |contact| contact.counts());
        Self { body, contact, resistance: None, dt, report: StepReport::default(), counted }
    }

    /// x̂ of a vertex.
    pub(super) fn inertial(&self, vertex: usize) -> Vector3<f64> {
        moved_by_velocity(&self.body.x[vertex], &self.body.v[vertex], self.dt)
    }

    /// Evaluates E.
    pub(super) fn energy(&mut self, x: &[Vector3<f64>]) -> Result<Energy, EvaluationError> {
        let without = self.energy_without_contact(x)?;
        Ok(self.with_contact(without, x))
    }

    /// Evaluates E without contact: a lower bound, for contact only adds to it.
    pub(super) fn energy_without_contact(&mut self, x: &[Vector3<f64>]) -> Result<Energy, EvaluationError> {
        let started = Instant::now();
        self.report.energies += 1;
        let mut value = self.inertia(x);
        let mut magnitude = value;
        let Some(energies) = if_finite(self.body.system.energies(x))? else {
            return Ok(Energy { value: f64::INFINITY, magnitude: f64::INFINITY });
        };
        for energy in energies.iter().filter_map(|term| term.energy) {
            value += self.dt * self.dt * energy;
            magnitude += self.dt * self.dt * energy.abs();
        }
        if self.body.system.character().velocity_dependent {
            let v = velocities(x, &self.body.x, self.dt);
            let dissipation = self.body.system.dissipation(State { x, v: &v })?;
            value += self.dt.powi(3) * dissipation;
            magnitude += self.dt.powi(3) * dissipation.abs();
        }
        self.report.phases.line_search += started.elapsed();
        Ok(Energy { value, magnitude })
    }

    /// Returns ½ (x − x̂)ᵀ M (x − x̂).
    fn inertia(&self, x: &[Vector3<f64>]) -> f64 {
        let (Body { x: start, v, masses, system }, dt) = (&*self.body, self.dt);
        let of_part = |part: &[usize]| {
            let of_vertex = |&vertex: &usize| {
                let inertial = moved_by_velocity(&start[vertex], &v[vertex], dt);
                let away: Vector3<f64> = std::array::from_fn(|axis| x[vertex][axis] - inertial[axis]);
                0.5 * masses[vertex] * away.iter().map(|component| component * component).sum::<f64>()
            };
            part.iter().map(of_vertex).sum::<f64>()
        };
        for_each(system.threads(), system.dofs().free().chunks(PART).collect(), of_part).iter().sum()
    }

    /// Adds contact to E without it. x must be certified.
    pub(super) fn with_contact(&mut self, Energy { value, magnitude }: Energy, x: &[Vector3<f64>]) -> Energy {
        let started = Instant::now();
        let contact = self.contact_energy(x);
        self.report.phases.line_search += started.elapsed();
        Energy { value: value + contact, magnitude: magnitude + contact }
    }

    /// Assembles the Hessian M − h² ∂f/∂x − h ∂f/∂v and returns −∇E = M (x̂ − x) + h² f of the free vertices, both
    /// without contact: pairs may become active after this iterate was evaluated ahead.
    pub(super) fn linearise<T: Precision>(
        &mut self,
        x: &[Vector3<f64>],
        curvature: Curvature,
        matrix: &mut BlockMatrix<T>,
    ) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        let started = Instant::now();
        let Body { system, masses, x: start, v: before, .. } = &mut *self.body;
        let v = velocities_if_needed(system, before, || velocities(x, start, self.dt));
        let weights = Weights { position: -self.dt * self.dt, velocity: -self.dt };
        let options = LinearisationOptions::new(weights, curvature);
        let linear = system.linearise_with_masses(State { x, v: &v }, options, masses, matrix)?;
        let downhill = self.downhill(x, linear.force);
        self.report.phases.assembly += started.elapsed();
        Ok(downhill)
    }

    /// Assembles the Hessian and returns E and −∇E, the latter without contact; `None` if they are not finite. Contact
    /// begins here: the Hessian tells how stiff its barriers must be.
    pub(super) fn linearise_if_finite(
        &mut self,
        x: &[Vector3<f64>],
        curvature: Curvature,
        matrix: &mut BlockMatrix<f32>,
    ) -> Result<Option<EnergyAndGradient>, EvaluationError> {
        let Some(downhill) = if_finite(self.linearise(x, curvature, matrix))? else { return Ok(None) };
        self.begin_contact(x, matrix);
        let energy = self.energy(x)?;
        Ok(energy.value.is_finite().then_some(EnergyAndGradient { energy, downhill }))
    }

    /// Returns −∇E without contact.
    pub(super) fn gradient(&mut self, x: &[Vector3<f64>]) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        let started = Instant::now();
        let Body { system, x: start, v: before, .. } = &mut *self.body;
        let v = velocities_if_needed(system, before, || velocities(x, start, self.dt));
        let force = system.forces(State { x, v: &v })?;
        let downhill = self.downhill(x, force);
        self.report.phases.assembly += started.elapsed();
        Ok(downhill)
    }

    /// Returns ∇E of all vertices, with contact. Pinned vertices have no inertia.
    pub(super) fn whole_gradient(&mut self, x: &[Vector3<f64>]) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        let started = Instant::now();
        let Body { system, x: start, v: before, .. } = &mut *self.body;
        let v = velocities_if_needed(system, before, || velocities(x, start, self.dt));
        let mut gradient = system.forces(State { x, v: &v })?;
        if let Some(contact) = &self.contact {
            contact.add_force(x, &mut gradient);
        }
        gradient.iter_mut().flatten().for_each(|component| *component *= -self.dt * self.dt);
        for &vertex in self.body.system.dofs().free() {
            let (mass, inertial) = (self.body.masses[vertex], self.inertial(vertex));
            for axis in 0..3 {
                gradient[vertex][axis] += mass * (x[vertex][axis] - inertial[axis]);
            }
        }
        self.report.phases.assembly += started.elapsed();
        Ok(gradient)
    }

    /// Returns M (x̂ − x) + h² f of the free vertices, in place of the forces on all vertices.
    fn downhill(&self, x: &[Vector3<f64>], mut force: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
        let free = self.body.system.dofs().free();
        // Free vertices ascend, so row ≤ vertex: no force is overwritten before it is read.
        for (row, &vertex) in free.iter().enumerate() {
            let (mass, inertial, pull) = (self.body.masses[vertex], self.inertial(vertex), force[vertex]);
            force[row] =
                std::array::from_fn(|axis| mass * (inertial[axis] - x[vertex][axis]) + self.dt * self.dt * pull[axis]);
        }
        force.truncate(free.len());
        force
    }

    /// Returns x + s d on the free vertices.
    pub(super) fn moved(&self, x: &[Vector3<f64>], scale: f64, direction: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut moved = x.to_vec();
        self.advance(&mut moved, scale, direction);
        moved
    }

    /// x ← x + s d on the free vertices.
    pub(super) fn advance(&self, x: &mut [Vector3<f64>], scale: f64, direction: &[Vector3<f64>]) {
        for (&vertex, d) in self.body.system.dofs().free().iter().zip(direction) {
            for axis in 0..3 {
                x[vertex][axis] += scale * d[axis];
            }
        }
    }
}

/// v = (x − x₀)/h.
pub(super) fn velocities(x: &[Vector3<f64>], start: &[Vector3<f64>], dt: f64) -> Vec<Vector3<f64>> {
    let velocity = |(x, start): (&Vector3<f64>, &Vector3<f64>)| -> Vector3<f64> {
        std::array::from_fn(|axis| (x[axis] - start[axis]) / dt)
    };
    x.iter().zip(start).map(velocity).collect()
}

/// Computes the velocities if a force depends on them. Otherwise returns those before the step, which are never read.
fn velocities_if_needed<'a>(
    system: &System,
    before: &'a [Vector3<f64>],
    velocities: impl FnOnce() -> Vec<Vector3<f64>>,
) -> Cow<'a, [Vector3<f64>]> {
    if system.character().velocity_dependent { velocities().into() } else { before.into() }
}
