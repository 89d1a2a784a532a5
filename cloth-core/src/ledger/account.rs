//! The energy account of one island. The ledger is the sum of the accounts.

use energy_dsl::Vector3;
use energy_solve::{EvaluationError, PlacedTerm, State};
use serde::{Deserialize, Serialize};

use crate::Body;
use crate::geometry::{add_scaled, norm};

/// Energy and momenta of an island, and the work done on it so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Account {
    /// ½ Σ m v², in J.
    pub kinetic: f64,
    /// Potential energies in J, with the ledger column of each term. The last is that of contact, if the body collides.
    pub potential: Vec<(usize, f64)>,
    /// Work of each non-conservative force in J, with its ledger column. The last is the change of contact's energy by
    /// new barriers, if the body collides.
    pub work: Vec<(usize, f64)>,
    /// Work of moving pins, in J.
    pub pins: f64,
    /// Work of moving obstacles, in J.
    pub obstacles: f64,
    /// Energy removed by falling asleep, in J; negative.
    pub sleep: f64,
    /// Σ m v, in kg m/s.
    pub momentum: Vector3<f64>,
    /// Σ m x × v about the origin, in kg m²/s.
    pub angular_momentum: Vector3<f64>,
    /// The largest force of contact on a vertex, in N.
    #[serde(default)]
    pub contact_force: f64,
    /// The total force of contact on obstacles, in N.
    #[serde(default)]
    pub force_on_obstacles: Vector3<f64>,
}

/// Quantities at the start of a step, for the trapezoidal rule.
#[derive(Debug)]
pub(crate) struct Opening {
    powers: Vec<f64>,
    /// Moving pinned vertices, and those of moving obstacles: index, force of the potentials in N, position in m.
    pins: Vec<(usize, Vector3<f64>, Vector3<f64>)>,
    /// The number of vertices before those of obstacles.
    own: usize,
    /// Power of moving obstacles, in W.
    obstacles: f64,
    /// Positions, if the body collides.
    x: Option<Vec<Vector3<f64>>>,
    /// Work that the start of the step did by changing the parameters of each term, in J; see
    /// [`PlacedTerm::is_driven`].
    driven: Vec<f64>,
}

/// Energies of the driven terms, 0 for the others, in J.
#[derive(Debug)]
pub(crate) struct DrivenEnergies(Vec<f64>);

impl Account {
    /// Opens an account for a body. `potentials` and `works` hold the ledger columns of its terms.
    pub(crate) fn open(body: &Body, potentials: Vec<usize>, works: Vec<usize>) -> Result<Self, EvaluationError> {
        let zeros = |columns: Vec<usize>| columns.into_iter().map(|column| (column, 0.0)).collect();
        Self { potential: zeros(potentials), work: zeros(works), ..Self::default() }.now(body)
    }

    /// Updates energies and momenta to the current state, and keeps the work.
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

    /// Starts a step, after the terms were told of it. The first `own` vertices are those of the island, the others
    /// those of obstacles. `obstacles` is the power of moving obstacles that have no vertices, in W.
    pub(crate) fn begin(&self, body: &Body, own: usize, obstacles: f64) -> Opening {
        let moves = |vertex: &usize| body.system.dofs().row(*vertex).is_none() && body.v[*vertex] != [0.0; 3];
        let moving: Vec<usize> = (0..body.x.len()).filter(moves).collect();
        let forces = potential_forces(body, own, &moving).into_iter();
        let pins = moving.iter().zip(forces).map(|(&vertex, force)| (vertex, force, body.x[vertex])).collect();
        let x = body.system.has_contact().then(|| body.x.clone());
        let mut before = self.potential.iter().map(|(_, energy)| *energy);
        let change = |(term, now): (&dyn PlacedTerm, f64)| {
            let before = if term.has_energy() { before.next().unwrap_or(0.0) } else { 0.0 };
            if term.is_driven() { now - before } else { 0.0 }
        };
        let driven = body.system.terms().map(|(term, _)| term).zip(DrivenEnergies::of(body).0).map(change).collect();
        Opening { powers: powers(body), pins, own, obstacles, x, driven }
    }

