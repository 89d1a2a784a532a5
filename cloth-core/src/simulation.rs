use std::time::Instant;

use energy_dsl::Vector3;
use energy_solve::{EvaluationError, State, System, SystemError};

use crate::body::Body;
use crate::fabric::{self, FabricError, Surroundings};
use crate::integrator::{Integrator, StepError};
use crate::mesh::TriangleMesh;
use crate::scene::{MeshSourceError, PinError, Scene, Shape, pinned_vertices};
use crate::summary::Summary;

/// A scene that cannot be set up or moved on.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// The mesh.
    #[error(transparent)]
    Mesh(#[from] MeshSourceError),
    /// The pins.
    #[error(transparent)]
    Pin(#[from] PinError),
    /// The fabric.
    #[error(transparent)]
    Fabric(#[from] FabricError),
    /// The sum of the terms.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The initial state.
    #[error("at the start: {0}")]
    Start(#[from] EvaluationError),
    /// A step.
    #[error("step {step} (t = {time:.4} s): {source}")]
    Step {
        /// The step that failed, from 1.
        step: u64,
        /// Where it would have led, in s.
        time: f64,
        /// What went wrong.
        source: StepError,
    },
}

/// A cloth, an integrator and what they did so far.
#[derive(Debug)]
pub struct Simulation {
    mesh: TriangleMesh,
    body: Body,
    integrator: Box<dyn Integrator>,
    dt: f64,
    steps: u64,
    summary: Summary,
}

impl Simulation {
    /// Sets a scene up, at rest.
    ///
    /// # Errors
    /// When the mesh, the pins or the fabric are unfit.
    pub fn new(scene: &Scene) -> Result<Self, SimulationError> {
        let Shape { mesh, start: x, springs } = scene.shape()?;
        let pinned = pinned_vertices(&scene.pins, &x)?;
        let surroundings = Surroundings { gravity: scene.gravity, drag: scene.drag };
        let garment = fabric::terms(&scene.fabric, &mesh, &springs, &surroundings)?;
        let system = System::new(garment.terms, &pinned)?;
        let mut body = Body { v: vec![[0.0; 3]; x.len()], x, masses: garment.masses, system };
        let integrator = scene.stepper();
        let mut summary = Summary { left_out: garment.left_out, integrator: integrator.name(), ..Summary::default() };
        summary.vertices = pinned.len();
        summary.pinned = pinned.iter().filter(|&&pinned| pinned).count();
        summary.triangles = mesh.triangles().len();
        summary.dt = scene.dt;
        if let Some(limit) = integrator.stable_step(&mut body)?
            && scene.dt > limit
        {
            summary.warnings.push(format!(
                "dt = {:.3e} s is above {limit:.3e} s, up to which {} is estimated to be stable here; the motion may blow up",
                scene.dt,
                integrator.name(),
            ));
        }
        Ok(Self { mesh, body, integrator, dt: scene.dt, steps: scene.steps(), summary })
    }

    /// The mesh at rest.
    #[must_use]
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The cloth as it is now.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Steps done.
    #[must_use]
    pub fn steps_done(&self) -> u64 {
        self.summary.steps
    }

    /// Steps of the whole scene.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Whether all steps are done.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.summary.steps >= self.steps
    }

    /// What should be known before it runs.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.summary.warnings
    }

    /// Advances by one step.
    ///
    /// # Errors
    /// When the step cannot be completed with finite numbers; the cloth is then left as it was.
    pub fn step(&mut self) -> Result<(), SimulationError> {
        let start = Instant::now();
        let step = self.summary.steps + 1;
        let report = self.integrator.step(&mut self.body, self.dt).map_err(|source| SimulationError::Step {
            step,
            time: step as f64 * self.dt,
            source,
        })?;
        self.summary.steps = step;
        self.summary.solves += report.solves;
        self.summary.iterations += report.iterations;
        self.summary.projected += u64::from(report.projected);
        self.summary.stepping_time += start.elapsed();
        Ok(())
    }

    /// What was done so far and the energies, forces and momenta now.
    ///
    /// # Errors
    /// When an energy is not finite.
    pub fn summary(&mut self) -> Result<Summary, EvaluationError> {
        let body = &mut self.body;
        let energies = body.system.energies(&body.x)?.into_iter().map(|term| term.energy).collect::<Vec<_>>();
        let force = body.system.forces(State { x: &body.x, v: &body.v })?;
        let mut summary = self.summary.clone();
        summary.terms = body
            .system
            .terms()
            .zip(energies)
            .map(|((term, counts), energy)| crate::summary::TermSummary {
                name: term.name().to_owned(),
                element: term.declaration().name,
                energy,
                counts,
            })
            .collect();
        summary.kinetic_energy = body.kinetic_energy();
        summary.momentum = body.momentum();
        summary.angular_momentum = body.angular_momentum();
        summary.pin_force = pin_force(body, &force);
        Ok(summary)
    }
}

/// The total force of the cloth on its pins, in N.
fn pin_force(body: &Body, force: &[Vector3<f64>]) -> Vector3<f64> {
    let mut total = [0.0; 3];
    for (vertex, force) in force.iter().enumerate() {
        if body.system.dofs().place(vertex).is_none() {
            (0..3).for_each(|axis| total[axis] += force[axis]);
        }
    }
    total
}
