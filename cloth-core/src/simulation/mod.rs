//! Steps a scene through time: cloth and hair, divided into islands that may sleep.

mod change;
mod collision;
mod deformed;
mod island;
mod obstacle_crossings;
mod open;
mod prescribed;
mod reading;
mod release;
mod saved;
mod sleep;
mod summary;
mod totals;

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use energy_dsl::Vector3;
use energy_solve::threads::in_pool;
use energy_solve::{Counts, EvaluationError, PlacedTerm, SystemError, index};

pub use deformed::MostDeformed;
pub use island::{Island, SavedIsland};
pub use open::{ControlError, Controls, LabelledForces, OwnElements, OwnForce, Snapshot};
pub use saved::{RestoreError, SavedCounts, SavedState};
pub use summary::{Summary, TermSummary};
pub use totals::Totals;

use crate::Body;
use crate::barrier::ContactError;
use crate::collision::{CollisionMesh, Crossing, Exclusions, crossings};
use crate::contact::Obstacle;
use crate::fabric::Locking;
use crate::integrator::{StepError, StepReport};
use crate::ledger::Ledger;
use crate::measure::StrainGauge;
use crate::mesh::TriangleMesh;
use crate::model::{Model, ModelError, MovingPin, Part, PartKind, PinnedVertices, TermLabel};
use crate::motion::Motion;
use crate::scene::{ContactChoice, Scene};
use collision::add_contact;
use open::Controlled;
use prescribed::Prescribed;
pub use release::Extension;
use release::Releases;
use sleep::StepContext;

/// A scene that cannot be set up, or a step that failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// The parts of the scene do not fit together.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Cloth that collides crosses itself at the start.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// The terms cannot be assembled into a system.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The initial state cannot be evaluated.
    #[error("at the start: {0}")]
    Start(#[from] EvaluationError),
    /// Pins cannot let go.
    #[error("cannot release pins at t = {time:.4} s: {source}")]
    Release {
        /// The time, in s.
        time: f64,
        /// Why the pins cannot be released.
        source: Box<SimulationError>,
    },
    /// A control does not fit the scene or the state.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A state cannot be restored.
    #[error(transparent)]
    Restore(#[from] RestoreError),
    /// A step failed.
    #[error(
        "step {step} (t = {time:.4} s){}: {source}{}",
        .deformed.as_ref().map(|element| format!(", before which {element}")).unwrap_or_default(),
        .source.advice().map(|advice| format!(". {advice}")).unwrap_or_default()
    )]
    Step {
        /// The step that failed, from 1.
        step: u64,
        /// The time at the end of that step, in s.
        time: f64,
        /// The most deformed element before the step; `None` if the scene has no triangle and no segment.
        deformed: Option<Box<MostDeformed>>,
        /// Why it failed.
        source: StepError,
    },
}

/// Fewer vertices are not worth a change to a thread of the pool.
const FEW: usize = 1000;

/// The state of a scene and its history so far.
///
/// Vertices that no force couples fall into separate [`Island`]s. Each island is stepped on its own and can sleep on
/// its own. The simulation also keeps positions and velocities of all vertices, in the numbering of the scene that
/// pins, frames and pictures use.
#[derive(Debug)]
pub struct Simulation {
    parts: Vec<Part>,
    triangles: Vec<[usize; 3]>,
    strands: Vec<Range<usize>>,
    obstacles: Vec<Obstacle>,
    motions: Vec<Motion>,
    /// The features of all parts, for the test for crossings.
    collision_mesh: CollisionMesh,
    /// The same with the cores of obstacles.
    obstacle_mesh: CollisionMesh,
    prescribed: Prescribed,
    /// Pairs of features that do not collide.
    exclusions: Exclusions,
    /// Estimates of locking, with the names of the garments.
    locking: Vec<(String, Locking)>,
    contact: ContactChoice,
    x: Vec<Vector3<f64>>,
    v: Vec<Vector3<f64>>,
    masses: Vec<f64>,
    pinned: Vec<bool>,
    pins: Vec<PinnedVertices>,
    /// The strain gauge of each garment.
    gauges: Vec<StrainGauge>,
    /// Accelerations of pinned vertices in the last step, in m/s²; zero before the first one.
    accelerations: Vec<Vector3<f64>>,
    /// Acceleration of gravity, in m/s².
    gravity: Vector3<f64>,
    /// Drag per mass, in 1/s.
    drag: f64,
    islands: Vec<Island>,
    labels: Vec<TermLabel>,
    may_sleep: bool,
    dt: f64,
    steps: u64,
    summary: Summary,
    ledger: Option<Ledger>,
    /// Evaluation counts per label up to the checkpoint that this simulation resumed from.
    earlier: Vec<Counts>,
    /// The pins that let go during the simulation; `None` if none does.
    releases: Option<Arc<Releases>>,
    /// The number of releases so far.
    released: usize,
    /// The limit of threads; `None` for one per core.
    threads: Option<usize>,
    /// Inputs that a program controls.
    controlled: Controlled,
}

