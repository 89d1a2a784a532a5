use energy_dsl::{Element, Vector3};
use energy_elements::WindDrag;
use energy_solve::{State, StepStart, SystemError};
use serde::{Deserialize, Serialize};

use crate::account::Account;
use crate::body::Body;
use crate::contact::Obstacle;
use crate::integrator::{Integrator, IntegratorMemory, StepError, StepReport};
use crate::scene::{IslandModel, Model, MovingPin, Scene};
use crate::sleep::{Extent, Moment, Rest, Stillness};

/// Vertices that nothing couples to others: they move on their own, and may sleep while others move.
#[derive(Debug)]
pub struct Island {
    vertices: Vec<usize>,
    labels: Vec<usize>,
    body: Body,
    integrator: Box<dyn Integrator>,
    /// Pinned vertices that move, counted within the island.
    moving: Vec<MovingPin>,
    /// How they move, each motion once.
    motions: Vec<usize>,
    /// Whether the wind on it varies.
    in_gusts: bool,
    stillness: Option<Stillness>,
    rest: Rest,
}

/// What the motion of an island from here depends on, beside positions and velocities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedIsland {
    integrator: IntegratorMemory,
    rest: Rest,
}

impl Island {
    /// One of the islands of a model.
    pub(crate) fn new(scene: &Scene, model: &Model, island: IslandModel) -> Result<Self, SystemError> {
        let IslandModel { vertices, terms, labels } = island;
        let of = |all: &[Vector3<f64>]| -> Vec<Vector3<f64>> { vertices.iter().map(|&vertex| all[vertex]).collect() };
        let pinned: Vec<bool> = vertices.iter().map(|&vertex| model.pinned[vertex]).collect();
        let masses = vertices.iter().map(|&vertex| model.masses[vertex]).collect();
        let (x, v, system) = (of(&model.x), of(&model.v), energy_solve::System::new(terms, &pinned)?);
        let body = Body { x, v, masses, system };
        let stillness = scene.sleep.map(|sleep| Stillness::of(&sleep, &body.x));
        let blown =
            body.system.terms().any(|(term, _)| term.declaration().name == <WindDrag as Element>::DECLARATION.name);
        let in_gusts = blown && scene.wind.as_ref().is_some_and(|wind| !wind.gusts.is_empty());
        let (integrator, rest) = (scene.stepper(), Rest::AWAKE);
        let (moving, motions) = (Vec::new(), Vec::new());
        Ok(Self { vertices, labels, body, integrator, moving, motions, in_gusts, stillness, rest })
    }

    /// Moves a pinned vertex, counted within the island.
    pub(crate) fn move_pin(&mut self, pin: MovingPin) {
        if !self.motions.contains(&pin.motion) {
            self.motions.push(pin.motion);
        }
        self.moving.push(pin);
    }

    /// Its vertices, by their numbers in the whole.
    #[must_use]
    pub fn vertices(&self) -> &[usize] {
        &self.vertices
    }

    /// For each of its terms, which one it is of those that a summary lists.
    #[must_use]
    pub fn labels(&self) -> &[usize] {
        &self.labels
    }

    /// Its vertices as they are now, and what acts on them.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    pub(crate) fn body_mut(&mut self) -> &mut Body {
        &mut self.body
    }

    /// The largest step that is stable now, in s; see [`Integrator::stable_step`].
    pub(crate) fn stable_step(&mut self) -> Result<Option<f64>, energy_solve::EvaluationError> {
        self.integrator.stable_step(&mut self.body)
    }

    /// Whether it sleeps.
    #[must_use]
    pub fn is_asleep(&self) -> bool {
        self.rest.is_asleep()
    }

    pub(crate) fn wake(&mut self) {
        if self.is_asleep() {
            self.rest = Rest::AWAKE;
        }
    }

    /// Sleeps on, unless something that acts on it moves.
    pub(crate) fn sleeps_through(&mut self, moment: &Moment<'_>) -> bool {
        let Rest::Asleep(extent) = self.rest else { return false };
        if self.is_disturbed(moment, &extent) {
            self.wake();
        }
        self.is_asleep()
    }

    fn is_disturbed(&self, moment: &Moment<'_>, extent: &Extent) -> bool {
        self.in_gusts || moment.moves_one_of(&self.motions) || moment.comes_near(extent)
    }

    /// One step, with what it has and received after it, if that is asked for.
    pub(crate) fn step(
        &mut self,
        moment: &Moment<'_>,
        account: Option<&Account>,
    ) -> Result<(StepReport, Option<Account>), StepError> {
        let dt = moment.dt;
        for pin in &self.moving {
            let target = moment.motions[pin.motion].pose(moment.end).applied(pin.drawn);
            let here = self.body.x[pin.vertex];
            self.body.v[pin.vertex] = std::array::from_fn(|axis| (target[axis] - here[axis]) / dt);
        }
        self.begin_step(moment.time, dt)?;
        let opening = account.map(|_| Account::begin(&self.body, self.lifting(moment, false)));
        let report = self.integrator.step(&mut self.body, dt)?;
        let after = account
            .zip(opening)
            .map(|(account, opening)| account.after(&self.body, &opening, self.lifting(moment, true), dt));
        Ok((report, after.transpose()?))
    }

    /// The power of obstacles that move, at the start of a step or at its end, in W.
    fn lifting(&self, moment: &Moment<'_>, at_end: bool) -> f64 {
        let span = [moment.time, moment.time + moment.dt];
        moment.obstacles.iter().map(|obstacle: &Obstacle| obstacle.power(span, at_end, &self.body)).sum()
    }

    /// Tells its terms where a step starts.
    pub(crate) fn begin_step(&mut self, time: f64, dt: f64) -> Result<(), energy_solve::EvaluationError> {
        let Body { x, v, system, .. } = &mut self.body;
        system.begin_step(StepStart { time, dt, state: State { x, v } })
    }

    /// Falls asleep if it was still for long enough and nothing that acts on it moves; whether it did.
    pub(crate) fn may_fall_asleep(&mut self, moment: &Moment<'_>) -> bool {
        let Some(stillness) = &self.stillness else { return false };
        if !self.rest.is_still(&self.body.v, moment.dt, stillness) {
            return false;
        }
        let extent = Extent::of(&self.body.x);
        if self.is_disturbed(moment, &extent) {
            return false;
        }
        self.rest = Rest::Asleep(extent);
        self.body.v.fill([0.0; 3]);
        true
    }

    pub(crate) fn save(&self) -> SavedIsland {
        SavedIsland { integrator: self.integrator.memory(), rest: self.rest.clone() }
    }

    pub(crate) fn restore(&mut self, saved: SavedIsland) {
        self.integrator.restore(saved.integrator);
        self.rest = saved.rest;
    }

    /// Takes positions and velocities from those of the whole.
    pub(crate) fn gather(&mut self, x: &[Vector3<f64>], v: &[Vector3<f64>]) {
        let Self { vertices, body, .. } = self;
        for (place, &vertex) in vertices.iter().enumerate() {
            (body.x[place], body.v[place]) = (x[vertex], v[vertex]);
        }
    }

    /// Puts positions and velocities where they are in the whole.
    pub(crate) fn scatter(&self, x: &mut [Vector3<f64>], v: &mut [Vector3<f64>]) {
        for (place, &vertex) in self.vertices.iter().enumerate() {
            (x[vertex], v[vertex]) = (self.body.x[place], self.body.v[place]);
        }
    }
}
