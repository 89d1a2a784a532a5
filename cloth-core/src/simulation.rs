use std::ops::Range;
use std::time::Instant;

use energy_dsl::Vector3;
use energy_solve::{Counts, EvaluationError, PlacedTerm, State, SystemError};

use crate::body::Body;
use crate::checkpoint::{CheckpointError, SavedState};
use crate::contact::Obstacle;
use crate::integrator::{StepError, StepReport};
use crate::island::Island;
use crate::ledger::Ledger;
use crate::motion::Motion;
use crate::scene::{Model, ModelError, MovingPin, Part, PartKind, Scene, TermLabel};
use crate::sleep::Moment;
use crate::summary::{Summary, TermSummary};

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

/// Cloth and hair, and what they did so far.
///
/// What nothing couples falls into [`Island`]s, each stepped by itself and asleep by itself. Positions and velocities are kept for the whole, too, on the one
/// numbering that pins, frames and pictures use.
#[derive(Debug)]
pub struct Simulation {
    parts: Vec<Part>,
    triangles: Vec<[usize; 3]>,
    strands: Vec<Range<usize>>,
    obstacles: Vec<Obstacle>,
    motions: Vec<Motion>,
    x: Vec<Vector3<f64>>,
    v: Vec<Vector3<f64>>,
    masses: Vec<f64>,
    pinned: Vec<bool>,
    islands: Vec<Island>,
    labels: Vec<TermLabel>,
    may_sleep: bool,
    dt: f64,
    steps: u64,
    summary: Summary,
    ledger: Option<Ledger>,
    /// What the terms did in earlier runs that this one goes on with.
    earlier: Vec<Counts>,
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
    pub(crate) fn of(scene: &Scene, mut model: Model) -> Result<Self, SimulationError> {
        let strands = model.strands().collect();
        let islands = std::mem::take(&mut model.islands).into_iter();
        let mut islands = islands.map(|island| Island::new(scene, &model, island)).collect::<Result<Vec<_>, _>>()?;
        share_pins(&mut islands, &model);
        let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        islands.iter_mut().for_each(|island| island.body_mut().system.set_threads(threads));
        let Model { parts, x, v, masses, triangles, pinned, motions, labels, left_out, warnings, obstacles, .. } =
            model;
        let mut summary = Summary { left_out, warnings, dt: scene.dt, ..Summary::default() };
        summary.integrator = scene.stepper().name().to_owned();
        summary.vertices = pinned.len();
        summary.pinned = pinned.iter().filter(|&&pinned| pinned).count();
        summary.triangles = triangles.len();
        summary.islands = islands.len();
        let limits = islands.iter_mut().map(Island::stable_step).collect::<Result<Vec<_>, _>>()?;
        if let Some(limit) = limits.into_iter().flatten().reduce(f64::min)
            && scene.dt > limit
        {
            summary.warnings.push(format!(
                "dt = {:.3e} s is above {limit:.3e} s, up to which {} is estimated to be stable here; the motion may blow up",
                scene.dt, summary.integrator,
            ));
        }
        summary.warnings.extend(inside_at_start(&obstacles, &islands));
        let (dt, steps, may_sleep) = (scene.dt, scene.steps(), scene.sleep.is_some());
        let (ledger, earlier) = (None, vec![Counts::default(); labels.len()]);
        Ok(Self {
            parts,
            triangles,
            strands,
            obstacles,
            motions,
            x,
            v,
            masses,
            pinned,
            islands,
            labels,
            may_sleep,
            dt,
            steps,
            summary,
            ledger,
            earlier,
        })
    }

    /// From now on at most so many threads work on a step, as far as islands are large enough for it; before this is called, as many as the machine has.
    /// What they compute is the same, to the last bit, for any number.
    #[must_use]
    pub fn with_threads(mut self, threads: usize) -> Self {
        self.islands.iter_mut().for_each(|island| island.body_mut().system.set_threads(threads));
        self
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

    /// Where the vertices are now, in m.
    #[must_use]
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.x
    }

    /// Their velocities, in m/s; of pinned vertices those with which they are moved.
    #[must_use]
    pub fn velocities(&self) -> &[Vector3<f64>] {
        &self.v
    }

    /// Their masses, in kg.
    #[must_use]
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// Whether a vertex is pinned.
    #[must_use]
    pub fn is_pinned(&self, vertex: usize) -> bool {
        self.pinned[vertex]
    }

    /// What moves on its own.
    #[must_use]
    pub fn islands(&self) -> &[Island] {
        &self.islands
    }