impl Simulation {
    /// Creates a simulation of a scene, at time 0.
    ///
    /// # Errors
    /// Returns an error if a mesh, a fabric, a pin, a seam or an obstacle of the scene is invalid.
    pub fn new(scene: &Scene) -> Result<Self, SimulationError> {
        Self::extended(scene, None)
    }

    /// Creates a simulation of a scene, at time 0, whose model the extension has changed.
    ///
    /// # Errors
    /// Returns an error if [`Simulation::new`] would, or if the extended model is invalid.
    pub fn extended(scene: &Scene, extension: Option<&Extension>) -> Result<Self, SimulationError> {
        let mut model = Model::new(scene)?;
        extension.iter().for_each(|extend| extend(&mut model));
        let mut simulation = Self::assembled(scene, model)?;
        simulation.releases = Releases::of(scene, extension);
        simulation.released = simulation.releases.as_ref().map_or(0, |releases| releases.done_by(0.0));
        Ok(simulation)
    }

    /// Creates a simulation from the assembled model of a scene.
    fn assembled(scene: &Scene, mut model: Model) -> Result<Self, SimulationError> {
        let strands = model.strands().collect();
        let islands = create_islands(scene, &mut model)?;
        let summary = Summary::at_start(scene, &model, islands.len());
        let collision_mesh = collision::mesh_of(&model);
        let prescribed = Prescribed::new(&model.obstacles);
        let obstacle_mesh = collision_mesh.clone().with_obstacles(&prescribed.cores());
        let gauges = reading::gauges(scene, &model);
        let Model {
            parts, x, v, masses, triangles, pinned, pins, motions, labels, obstacles, exclusions, locking, ..
        } = model;
        let mut simulation = Self {
            parts,
            triangles,
            strands,
            obstacles,
            motions,
            collision_mesh,
            obstacle_mesh,
            prescribed,
            exclusions,
            locking,
            contact: scene.contact,
            accelerations: vec![[0.0; 3]; x.len()],
            pins,
            gauges,
            gravity: scene.gravity,
            drag: scene.drag,
            x,
            v,
            masses,
            pinned,
            islands,
            may_sleep: scene.sleep.is_some(),
            dt: scene.time_grid().step,
            steps: scene.steps(),
            summary,
            ledger: None,
            earlier: vec![Counts::default(); labels.len()],
            labels,
            releases: None,
            released: 0,
            threads: None,
            controlled: Controlled::default(),
        };
        simulation.warn_of_unstable_step()?;
        simulation.warn_of_vertices_inside_obstacles();
        Ok(simulation)
    }

    /// Limits the number of threads of each step; the default is one per core. Small islands use fewer.
    /// Results are bit-identical for every number of threads.
    #[must_use]
    pub fn with_threads(mut self, threads: usize) -> Self {
        self.set_threads(threads);
        self
    }

    /// Limits the number of threads of the next steps; see [`Simulation::with_threads`].
    pub fn set_threads(&mut self, threads: usize) {
        self.threads = Some(threads);
        self.islands.iter_mut().for_each(|island| island.body_mut().system.set_threads(threads));
    }

    /// The garments and hair of the scene.
    #[must_use]
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The rest mesh of a garment, by its index among the parts; `None` for hair.
    #[must_use]
    pub fn mesh(&self, part: usize) -> Option<&TriangleMesh> {
        match &self.parts.get(part)?.kind {
            PartKind::Cloth(mesh) => Some(mesh),
            PartKind::Hair { .. } => None,
        }
    }

    /// The triangles of all garments, as vertex indices.
    #[must_use]
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// The vertex range of each strand of hair.
    #[must_use]
    pub fn strands(&self) -> &[Range<usize>] {
        &self.strands
    }

    /// The obstacles of the scene.
    #[must_use]
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// Returns all edges of cloth and hair that touch or cross a triangle now, by an exact test. Pairs that the scene
    /// excludes do not count.
    #[must_use]
    pub fn crossings(&self) -> Vec<Crossing> {
        let mesh = &self.collision_mesh;
        let counts = |Crossing { edge, triangle }: &Crossing| {
            !self.exclusions.exclude(mesh, &edge.map(index), &triangle.map(index))
        };
        crossings(mesh, &self.x).into_iter().filter(counts).collect()
    }

