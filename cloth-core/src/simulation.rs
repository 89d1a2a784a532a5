use std::ops::Range;
use std::time::Instant;

use energy_dsl::Vector3;
use energy_solve::{EvaluationError, State, StepStart, System, SystemError};

use crate::body::Body;
use crate::checkpoint::{CheckpointError, SavedState};
use crate::contact::Obstacle;
use crate::integrator::{Integrator, StepError, StepReport};
use crate::ledger::Ledger;
use crate::motion::Motion;
use crate::scene::{Model, ModelError, MovingPin, Part, PartKind, Scene};
use crate::summary::Summary;

/// A scene that cannot be set up or moved on.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// Its parts.
    #[error(transparent)]
    Model(#[from] ModelError),
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

/// Cloth and hair, an integrator and what they did so far.
#[derive(Debug)]
pub struct Simulation {
    parts: Vec<Part>,
    triangles: Vec<[usize; 3]>,
    strands: Vec<Range<usize>>,
    obstacles: Vec<Obstacle>,
    moving: Vec<MovingPin>,
    motions: Vec<Motion>,
    body: Body,
    integrator: Box<dyn Integrator>,
    dt: f64,
    steps: u64,
    summary: Summary,
    ledger: Option<Ledger>,
    /// What the terms did in earlier runs that this one goes on with.
    earlier: Vec<energy_solve::Counts>,
}

impl Simulation {
    /// Sets a scene up.
    ///
    /// # Errors
    /// When a mesh, a pin, a seam or a fabric is unfit.
    pub fn new(scene: &Scene) -> Result<Self, SimulationError> {
        Self::of(scene, Model::new(scene)?)
    }

    /// Sets up what a scene was made into.
    pub(crate) fn of(scene: &Scene, model: Model) -> Result<Self, SimulationError> {
        let strands = model.strands().collect();
        let Model { parts, x, v, masses, triangles, pinned, moving, motions, terms, left_out, warnings, obstacles } =
            model;
        let system = System::new(terms, &pinned)?;
        let mut body = Body { v, x, masses, system };
        let integrator = scene.stepper();
        let mut summary =
            Summary { left_out, warnings, integrator: integrator.name().to_owned(), ..Summary::default() };
        summary.vertices = pinned.len();
        summary.pinned = pinned.iter().filter(|&&pinned| pinned).count();
        summary.triangles = triangles.len();
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
        let (dt, steps, earlier) = (scene.dt, scene.steps(), Vec::new());
        let (ledger, inside) = (None, inside_at_start(&obstacles, &body));
        summary.warnings.extend(inside);
        Ok(Self {
            parts,
            triangles,
            strands,
            obstacles,
            moving,
            motions,
            body,
            integrator,
            dt,
            steps,
            summary,
            ledger,
            earlier,
        })
    }

    /// Garments and hair.
    #[must_use]
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The mesh of a garment at rest, by its place among the parts; `None` for hair.
    #[must_use]
    pub fn mesh(&self, part: usize) -> Option<&crate::mesh::TriangleMesh> {
        match &self.parts.get(part)?.kind {
            PartKind::Cloth(mesh) => Some(mesh),
            PartKind::Hair { .. } => None,
        }
    }

    /// All triangles.
    #[must_use]
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// The vertices of each strand of hair.
    #[must_use]
    pub fn strands(&self) -> &[Range<usize>] {
        &self.strands
    }

    /// The solids.
    #[must_use]
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// The body as it is now.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The time simulated so far, in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.summary.steps as f64 * self.dt
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

    /// From now on every step is entered in a ledger.
    ///
    /// # Errors
    /// When an energy is not finite.
    pub fn keep_ledger(&mut self) -> Result<(), EvaluationError> {
        let time = self.time();
        self.ledger = Some(Ledger::new(&self.body, time)?);
        Ok(())
    }

    /// The ledger, if one is kept.
    #[must_use]
    pub fn ledger(&self) -> Option<&Ledger> {
        self.ledger.as_ref()
    }

    /// Advances by one step, and says what it took.
    ///
    /// # Errors
    /// When the step cannot be completed with finite numbers; the cloth is then left as it was.
    pub fn step(&mut self) -> Result<StepReport, SimulationError> {
        let start = Instant::now();
        let step = self.summary.steps + 1;
        let failed = |source| SimulationError::Step { step, time: step as f64 * self.dt, source };
        let time = self.time();
        let (body, ledger) = (&mut self.body, &mut self.ledger);
        for pin in &self.moving {
            let target = self.motions[pin.motion].pose(step as f64 * self.dt).applied(pin.drawn);
            let here = body.x[pin.vertex];
            body.v[pin.vertex] = std::array::from_fn(|axis| (target[axis] - here[axis]) / self.dt);
        }
        let begin = StepStart { time, dt: self.dt, state: State { x: &body.x, v: &body.v } };
        let system = &mut body.system;
        system.begin_step(begin).map_err(StepError::from).map_err(failed)?;
        let obstacles = &self.obstacles;
        let lifting = |body: &Body, at_end: bool| -> f64 {
            let one = |obstacle: &Obstacle| obstacle.power([time, time + self.dt], at_end, &body.masses, &body.x);
            obstacles.iter().map(one).sum()
        };
        if let Some(ledger) = ledger {
            ledger.begin(body, lifting(body, false));
        }
        let report = self.integrator.step(body, self.dt).map_err(failed)?;
        if let Some(ledger) = ledger {
            let entered = ledger.end(body, lifting(body, true), step as f64 * self.dt, self.dt);
            entered.map_err(StepError::from).map_err(failed)?;
        }
        self.summary.steps = step;
        self.summary.solves += report.solves;
        self.summary.iterations += report.iterations;
        self.summary.projected += u64::from(report.projected);
        self.summary.rejected += report.rejected;
        self.summary.phases += report.phases;
        self.summary.stepping_time += start.elapsed();
        Ok(report)
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
        let all = body.system.terms().zip(energies).enumerate();
        summary.terms = all
            .map(|(place, ((term, mut counts), energy))| {
                if let Some(earlier) = self.earlier.get(place) {
                    counts.value += earlier.value;
                    counts.gradient += earlier.gradient;
                    counts.hessian += earlier.hessian;
                }
                crate::summary::TermSummary {
                    name: term.name().to_owned(),
                    element: term.declaration().name.to_owned(),
                    energy,
                    counts,
                }
            })
            .collect();
        summary.kinetic_energy = body.kinetic_energy();
        summary.momentum = body.momentum();
        summary.angular_momentum = body.angular_momentum();
        summary.pin_force = pin_force(body, &force);
        let judgement = self.ledger.as_ref().and_then(|ledger| ledger.imbalance(&summary.integrator));
        summary.warnings.extend(judgement);
        Ok(summary)
    }

    /// Everything that the motion from here depends on.
    #[must_use]
    pub fn save(&self) -> SavedState {
        let counts = |(place, counts): (usize, energy_solve::Counts)| {
            let mut sum = counts;
            if let Some(earlier) = self.earlier.get(place) {
                sum.value += earlier.value;
                sum.gradient += earlier.gradient;
                sum.hessian += earlier.hessian;
            }
            sum
        };
        SavedState {
            masses_checksum: masses_checksum(&self.body),
            steps: self.summary.steps,
            x: self.body.x.clone(),
            v: self.body.v.clone(),
            integrator: self.integrator.memory(),
            ledger: self.ledger.clone(),
            solves: self.summary.solves,
            iterations: self.summary.iterations,
            projected: self.summary.projected,
            rejected: self.summary.rejected,
            stepping_time: self.summary.stepping_time,
            phases: self.summary.phases,
            counts: self
                .body
                .system
                .terms()
                .map(|(_, counts)| counts)
                .enumerate()
                .map(counts)
                .map(Into::into)
                .collect(),
        }
    }

    /// Goes on from a saved state of the same scene: as if there had been no interruption, bit by bit.
    ///
    /// # Errors
    /// When the state is of another scene.
    pub fn restore(&mut self, saved: SavedState) -> Result<(), CheckpointError> {
        let (expected, found) = (self.body.x.len(), saved.x.len());
        let terms = self.body.system.terms().count();
        let fits = expected == found && saved.v.len() == expected && saved.counts.len() == terms;
        if !fits || saved.masses_checksum != masses_checksum(&self.body) {
            return Err(CheckpointError::OtherScene { expected, found });
        }
        (self.body.x, self.body.v) = (saved.x, saved.v);
        self.integrator.restore(saved.integrator);
        self.ledger = saved.ledger;
        self.summary.steps = saved.steps;
        self.summary.solves = saved.solves;
        self.summary.iterations = saved.iterations;
        self.summary.projected = saved.projected;
        self.summary.rejected = saved.rejected;
        self.summary.stepping_time = saved.stepping_time;
        self.summary.phases = saved.phases;
        self.earlier = saved.counts.into_iter().map(Into::into).collect();
        // Solids are where they were at the end of the last step.
        let time = self.time() - self.dt;
        let body = &mut self.body;
        let last = StepStart { time, dt: self.dt, state: State { x: &body.x, v: &body.v } };
        body.system.begin_step(last).map_err(|source| CheckpointError::Unfit { source })
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

fn masses_checksum(body: &Body) -> u32 {
    let bytes: Vec<u8> = body.masses.iter().flat_map(|mass| mass.to_le_bytes()).collect();
    crc32fast::hash(&bytes)
}

/// Warnings of vertices that start inside a solid: they will be thrown out of it.
fn inside_at_start(obstacles: &[Obstacle], body: &Body) -> Vec<String> {
    let warning = |obstacle: &Obstacle| {
        let solid = obstacle.at(0.0);
        let inside = body.system.dofs().free().iter().filter(|&&vertex| solid.signed_distance(body.x[vertex]) < 0.0);
        let count = inside.count();
        let text = format!("{count} vertices start inside {}; they will be thrown out of it", obstacle.name);
        (count > 0).then_some(text)
    };
    obstacles.iter().filter_map(warning).collect()
}
