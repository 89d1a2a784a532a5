//! Contact of cloth and hair with themselves and with obstacles: a barrier on the gap of each pair of features, and a
//! certificate of every move.
//!
//! **Energy.** A pair at distance d, with thickness ξ and activation gap g, has the energy K β(s), β(s) =
//! −(1 − s)² ln s, s = (d − ξ)/g, below s = 1, and none above. It is the element
//! [`DistanceBarrier`](energy_elements::DistanceBarrier) of the gap. d is the distance of two closed features: a point
//! and a triangle, or two edges. Its gradient is c ⊗ n for the unit normal n and the coefficients c of the closest
//! points, so forces and torques of a contact cancel to rounding. Friction is in `friction.rs`.
//!
//! **Obstacles.** The vertices of an obstacle's core follow those of the cloth. They are not free: each step moves them
//! on straight lines from pose to pose, as far as the certificate allows. The distance of a pair with an obstacle is
//! that of its core, so its thickness includes the radius of the solid.
//!
//! **Active set.** Two surfaces are close in many pairs of features, the candidates. Some of them become active at an
//! iterate (`feasible.rs`) and then stay until the step ends. So a line search sees a single function, which a choice
//! in every trial would not be. A pair that shortens a move becomes active in any case.
//!
//! **Stiffness.** K is chosen once for each pair and step: at half the gap, the barrier is ten times as stiff as the
//! vertices are against a displacement along the normal. Nothing is left to tune.
//!
//! **Stiffness of a contact.** The Hessian keeps β″ along the normal and the resistance to rolling on obstacles
//! (`rolling.rs`). The other parts of the curvature of the distance are small or negative.
//!
//! **Guarantee.** [`crate::collision`] proves that an accepted move has no crossing. Energies are evaluated at
//! certified states only.

mod active_set;
mod bristle;
mod feasible;
mod friction;
mod law;
mod pair_friction;
mod pressed;
mod resistance;
mod rolling;
mod spacing;
mod start;
mod step;
mod step_filter;
mod stiffness;
mod untangle;

use energy_dsl::Vector3;
use energy_solve::{ContactCounts, ContactForces, ContactMemory, ContactModel, ContactStep, Touching};

pub use friction::ObstacleFriction;
pub use law::{CURVATURE_AT_HALF, STIFFNESS_RATIO};
pub use pair_friction::PairFriction;
pub use start::{ContactError, Feature, FirstPush, ObstacleStart, Participants};
pub use untangle::Untangling;

use crate::Coulomb;
use crate::collision::{Closest, CollisionMesh, Move, Neighbourhood, Pair, Search};
use active_set::{ActivePart, ActiveSet};
use friction::Friction;
use law::{Barrier, Order};
pub use spacing::{GAP_PER_THICKNESS, LARGEST_REACH, local_thinning, thinning};
use spacing::{Spacing, Spacings};
use step::BarrierStep;

/// Pairs within this many times the reach become active if they are feasible. They have no energy yet, so they do not
/// disturb the line search in which they first act.
const ACTIVATION: f64 = 1.25;
/// Pairs that a thread evaluates at a time.
const PART: usize = 1024;
/// Distance that a vertex may move before the next search, over its excursion on the move on which it escaped.
const SLACK_PER_EXCURSION: f64 = 0.25;

/// Contact of a body with itself and with obstacles.
#[derive(Debug)]
pub struct BarrierContact {
    mesh: CollisionMesh,
    spacings: Spacings,
    /// The names of obstacles, for messages.
    names: Vec<String>,
    /// The least and the largest distance that vertices may move before the next search, in m.
    slack: [f64; 2],
    search: Search,
    /// The longest move in this step that is certified as a whole, in m; `None` before its first move. Directions of
    /// indefinite Hessians may be hundreds of times too long, with millions of candidates.
    limit: Option<f64>,
    /// The least limit, in m.
    least_limit: f64,
    /// The candidates near the current iterate.
    neighbourhood: Neighbourhood,
    active: ActiveSet,
    friction: Friction,
    /// Pairs that shortened a move since the last iterate.
    blocking: Vec<Pair>,
    counts: ContactCounts,
}

impl BarrierContact {
    fn spacing(&self, pair: &Pair) -> Spacing {
        self.spacings.of(&self.mesh, pair)
    }