    /// Counts the crossings now, of cloth and hair with themselves and with obstacles, and notes in the totals whether
    /// there are any. It takes about as long as a search for contact.
    pub fn check_crossings(&mut self) -> usize {
        let count = self.crossings().len() + self.obstacle_crossings();
        self.summary.totals.checked_frames += 1;
        self.summary.totals.crossed_frames += u64::from(count > 0);
        count
    }

    /// The current positions of all vertices, in m.
    #[must_use]
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.x
    }

    /// The current velocities of all vertices, in m/s. For a pinned vertex, the velocity of its pin.
    #[must_use]
    pub fn velocities(&self) -> &[Vector3<f64>] {
        &self.v
    }

    /// Returns the forces of certified contact on all vertices at the end of the last step, in N: those of barriers and
    /// of friction. Zero with other integrators and before the first step.
    #[must_use]
    pub fn contact_forces(&self) -> Vec<Vector3<f64>> {
        let mut forces = vec![[0.0; 3]; self.x.len()];
        self.islands.iter().for_each(|island| island.scatter_contact_forces(&mut forces));
        forces
    }

    /// The masses of all vertices, in kg.
    #[must_use]
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// Whether a vertex is pinned.
    #[must_use]
    pub fn is_pinned(&self, vertex: usize) -> bool {
        self.pinned[vertex]
    }

    /// The islands of the scene.
    #[must_use]
    pub fn islands(&self) -> &[Island] {
        &self.islands
    }

    /// The terms of all islands.
    pub fn terms(&self) -> impl Iterator<Item = &dyn PlacedTerm> {
        self.islands.iter().flat_map(|island| island.body().system.terms().map(|(term, _)| term))
    }

    /// Wakes the island of a vertex. Call this when an external force on the vertex begins, changes or ends.
    pub fn wake(&mut self, vertex: usize) {
        let island = self.islands.iter_mut().find(|island| island.vertices().contains(&vertex));
        island.into_iter().for_each(Island::wake);
    }

    /// The simulated time, in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.steps_done() as f64 * self.dt
    }

    /// The number of completed steps.
    #[must_use]
    pub fn steps_done(&self) -> u64 {
        self.summary.totals.steps
    }

    /// The number of steps of the whole scene.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Whether all steps are completed.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.steps_done() >= self.steps
    }

    /// Warnings about the scene, found during setup.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.summary.warnings
    }

    /// Returns an estimate, for each garment that has one, of how much its mesh stiffens folds.
    #[must_use]
    pub fn locking(&self) -> &[(String, Locking)] {
        &self.locking
    }

    /// Starts a ledger; every later step adds an entry.
    ///
    /// # Errors
    /// Returns an error if an energy is not finite.
    pub fn keep_ledger(&mut self) -> Result<(), EvaluationError> {
        let bodies: Vec<_> = self.islands.iter().map(|island| (island.body(), island.labels())).collect();
        let names: Vec<_> = self.labels.iter().map(|label| label.name.as_str()).collect();
        self.ledger = Some(Ledger::new(&bodies, &names, self.time())?);
        Ok(())
    }

    /// The ledger; `None` if none is kept.
    #[must_use]
    pub fn ledger(&self) -> Option<&Ledger> {
        self.ledger.as_ref()
    }

    /// Advances by one time step.
    ///
    /// # Errors
    /// Returns an error if an island cannot complete the step with finite numbers. The state is then unchanged.
    pub fn step(&mut self) -> Result<StepReport, SimulationError> {
        let start = Instant::now();
        let step = self.steps_done() + 1;
        self.release_pins(self.time())?;
        let threads = if self.x.len() < FEW { 1 } else { self.threads.unwrap_or(usize::MAX) };
        let stepped = in_pool(threads, || self.step_islands(step));
        let (report, slept) = stepped.map_err(|source| {
            self.roll_back();
            let deformed = deformed::most_deformed(&self.parts, &self.x, &source).map(Box::new);
            SimulationError::Step { step, time: step as f64 * self.dt, deformed, source }
        })?;
        self.summary.totals.add(&report, slept, start.elapsed());
        Ok(report)
    }

    /// Steps the islands that are awake and returns how many sleep. Positions, velocities and the ledger change only
    /// after every island has succeeded.
    fn step_islands(&mut self, step: u64) -> Result<(StepReport, u64), StepError> {
        let Self { islands, x, v, ledger, obstacles, summary, contact, accelerations, .. } = self;
        let context = StepContext::new(step, self.dt, &self.motions, obstacles, self.may_sleep);
        let (mut total, mut slept) = (StepReport::default(), 0);
        for (number, island) in islands.iter_mut().enumerate() {
            if island.sleeps_through(&context) {
                slept += 1;
                continue;
            }
            let account = ledger.as_ref().map(|ledger| ledger.account(number));
            let stepped = island.step(&context, account).map_err(|error| error.on_vertices(island.vertices()));
            let (report, account) = stepped?;
            total += report;
            ledger.iter_mut().zip(account).for_each(|(ledger, account)| ledger.note(number, account));
        }
        let started = Instant::now();
        for (number, island) in islands.iter_mut().enumerate().filter(|(_, island)| !island.is_asleep()) {
            if island.try_to_sleep(&context) {
                ledger.iter_mut().for_each(|ledger| ledger.note_sleep(number));
            }
            // Certified moves pass through nothing, and without contact nothing is meant to stop.
            let is_exempt = island.body().system.has_contact() || *contact == ContactChoice::Off;
            let passable = if is_exempt { &[] } else { &obstacles[..] };
            for obstacle in passable {
                let passage = obstacle.passages([context.time, context.end], island.moves(x));
                passage.into_iter().for_each(|passage| summary.totals.note(passage));
            }
            island.keep_step();
            island.note_accelerations(v, context.dt, accelerations);
            island.scatter(x, v);
        }
        ledger.iter_mut().for_each(|ledger| ledger.enter(context.end));
        total.phases.add_to_ledger(started.elapsed());
        Ok((total, slept))
    }

    /// Discards the changes of a failed step.
    fn roll_back(&mut self) {
        let Self { islands, x, v, ledger, .. } = self;
        for island in islands.iter_mut().filter(|island| !island.is_asleep()) {
            island.forget_step();
            island.gather(x, v);
        }
        ledger.iter_mut().for_each(Ledger::forget);
    }

    /// Evaluation counts per label, including those before a checkpoint.
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

    /// Warns if the time step exceeds the stability limit of any island.
    fn warn_of_unstable_step(&mut self) -> Result<(), EvaluationError> {
        let limits = self.islands.iter_mut().map(Island::stable_step).collect::<Result<Vec<_>, _>>()?;
        if let Some(limit) = limits.into_iter().flatten().reduce(f64::min)
            && self.dt > limit
        {
            self.summary.warnings.push(format!(
                "dt = {:.3e} s exceeds {limit:.3e} s, the estimated stability limit of {} here; the motion may blow up",
                self.dt, self.summary.integrator,
            ));
        }
        Ok(())
    }

    /// Warns of free vertices that start inside an obstacle.
    fn warn_of_vertices_inside_obstacles(&mut self) {
        let colliding = if self.contact == ContactChoice::Off { &[] } else { &self.obstacles[..] };
        for obstacle in colliding {
            let solid = obstacle.at(0.0);
            let inside = |body: &Body| {
                let free = body.system.dofs().free().iter();
                free.filter(|&&vertex| solid.signed_distance(body.x[vertex]) < 0.0).count()
            };
            let count: usize = self.islands.iter().map(|island| inside(island.body())).sum();
            if count > 0 {
                self.summary
                    .warnings
                    .push(format!("{count} vertices start inside {}; contact will throw them out", obstacle.name));
            }
        }
    }
}