    /// Returns the account after the step.
    pub(crate) fn after(
        &self,
        body: &Body,
        opening: &Opening,
        strained: &DrivenEnergies,
        obstacles: f64,
        dt: f64,
    ) -> Result<Self, EvaluationError> {
        let mut after = self.now(body)?;
        for (((_, work), before), now) in after.work.iter_mut().zip(&opening.powers).zip(powers(body)) {
            *work += 0.5 * dt * (before + now);
        }
        let flowed = DrivenEnergies::of(body).0.into_iter().zip(&strained.0).map(|(now, before)| now - before);
        let driven = opening.driven.iter().zip(flowed).map(|(start, end)| start + end);
        let of_works = body.system.terms().zip(driven).filter(|((term, _), _)| works(*term)).map(|(_, work)| work);
        after.work.iter_mut().zip(of_works).for_each(|((_, work), driven)| *work += driven);
        // Pairs in contact are known at the end of the step only.
        let mut contact = vec![[0.0; 3]; body.x.len()];
        body.system.add_contact_force(&body.x, &mut contact);
        let on_cloth = &contact[..opening.own];
        after.contact_force = on_cloth.iter().map(|force| norm(*force)).fold(0.0, f64::max);
        // Forces of cloth on cloth add up to zero. Fixed obstacles have no vertex that friction acts on.
        after.force_on_obstacles = on_cloth.iter().fold([0.0; 3], |sum, force| add_scaled(sum, -1.0, *force));
        let moving: Vec<usize> = opening.pins.iter().map(|(vertex, ..)| *vertex).collect();
        for ((vertex, before, from), now) in opening.pins.iter().zip(potential_forces(body, opening.own, &moving)) {
            let force = |axis: usize| 0.5 * (before[axis] + now[axis]) + contact[*vertex][axis];
            let work: f64 = (0..3).map(|axis| force(axis) * (body.x[*vertex][axis] - from[axis])).sum();
            *(if *vertex < opening.own { &mut after.pins } else { &mut after.obstacles }) -= work;
        }
        after.obstacles += 0.5 * dt * (opening.obstacles + obstacles);
        let renewed = opening.x.as_ref().and_then(|x| body.system.contact_energy(x));
        if let (Some(renewed), Some((_, old)), Some((_, work))) =
            (renewed, self.potential.last(), after.work.last_mut())
        {
            *work += renewed - old;
        }
        Ok(after)
    }

    /// Returns the account of a body after pins let go. The energy of vertices that are free now counts as work of the
    /// pins.
    pub(crate) fn reopened(&self, body: &Body) -> Result<Self, EvaluationError> {
        let energy = |account: &Self| account.kinetic + account.potential.iter().map(|(_, energy)| energy).sum::<f64>();
        let now = self.now(body)?;
        let pins = self.pins + energy(&now) - energy(self);
        Ok(Self { pins, ..now })
    }

    /// Returns the account of the island asleep: its kinetic energy moves to `sleep`.
    pub(crate) fn asleep(self) -> Self {
        let sleep = self.sleep - self.kinetic;
        Self { kinetic: 0.0, sleep, momentum: [0.0; 3], angular_momentum: [0.0; 3], ..self }
    }
}

impl DrivenEnergies {
    /// Evaluates the driven terms.
    pub(crate) fn of(body: &Body) -> Self {
        let energy = |term: &dyn PlacedTerm| {
            let energy = if term.is_driven() { term.energy(&body.x) } else { None };
            energy.map_or(0.0, |(energy, _)| energy)
        };
        Self(body.system.terms().map(|(term, _)| energy(term)).collect())
    }
}

/// Whether a term does work that is not a change of its potential.
pub(crate) fn works(term: &dyn PlacedTerm) -> bool {
    !term.has_energy() || term.character().velocity_dependent || term.is_driven()
}

/// Returns the energy of each term that has one, and of contact, if the body collides.
fn potentials(body: &Body) -> Result<Vec<f64>, EvaluationError> {
    let energy = |term: &dyn PlacedTerm| term.energy(&body.x).map(|(energy, _)| energy);
    let terms = body.system.terms().filter_map(|(term, _)| energy(term));
    let all: Vec<f64> = terms.chain(body.system.contact_energy(&body.x)).collect();
    match all.iter().all(|energy| energy.is_finite()) {
        true => Ok(all),
        false => Err(EvaluationError::NonFiniteSum { what: energy_solve::Quantity::Energy }),
    }
}

/// Returns the power of each non-conservative force on the free vertices, in W.
fn powers(body: &Body) -> Vec<f64> {
    let still = vec![[0.0; 3]; body.v.len()];
    let power = |term: &dyn PlacedTerm| {
        let mut force = still.clone();
        if !term.character().velocity_dependent && term.has_energy() {
            return 0.0;
        }
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

/// Returns the forces of the potentials, without contact, on some vertices, in N. Potentials act on the first `own`
/// vertices only; the others are those of obstacles.
fn potential_forces(body: &Body, own: usize, vertices: &[usize]) -> Vec<Vector3<f64>> {
    if vertices.iter().all(|&vertex| vertex >= own) {
        return vec![[0.0; 3]; vertices.len()];
    }
    let still = vec![[0.0; 3]; body.v.len()];
    let mut force = still.clone();
    for (term, _) in body.system.terms().filter(|(term, _)| term.has_energy()) {
        term.add_force(State { x: &body.x, v: &still }, &mut force);
    }
    vertices.iter().map(|&vertex| force[vertex]).collect()
}
