use std::collections::BTreeMap;
use std::time::Instant;

use energy_dsl::{Element, Vector3};
use energy_elements::WindDrag;
use energy_solve::{ContactMemory, EvaluationError, PlacedTerm, State, StepStart, System, SystemError};
use serde::{Deserialize, Serialize};

use super::prescribed::Prescribed;
use super::sleep::{BoundingSphere, SleepState, StepContext, Stillness};
use crate::Body;
use crate::contact::Obstacle;
use crate::integrator::{Integrator, IntegratorMemory, StepError, StepReport};
use crate::ledger::{Account, DrivenEnergies};
use crate::model::{IslandModel, Model, MovingPin};
use crate::scene::Scene;
use cloth_physics::bounded::SPEED_OF_LIGHT;

/// A set of vertices that no force couples to the others. It moves on its own, and can sleep while others move.
#[derive(Debug)]
pub struct Island {
    vertices: Vec<usize>,
    labels: Vec<usize>,
    /// The vertices of the island, then those of obstacles, if contact is certified.
    body: Body,
    /// The vertices of obstacles in the body.
    prescribed: Prescribed,
    integrator: Box<dyn Integrator>,
    /// Pinned vertices that move, with indices within the island.
    moving: Vec<MovingPin>,
    /// Indices of the motions of these pins, without duplicates.
    motions: Vec<usize>,
    /// Pinned vertices that a program moves, with indices within the island, and their targets in m.
    targets: Vec<(usize, Vector3<f64>)>,
    /// Whether wind with gusts acts on the island; it then never sleeps.
    in_gusts: bool,
    /// `None` if islands never sleep.
    stillness: Option<Stillness>,
    sleep: SleepState,
    /// Histories of the terms at the start of the current step; empty between steps.
    histories: Vec<Vec<f64>>,
    /// Energy of contact at the end of the last step, in J. Its pairs are forgotten when a step fails, and no
    /// checkpoint has them.
    contact_energy: f64,
}

/// The state of an island that its motion depends on, other than positions and velocities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedIsland {
    integrator: IntegratorMemory,
    #[serde(rename = "rest")]
    sleep: SleepState,
    /// The bristles of friction in certified contact: names of pairs, and their vectors.
    #[serde(default)]
    bristles: (Vec<[u32; 3]>, Vec<[Vector3<f64>; 2]>),
    /// The histories of the terms, such as plastic strains.
    #[serde(default)]
    histories: Vec<Vec<f64>>,
    /// Energy of contact at the end of the last step, in J.
    #[serde(default)]
    contact_energy: f64,
}

impl SavedIsland {
    /// Forgets the history of the integrator, which depends on the size of its steps.
    pub(super) fn forget_integrator(&mut self) {
        self.integrator = IntegratorMemory::default();
    }

    /// Forgets what depends on the way to the current positions: the history of the integrator, sleep, and how far
    /// pairs have slid. Plastic strains stay.
    pub(super) fn forget_motion(&mut self) {
        (self.integrator, self.sleep) = (IntegratorMemory::default(), SleepState::AWAKE);
        (self.bristles, self.contact_energy) = Default::default();
    }
}

impl Island {
    /// Creates an island of the model, awake.
    pub(super) fn new(scene: &Scene, model: &Model, island: IslandModel) -> Result<Self, SystemError> {
        let IslandModel { vertices, terms, labels } = island;
        let gather =
            |all: &[Vector3<f64>]| -> Vec<Vector3<f64>> { vertices.iter().map(|&vertex| all[vertex]).collect() };
        let mut pinned: Vec<bool> = vertices.iter().map(|&vertex| model.pinned[vertex]).collect();
        let mut masses: Vec<f64> = vertices.iter().map(|&vertex| model.masses[vertex]).collect();
        let (mut x, mut v) = (gather(&model.x), gather(&model.v));
        let stillness = scene.sleep.map(|sleep| Stillness::new(&sleep, &x));
        let prescribed = if scene.is_certified() { Prescribed::new(&model.obstacles) } else { Prescribed::default() };
        let [obstacles] = prescribed.positions([0.0], mean(&x));
        x.extend(obstacles);
        pinned.resize(x.len(), true);
        masses.resize(x.len(), 0.0);
        v.resize(x.len(), [0.0; 3]);
        let system = System::new(terms, &pinned)?;
        let body = Body { x, v, masses, system };
        let in_wind =
            body.system.terms().any(|(term, _)| term.declaration().name == <WindDrag as Element>::DECLARATION.name);
        let in_gusts = in_wind && scene.wind.as_ref().is_some_and(|wind| !wind.gusts.is_empty());
        let (integrator, sleep) = (scene.stepper(), SleepState::AWAKE);
        let (moving, motions) = (Vec::new(), Vec::new());
        let (histories, contact_energy) = (Vec::new(), 0.0);
        Ok(Self {
            vertices,
            labels,
            body,
            prescribed,
            integrator,
            moving,
            motions,
            targets: Vec::new(),
            in_gusts,
            stillness,
            sleep,
            histories,
            contact_energy,
        })
    }