/// Creates the islands of a model, with their moving pins, on all cores.
fn create_islands(scene: &Scene, model: &mut Model) -> Result<Vec<Island>, SimulationError> {
    let islands = std::mem::take(&mut model.islands).into_iter();
    let mut islands =
        islands.map(|island| Island::new(scene, model, island)).collect::<Result<Vec<_>, SystemError>>()?;
    let with_itself = scene.contact == ContactChoice::On;
    if scene.is_certified() && (with_itself || !model.obstacles.is_empty()) {
        for island in &mut islands {
            add_contact(island, model, with_itself, scene).map_err(|error| named(error, scene, model))?;
        }
    }
    distribute_moving_pins(&mut islands, model);
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    islands.iter_mut().for_each(|island| island.body_mut().system.set_threads(threads));
    Ok(islands)
}

/// Names the garments of an error at the start, and says whether a repair was tried.
fn named(error: ContactError, scene: &Scene, model: &Model) -> ContactError {
    let parts: Vec<_> = model.parts.iter().map(|part| (part.name.as_str(), part.vertices.clone())).collect();
    let error = error.among_parts(&parts);
    if scene.untangle { error.after_repair() } else { error }
}

/// Hands each moving pin to the island of its vertex.
fn distribute_moving_pins(islands: &mut [Island], model: &Model) {
    if model.moving.is_empty() {
        return;
    }
    // For each vertex of the scene: its island, and its index within the island.
    let mut homes = vec![(0, 0); model.x.len()];
    for (number, island) in islands.iter().enumerate() {
        island.vertices().iter().enumerate().for_each(|(local, &vertex)| homes[vertex] = (number, local));
    }
    for pin in &model.moving {
        let (island, vertex) = homes[pin.vertex];
        islands[island].add_moving_pin(MovingPin { vertex, ..pin.clone() });
    }
}