    /// The terms of all islands.
    pub fn terms(&self) -> impl Iterator<Item = &dyn PlacedTerm> {
        self.islands.iter().flat_map(|island| island.body().system.terms().map(|(term, _)| term))
    }

    /// Wakes the island of a vertex: to be called when something outside the scene begins to act on it, acts otherwise or ceases to.
    pub fn wake(&mut self, vertex: usize) {
        let home = self.islands.iter_mut().find(|island| island.vertices().contains(&vertex));
        home.into_iter().for_each(Island::wake);
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
        self.ledger = Some(Ledger::new(&self.islands, &self.labels, self.time())?);
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
        let report = self.step_islands(step).map_err(|source| {
            let Self { islands, x, v, ledger, .. } = self;
            islands.iter_mut().filter(|island| !island.is_asleep()).for_each(|island| island.gather(x, v));
            ledger.iter_mut().for_each(Ledger::forget);
            SimulationError::Step { step, time: step as f64 * self.dt, source }
        })?;
        self.summary.steps = step;
        self.summary.solves += report.solves;
        self.summary.solved_by += report.solved_by;
        self.summary.iterations += report.iterations;
        self.summary.projected += u64::from(report.projected);
        self.summary.rejected += report.rejected;
        self.summary.phases += report.phases;
        self.summary.stepping_time += start.elapsed();
        Ok(report)
    }

    /// Steps the islands that are awake. Only when all have succeeded it is as if anything had happened.
    fn step_islands(&mut self, step: u64) -> Result<StepReport, StepError> {
        let Self { islands, x, v, ledger, .. } = self;
        let moment = Moment::new(step, self.dt, &self.motions, &self.obstacles, self.may_sleep);
        let (mut report, mut slept) = (StepReport::default(), 0);
        for (number, island) in islands.iter_mut().enumerate() {
            if island.sleeps_through(&moment) {
                slept += 1;
                continue;
            }
            let account = ledger.as_ref().map(|ledger| ledger.account(number));
            let stepped = island.step(&moment, account).map_err(|error| error.on_vertices(island.vertices()));
            let (one, account) = stepped?;
            report += one;
            ledger.iter_mut().zip(account).for_each(|(ledger, account)| ledger.note(number, account));
        }
        for (number, island) in islands.iter_mut().enumerate().filter(|(_, island)| !island.is_asleep()) {
            if island.may_fall_asleep(&moment) {
                ledger.iter_mut().for_each(|ledger| ledger.note_sleep(number));
            }
            island.scatter(x, v);
        }
        ledger.iter_mut().for_each(|ledger| ledger.enter(moment.end));
        self.summary.slept += slept;
        Ok(report)
    }

    /// What was evaluated for each label.
    fn counts(&self) -> Vec<Counts> {
        let mut all = self.earlier.clone();
        for island in &self.islands {
            for ((_, counts), &label) in island.body().system.terms().zip(island.labels()) {
                let sum = &mut all[label];
                sum.value += counts.value;
                sum.gradient += counts.gradient;
                sum.hessian += counts.hessian;
                sum.reused += counts.reused;
            }
        }
        all
    }

    /// What was done so far and the energies, forces and momenta now.
    ///
    /// # Errors
    /// When an energy is not finite.
    pub fn summary(&mut self) -> Result<Summary, EvaluationError> {
        let mut summary = self.summary.clone();
        let mut energies: Vec<Option<f64>> = vec![None; self.labels.len()];
        let mut elements = vec![0; self.labels.len()];
        let add = |sum: &mut Vector3<f64>, part: Vector3<f64>| (0..3).for_each(|axis| sum[axis] += part[axis]);
        for island in &mut self.islands {
            let labels = island.labels().to_vec();
            let body = island.body_mut();
            for (&label, term) in labels.iter().zip(body.system.energies(&body.x)?) {
                energies[label] = term.energy.map(|energy| energies[label].unwrap_or(0.0) + energy).or(energies[label]);
            }
            for (&label, (term, _)) in labels.iter().zip(body.system.terms()) {
                elements[label] += term.stencils().len();
            }
            let force = body.system.forces(State { x: &body.x, v: &body.v })?;
            summary.kinetic_energy += body.kinetic_energy();
            add(&mut summary.momentum, body.momentum());
            add(&mut summary.angular_momentum, body.angular_momentum());
            add(&mut summary.pin_force, pin_force(body, &force));
            summary.asleep += usize::from(island.is_asleep());
        }
        let all = self.counts().into_iter().enumerate();
        let term = |(number, counts): (usize, Counts)| {
            let TermLabel { name, element } = self.labels[number].clone();
            let (element, energy) = (element.to_owned(), energies[number]);
            TermSummary { name, element, elements: elements[number], energy, reused: counts.reused, counts }
        };
        summary.terms = all.map(term).collect();
        let judgement = self.ledger.as_ref().and_then(|ledger| ledger.imbalance(&summary.integrator));
        summary.warnings.extend(judgement);
        Ok(summary)
    }