    /// Adds a moving pin, whose vertex is an index within the island.
    pub(super) fn add_moving_pin(&mut self, pin: MovingPin) {
        if !self.motions.contains(&pin.motion) {
            self.motions.push(pin.motion);
        }
        self.moving.push(pin);
    }

    /// Takes the targets of its pinned vertices, by vertex of the scene, and wakes if there are any.
    pub(super) fn set_targets(&mut self, targets: &BTreeMap<usize, Vector3<f64>>) {
        let before = std::mem::take(&mut self.targets);
        let had = !before.is_empty();
        // A pin without a motion stays where it is.
        before.iter().for_each(|(vertex, _)| self.body.v[*vertex] = [0.0; 3]);
        if !targets.is_empty() {
            let own = self.vertices.iter().enumerate();
            let pinned = own.filter(|(place, _)| self.body.system.dofs().row(*place).is_none());
            self.targets = pinned.filter_map(|(place, vertex)| Some((place, *targets.get(vertex)?))).collect();
        }
        if had || !self.targets.is_empty() {
            self.wake();
        }
    }

    /// The vertices of the island, as indices into the scene.
    #[must_use]
    pub fn vertices(&self) -> &[usize] {
        &self.vertices
    }

    /// The label of each term: its index among the terms that the summary lists.
    #[must_use]
    pub fn labels(&self) -> &[usize] {
        &self.labels
    }

    /// The current state of the vertices, and the forces on them.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The vertices of obstacles in the body.
    pub(super) fn prescribed(&self) -> &Prescribed {
        &self.prescribed
    }

    /// The energy of contact at the end of the last step, in J; `None` if the island does not collide.
    pub(super) fn contact_energy(&self) -> Option<f64> {
        self.body.system.has_contact().then_some(self.contact_energy)
    }

    pub(super) fn body_mut(&mut self) -> &mut Body {
        &mut self.body
    }

    /// The largest stable step now, in s; see [`Integrator::stable_step`].
    pub(super) fn stable_step(&mut self) -> Result<Option<f64>, EvaluationError> {
        self.integrator.stable_step(&mut self.body)
    }

    /// Whether the island sleeps.
    #[must_use]
    pub fn is_asleep(&self) -> bool {
        self.sleep.is_asleep()
    }

    pub(super) fn wake(&mut self) {
        if self.is_asleep() {
            self.sleep = SleepState::AWAKE;
        }
    }

    /// Wakes a sleeping island that is disturbed during the step. Returns whether the island skips the step.
    pub(super) fn sleeps_through(&mut self, context: &StepContext<'_>) -> bool {
        let SleepState::Asleep(bounds) = self.sleep else { return false };
        if self.is_disturbed(context, &bounds) {
            self.wake();
        }
        self.is_asleep()
    }

    /// Whether gusts, a moving pin or a nearby moving obstacle act on the island.
    fn is_disturbed(&self, context: &StepContext<'_>, bounds: &BoundingSphere) -> bool {
        let varies = |term: &dyn PlacedTerm| term.varies(context.time, context.end);
        self.in_gusts
            || context.moves_any_of(&self.motions)
            || context.may_touch(bounds)
            || self.body.system.terms().any(|(term, _)| varies(term))
    }