    /// Sets the coefficients of friction at each vertex. Those of a pair are the means of its two features.
    #[must_use]
    pub fn with_friction(mut self, coefficients: Vec<Coulomb>) -> Self {
        let has_friction = coefficients.iter().any(|coefficients| !coefficients.is_zero());
        self.friction.coefficients = if has_friction { coefficients } else { Vec::new() };
        self
    }

    /// Sets the friction of chosen pairs of parts, in place of that of their vertices or obstacles.
    #[must_use]
    pub fn with_pair_friction(mut self, chosen: PairFriction) -> Self {
        self.friction.chosen = chosen;
        self
    }

    /// Sets the friction of each obstacle.
    #[must_use]
    pub fn with_obstacle_friction(mut self, obstacles: Vec<ObstacleFriction>) -> Self {
        self.friction.obstacles = obstacles;
        self
    }

    /// Makes sure that the candidates include all pairs that can come within reach near x.
    fn search_at(&mut self, x: &[Vector3<f64>]) {
        if !self.neighbourhood.covers(x) {
            self.search_along(&Move::new(x, x));
        }
    }

    /// Refits the neighbourhood to an iterate, and measures the candidates there.
    fn refit(&mut self, x: &[Vector3<f64>]) {
        if !self.neighbourhood.refit(&self.search, x) {
            self.search_at(x);
            self.neighbourhood.refit(&self.search, x);
        }
        self.neighbourhood.measure(&self.search, x);
    }

    /// Makes sure that the candidates include all pairs that can come within reach near a move. Returns whether
    /// vertices escaped from the neighbourhood.
    fn search_along(&mut self, step: &Move<'_>) -> bool {
        let [least, most] = self.slack;
        let radius = |vertex: usize| (least + SLACK_PER_EXCURSION * step.excursions[vertex]).min(most);
        let is_new = self.neighbourhood.search_along(&mut self.search, &self.mesh, step, radius, self.slack);
        self.counts.searches += u64::from(is_new);
        self.counts.clear += u64::from(is_new && self.neighbourhood.escaped().pairs().is_empty());
        is_new
    }
}

impl ContactForces for BarrierContact {
    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let of_part = |part: &ActivePart<'_>| part.barriers().iter().map(|barrier| barrier.energy).sum::<f64>();
        let energies = self.active.evaluate(x, Order::Energy, self.search.threads, of_part);
        self.friction.energy(x, self.search.threads) + energies.iter().sum::<f64>()
    }

    fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
        let push = |(pair, closest, barrier): (&Pair, Closest, &Barrier)| {
            (*pair, closest.weights, closest.normal.map(|component| barrier.force * component))
        };
        let of_part = |part: &ActivePart<'_>| part.iter().map(push).collect::<Vec<_>>();
        let pushes = self.active.evaluate(x, Order::Force, self.search.threads, of_part);
        pushes.iter().flatten().for_each(|(pair, weights, push)| pair.add(*weights, *push, force));
        self.friction.add_force(x, self.search.threads, force);
    }
}

impl ContactModel for BarrierContact {
    fn set_threads(&mut self, threads: usize) {
        self.search.threads = threads;
    }

    fn begin_step(&mut self, x: &[Vector3<f64>]) -> Box<dyn ContactStep + '_> {
        self.friction.begin_step(x);
        self.limit = None;
        self.active.clear();
        self.blocking.clear();
        self.neighbourhood.begin_step();
        Box::new(BarrierStep { contact: self })
    }

    fn touching(&self, x: &[Vector3<f64>]) -> Vec<Touching> {
        let of_part = |part: &ActivePart<'_>| {
            let touching = |(pair, closest, barrier): (&Pair, Closest, &Barrier)| Touching {
                vertices: pair.vertices,
                first: pair.first(),
                distance: closest.distance,
                normal: closest.normal,
                force: barrier.force,
            };
            part.iter().map(touching).collect::<Vec<_>>()
        };
        self.active.evaluate(x, Order::Force, self.search.threads, of_part).concat()
    }

    fn memory(&self, x: &[Vector3<f64>]) -> ContactMemory {
        self.friction.memory(x)
    }

    fn restore(&mut self, memory: ContactMemory) {
        self.friction.restore(memory);
    }
}

#[cfg(test)]
mod tests;
