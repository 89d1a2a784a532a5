//! What one island has and received: the ledger is their sum.

use energy_dsl::Vector3;
use energy_solve::{EvaluationError, PlacedTerm, State};
use serde::{Deserialize, Serialize};

use crate::body::Body;

/// The energy, the momenta, and the work so far of an island.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Account {
    /// ½ Σ m v², in J.
    pub kinetic: f64,
    /// Of each term that has one, by its column in the ledger, in J.
    pub potential: Vec<(usize, f64)>,
    /// Done so far by each force that is no gradient, likewise.
    pub work: Vec<(usize, f64)>,
    /// Done so far by pins that move, in J.
    pub pins: f64,
    /// Done so far by obstacles that move, in J.
    pub obstacles: f64,
    /// Taken so far by falling asleep, in J; negative.
    pub sleep: f64,
    /// Σ m v, in kg m/s.
    pub momentum: Vector3<f64>,
    /// Σ m x × v about the origin, in kg m²/s.
    pub angular_momentum: Vector3<f64>,
}

/// A step that has begun.
#[derive(Debug)]
pub(crate) struct Opening {
    powers: Vec<f64>,
    /// Forces of potentials on pinned vertices that move, and where they were.
    pins: Vec<(usize, Vector3<f64>, Vector3<f64>)>,
    /// Of obstacles that move, in W.
    obstacles: f64,
}

impl Account {
    /// Of a body as it is, whose terms with potentials and those that do work have these columns.
    pub(crate) fn open(body: &Body, potentials: Vec<usize>, works: Vec<usize>) -> Result<Self, EvaluationError> {
        let nothing = |columns: Vec<usize>| columns.into_iter().map(|column| (column, 0.0)).collect();
        Self { potential: nothing(potentials), work: nothing(works), ..Self::default() }.now(body)
    }

    /// Energies and momenta as they are now; the work is that of before.
    fn now(&self, body: &Body) -> Result<Self, EvaluationError> {
        let columns = self.potential.iter().map(|(column, _)| *column);
        Ok(Self {
            kinetic: body.kinetic_energy(),
            potential: columns.zip(potentials(body)?).collect(),
            momentum: body.momentum(),
            angular_momentum: body.angular_momentum(),
            ..self.clone()
        })
    }

    /// Called once all terms know that the step begins; `obstacles` is the power of those that move, in W.
    pub(crate) fn begin(body: &Body, obstacles: f64) -> Opening {
        let pins = pulls(body).into_iter().map(|(vertex, force)| (vertex, force, body.x[vertex])).collect();
        Opening { powers: powers(body), pins, obstacles }
    }

    /// What it is after the step.
    pub(crate) fn after(
        &self,
        body: &Body,
        opening: &Opening,
        obstacles: f64,
        dt: f64,
    ) -> Result<Self, EvaluationError> {
        let mut after = self.now(body)?;
        for (((_, work), before), now) in after.work.iter_mut().zip(&opening.powers).zip(powers(body)) {
            *work += 0.5 * dt * (before + now);
        }
        for ((vertex, before, from), (_, now)) in opening.pins.iter().zip(pulls(body)) {
            let part = |axis: usize| 0.5 * (before[axis] + now[axis]) * (body.x[*vertex][axis] - from[axis]);
            after.pins -= (0..3).map(part).sum::<f64>();
        }
        after.obstacles += 0.5 * dt * (opening.obstacles + obstacles);
        Ok(after)
    }

    /// The same asleep: what was left of its motion is gone.
    pub(crate) fn asleep(self) -> Self {
        let sleep = self.sleep - self.kinetic;
        Self { kinetic: 0.0, sleep, momentum: [0.0; 3], angular_momentum: [0.0; 3], ..self }
    }
}

/// Whether a term does work that is no change of its potential.
pub(crate) fn works(term: &dyn PlacedTerm) -> bool {
    !term.has_energy() || term.character().velocity_dependent
}

/// The energy of each term that has one.
fn potentials(body: &Body) -> Result<Vec<f64>, EvaluationError> {
    let energy = |term: &dyn PlacedTerm| term.energy(&body.x).map(|(energy, _)| energy);
    let all: Vec<f64> = body.system.terms().filter_map(|(term, _)| energy(term)).collect();
    match all.iter().all(|energy| energy.is_finite()) {
        true => Ok(all),
        false => Err(EvaluationError::NonFiniteSum { what: energy_solve::Quantity::Energy }),
    }
}

/// The power of each force that is no gradient on the free vertices, in W.
fn powers(body: &Body) -> Vec<f64> {
    let still = vec![[0.0; 3]; body.v.len()];
    let power = |term: &dyn PlacedTerm| {
        let mut force = still.clone();
        term.add_force(body.state(), &mut force);
        let mut power = dot_of_free(body, &force);
        if term.has_energy() {
            force.clone_from(&still);
            term.add_force(State { x: &body.x, v: &still }, &mut force);
            power -= dot_of_free(body, &force);
        }
        power
    };
    body.system.terms().filter(|(term, _)| works(*term)).map(|(term, _)| power(term)).collect()
}

fn dot_of_free(body: &Body, force: &[Vector3<f64>]) -> f64 {
    let one = |&vertex: &usize| crate::geometry::dot(force[vertex], body.v[vertex]);
    body.system.dofs().free().iter().map(one).sum()
}

/// The forces of potentials on pinned vertices that move, in N.
fn pulls(body: &Body) -> Vec<(usize, Vector3<f64>)> {
    let moves = |vertex: &usize| body.system.dofs().place(*vertex).is_none() && body.v[*vertex] != [0.0; 3];
    let moving: Vec<usize> = (0..body.x.len()).filter(moves).collect();
    if moving.is_empty() {
        return Vec::new();
    }
    let still = vec![[0.0; 3]; body.v.len()];
    let mut force = still.clone();
    for (term, _) in body.system.terms().filter(|(term, _)| term.has_energy()) {
        term.add_force(State { x: &body.x, v: &still }, &mut force);
    }
    moving.into_iter().map(|vertex| (vertex, force[vertex])).collect()
}