    /// Takes one step. If an account is given, returns the account after the step.
    pub(super) fn step(
        &mut self,
        context: &StepContext<'_>,
        account: Option<&Account>,
    ) -> Result<(StepReport, Option<Account>), StepError> {
        let dt = context.dt;
        let started = Instant::now();
        self.histories = self.body.system.histories();
        for pin in &self.moving {
            let target = context.motions[pin.motion].pose(context.end).transform(pin.initial);
            let here = self.body.x[pin.vertex];
            self.body.v[pin.vertex] = std::array::from_fn(|axis| (target[axis] - here[axis]) / dt);
        }
        for &(vertex, target) in &self.targets {
            let here = self.body.x[vertex];
            self.body.v[vertex] = std::array::from_fn(|axis| (target[axis] - here[axis]) / dt);
        }
        self.move_obstacles([context.time, context.end]);
        self.begin_step(context.time, dt)?;
        let own = self.vertices.len();
        let opening = account.map(|account| account.begin(&self.body, own, self.obstacle_power(context, false)));
        let before = started.elapsed();
        let mut report = self.integrator.step(&mut self.body, dt)?;
        let started = Instant::now();
        check_speeds(&self.body.v[..own])?;
        let strained = account.map(|_| DrivenEnergies::of(&self.body));
        let Body { x, v, system, .. } = &mut self.body;
        system.end_step(State { x, v })?;
        let after = account.zip(opening).zip(strained).map(|((account, opening), strained)| {
            account.after(&self.body, &opening, &strained, self.obstacle_power(context, true), dt)
        });
        self.place_obstacles(context.end);
        let after = after.transpose()?;
        report.phases.add_to_ledger(before + started.elapsed());
        Ok((report, after))
    }

    /// Places the vertices of obstacles at a time, with the velocities that lead them to the next time.
    fn move_obstacles(&mut self, [time, next]: [f64; 2]) {
        let own = self.vertices.len();
        if self.body.x.len() == own {
            return;
        }
        let [from, to] = self.prescribed.positions([time, next], mean(&self.body.x[..own]));
        for ((from, to), vertex) in from.iter().zip(&to).zip(own..) {
            self.body.x[vertex] = *from;
            self.body.v[vertex] = std::array::from_fn(|axis| (to[axis] - from[axis]) / (next - time));
        }
    }

    /// Places the vertices of obstacles at a time exactly: steps end there to rounding only. So positions follow from
    /// the time alone, and a resumed run finds the same bits.
    fn place_obstacles(&mut self, time: f64) {
        let own = self.vertices.len();
        if self.body.x.len() > own {
            let [at] = self.prescribed.positions([time], mean(&self.body.x[..own]));
            self.body.x[own..].copy_from_slice(&at);
        }
    }

    /// The power of moving obstacles on the island at the start or the end of the step, in W. 0 if contact is
    /// certified: the account then finds the work from the forces on the vertices of obstacles.
    fn obstacle_power(&self, context: &StepContext<'_>, at_end: bool) -> f64 {
        if self.body.system.has_contact() {
            return 0.0;
        }
        let span = [context.time, context.time + context.dt];
        context.obstacles.iter().map(|obstacle: &Obstacle| obstacle.power(span, at_end, &self.body)).sum()
    }

    /// Passes the state at the start of a step to the terms.
    pub(super) fn begin_step(&mut self, time: f64, dt: f64) -> Result<(), EvaluationError> {
        let Body { x, v, system, .. } = &mut self.body;
        system.begin_step(StepStart { time, dt, state: State { x, v } })
    }

    /// Puts the island to sleep if it has been still for long enough and nothing disturbs it. Returns whether it
    /// fell asleep.
    pub(super) fn try_to_sleep(&mut self, context: &StepContext<'_>) -> bool {
        let Some(stillness) = &self.stillness else { return false };
        let own = self.vertices.len();
        if !self.sleep.update(&self.body.v[..own], context.dt, stillness) {
            return false;
        }
        let bounds = BoundingSphere::around(&self.body.x[..own]);
        if self.is_disturbed(context, &bounds) {
            return false;
        }
        self.sleep = SleepState::Asleep(bounds);
        self.body.v.fill([0.0; 3]);
        true
    }