    /// Everything that the motion from here depends on.
    #[must_use]
    pub fn save(&self) -> SavedState {
        SavedState {
            masses_checksum: masses_checksum(&self.masses),
            steps: self.summary.steps,
            x: self.x.clone(),
            v: self.v.clone(),
            islands: self.islands.iter().map(Island::save).collect(),
            ledger: self.ledger.clone(),
            solves: self.summary.solves,
            solved_by: self.summary.solved_by,
            iterations: self.summary.iterations,
            projected: self.summary.projected,
            rejected: self.summary.rejected,
            slept: self.summary.slept,
            stepping_time: self.summary.stepping_time,
            phases: self.summary.phases,
            reused: self.counts().iter().map(|counts| counts.reused).collect(),
            counts: self.counts().into_iter().map(Into::into).collect(),
        }
    }

    /// Goes on from a saved state of the same scene: as if there had been no interruption, bit by bit.
    ///
    /// # Errors
    /// When the state is of another scene.
    pub fn restore(&mut self, saved: SavedState) -> Result<(), CheckpointError> {
        let (expected, found) = (self.x.len(), saved.x.len());
        let sizes = [saved.v.len(), saved.islands.len(), saved.counts.len(), saved.reused.len()];
        let terms = self.labels.len();
        let fits = expected == found && sizes == [expected, self.islands.len(), terms, terms];
        if !fits || saved.masses_checksum != masses_checksum(&self.masses) {
            return Err(CheckpointError::OtherScene { expected, found });
        }
        (self.x, self.v) = (saved.x, saved.v);
        self.ledger = saved.ledger;
        self.summary.steps = saved.steps;
        self.summary.solves = saved.solves;
        self.summary.solved_by = saved.solved_by;
        self.summary.iterations = saved.iterations;
        self.summary.projected = saved.projected;
        self.summary.rejected = saved.rejected;
        self.summary.slept = saved.slept;
        self.summary.stepping_time = saved.stepping_time;
        self.summary.phases = saved.phases;
        let counts = saved.counts.into_iter().zip(saved.reused);
        self.earlier = counts.map(|(counts, reused)| Counts { reused, ..counts.into() }).collect();
        // Solids are where they were at the end of the last step.
        let (time, dt) = (self.time() - self.dt, self.dt);
        for (island, saved) in self.islands.iter_mut().zip(saved.islands) {
            island.restore(saved);
            island.gather(&self.x, &self.v);
            island.begin_step(time, dt).map_err(|source| CheckpointError::Unfit { source })?;
        }
        Ok(())
    }
}

/// Tells each island which of its pins move.
fn share_pins(islands: &mut [Island], model: &Model) {
    if model.moving.is_empty() {
        return;
    }
    let mut homes = vec![(0, 0); model.x.len()];
    for (number, island) in islands.iter().enumerate() {
        island.vertices().iter().enumerate().for_each(|(place, &vertex)| homes[vertex] = (number, place));
    }
    for pin in &model.moving {
        let (island, vertex) = homes[pin.vertex];
        islands[island].move_pin(MovingPin { vertex, ..pin.clone() });
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

fn masses_checksum(masses: &[f64]) -> u32 {
    let bytes: Vec<u8> = masses.iter().flat_map(|mass| mass.to_le_bytes()).collect();
    crc32fast::hash(&bytes)
}

/// Warnings of vertices that start inside a solid: they will be thrown out of it.
fn inside_at_start(obstacles: &[Obstacle], islands: &[Island]) -> Vec<String> {
    let warning = |obstacle: &Obstacle| {
        let solid = obstacle.at(0.0);
        let bodies = islands.iter().map(Island::body);
        let inside = |body: &&Body| {
            let free = body.system.dofs().free().iter();
            free.filter(|&&vertex| solid.signed_distance(body.x[vertex]) < 0.0).count()
        };
        let count: usize = bodies.map(|body| inside(&body)).sum();
        let text = format!("{count} vertices start inside {}; they will be thrown out of it", obstacle.name);
        (count > 0).then_some(text)
    };
    obstacles.iter().filter_map(warning).collect()
}