    pub(super) fn save(&self) -> SavedIsland {
        let ContactMemory { names, vectors } = self.body.system.contact_memory(&self.body.x);
        let bristles = (names, vectors);
        let histories = self.body.system.histories();
        let (integrator, sleep, contact_energy) = (self.integrator.memory(), self.sleep.clone(), self.contact_energy);
        SavedIsland { integrator, sleep, bristles, histories, contact_energy }
    }

    pub(super) fn restore(&mut self, saved: SavedIsland) {
        self.integrator.restore(saved.integrator);
        self.sleep = saved.sleep;
        self.contact_energy = saved.contact_energy;
        self.body.system.restore_histories(&saved.histories);
        let (names, vectors) = saved.bristles;
        self.body.system.restore_contact(ContactMemory { names, vectors });
    }

    /// Keeps the last step, now that it has succeeded everywhere.
    pub(super) fn keep_step(&mut self) {
        self.histories.clear();
        self.contact_energy = self.body.system.contact_energy(&self.body.x).unwrap_or(0.0);
    }

    /// Restores the histories of the terms at the start of the last step, which failed elsewhere.
    pub(super) fn forget_step(&mut self) {
        self.body.system.restore_histories(&std::mem::take(&mut self.histories));
    }

    /// Copies positions and velocities from the scene.
    pub(super) fn gather(&mut self, x: &[Vector3<f64>], v: &[Vector3<f64>]) {
        let Self { vertices, body, .. } = self;
        for (local, &vertex) in vertices.iter().enumerate() {
            (body.x[local], body.v[local]) = (x[vertex], v[vertex]);
        }
    }

    /// Iterates over the free vertices: their positions in the scene, before the last step, and now.
    pub(super) fn moves<'a>(&'a self, before: &'a [Vector3<f64>]) -> impl Iterator<Item = [Vector3<f64>; 2]> + 'a {
        let free = self.body.system.dofs().free().iter();
        free.map(|&local| [before[self.vertices[local]], self.body.x[local]])
    }

    /// Writes the forces of contact on the vertices, in N, to `forces` of the scene.
    pub(super) fn scatter_contact_forces(&self, forces: &mut [Vector3<f64>]) {
        let mut own = vec![[0.0; 3]; self.body.x.len()];
        self.body.system.add_contact_force(&self.body.x, &mut own);
        for (&vertex, force) in self.vertices.iter().zip(own) {
            forces[vertex] = force;
        }
    }

    /// Writes the accelerations of pinned vertices in the last step, given the velocities of the scene before it in
    /// m/s, to `accelerations` of the scene, in m/s². An island that fell asleep has zeros.
    pub(super) fn note_accelerations(&self, before: &[Vector3<f64>], dt: f64, accelerations: &mut [Vector3<f64>]) {
        for (local, &vertex) in self.vertices.iter().enumerate() {
            if self.body.system.dofs().row(local).is_none() {
                let change = |axis: usize| (self.body.v[local][axis] - before[vertex][axis]) / dt;
                accelerations[vertex] = if self.is_asleep() { [0.0; 3] } else { std::array::from_fn(change) };
            }
        }
    }

    /// Copies positions and velocities to the scene.
    pub(super) fn scatter(&self, x: &mut [Vector3<f64>], v: &mut [Vector3<f64>]) {
        for (local, &vertex) in self.vertices.iter().enumerate() {
            (x[vertex], v[vertex]) = (self.body.x[local], self.body.v[local]);
        }
    }
}

/// Returns the mean of some positions.
fn mean(x: &[Vector3<f64>]) -> Vector3<f64> {
    let sum = x.iter().fold([0.0; 3], |sum, x| crate::geometry::add_scaled(sum, 1.0, *x));
    sum.map(|component| component / x.len().max(1) as f64)
}

/// Returns an error if a vertex is faster than light. Such a state is finite, but its squares soon overflow, and single
/// precision in files cannot hold its positions.
fn check_speeds(v: &[Vector3<f64>]) -> Result<(), StepError> {
    let fastest = v.iter().map(|v| crate::geometry::norm(*v)).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    match fastest {
        Some((vertex, speed)) if speed > SPEED_OF_LIGHT => Err(StepError::TooFast { vertex, speed }),
        _ => Ok(()),
    }
}
