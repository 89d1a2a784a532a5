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
//! **Which pairs act.** Two surfaces meet in many pairs. Some of them join at an iterate (`feasible.rs`) and then stay
//! until the step ends. So a line search sees a single function, which a filter in every trial would not be. A pair
//! that shortens a move joins in any case.
//!
//! **Stiffness.** K is chosen once for each pair and step: at half the gap, the barrier is ten times as stiff as the
//! vertices are against a displacement along the normal. Nothing is left to tune.
//!
//! **Stiffness of a contact.** The Hessian keeps β″ along the normal and the resistance to rolling on obstacles
//! (`rolling.rs`). The other parts of the curvature of the distance are small or negative.
//!
//! **Guarantee.** [`crate::collision`] proves that an accepted move has no crossing. Energies are evaluated at
//! certified states only.

mod bristle;
mod feasible;
mod friction;
mod joined;
mod judge;
mod law;
mod pressed;
mod resistance;
mod rolling;
mod spacing;
mod start;
mod stiffness;
mod untangle;

use energy_dsl::{Block, Vector3};
use energy_solve::threads::collect;
use energy_solve::{Contact, ContactCounts, ContactMemory, ContactModel, DofMap, Pressed, Touching};

pub use friction::Grip;
pub use law::{CURVATURE_AT_HALF, STIFFNESS_RATIO};
pub use start::{ContactError, Feature, FirstPush, ObstacleStart, Participants};
pub use untangle::Untangling;

use crate::collision::{Closest, CollisionMesh, Move, Near, Nearby, Neighbourhood, Pair, Search};
use feasible::Meeting;
use friction::Friction;
use joined::{Active, Joined};
use judge::{Judge, Judgement};
use law::{Barrier, Law, Order};
use resistance::Resistance;
pub use spacing::{GAP_PER_THICKNESS, LARGEST_REACH, thinning};
use spacing::{Spacing, Spacings};

/// Pairs within this many times the reach join if they are feasible. They have no energy yet, so they do not disturb
/// the line search in which they first act.
const JOINING: f64 = 1.25;
/// Pairs that a thread evaluates at a time.
const PART: usize = 1024;
/// Part of the displacement of a move that leaves the neighbourhood, by which an iterate may stray before the next
/// search.
const STRAYING: f64 = 0.25;

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
    /// indefinite Hessians may be hundreds of times too long, and would meet millions of pairs.
    limit: Option<f64>,
    /// The least limit, in m.
    least_limit: f64,
    /// The pairs near the current iterate.
    neighbourhood: Neighbourhood,
    joined: Joined,
    friction: Friction,
    /// Pairs that shortened a move since the last iterate.
    blocking: Vec<Pair>,
    resistance: Resistance,
    counts: ContactCounts,
}

impl BarrierContact {
    fn spacing(&self, pair: &Pair) -> Spacing {
        self.spacings.of(&self.mesh, pair)
    }

    /// Sets the coefficient of friction μ at each vertex. That of a pair is the mean of its two features.
    #[must_use]
    pub fn with_friction(mut self, coefficients: Vec<f64>) -> Self {
        let is_rough = coefficients.iter().any(|coefficient| *coefficient > 0.0);
        self.friction.coefficients = if is_rough { coefficients } else { Vec::new() };
        self
    }

    /// Sets the friction of each obstacle.
    #[must_use]
    pub fn with_grips(mut self, grips: Vec<Grip>) -> Self {
        self.friction.grips = grips;
        self
    }

    /// Finds the pairs in contact at the start of the step, on which friction acts.
    fn begin_friction(&mut self) {
        if !self.friction.is_rough() {
            return;
        }
        let start = std::mem::take(&mut self.friction.start);
        self.know(&start);
        self.neighbourhood.visit(&self.search, &start);
        let [nearby, strays] = [self.neighbourhood.nearby(), self.neighbourhood.strays()];
        let mut touching = [nearby, strays].map(|nearby| self.touching(nearby, &start)).concat();
        // Both kinds may hold the same pair.
        touching.sort_by_key(|(pair, ..)| *pair);
        touching.dedup_by_key(|(pair, ..)| *pair);
        self.friction.start = start;
        self.friction.take(&self.mesh, &touching, self.search.threads);
    }

    /// Returns the pairs in contact at x, where they were measured, in order.
    fn touching(&self, nearby: &Nearby, x: &[Vector3<f64>]) -> Vec<(Pair, Law, Closest)> {
        let Self { mesh, spacings, resistance, .. } = self;
        let (pairs, meeting) = (nearby.pairs(), Meeting { mesh, x });
        let touching = |Near { number, closest }: &Near| {
            let pair = &pairs[*number];
            let spacing = spacings.of(mesh, pair);
            let is_active = closest.distance - spacing.thickness < spacing.gap;
            let law = || Law::new(spacing, resistance.of(pair, closest));
            (is_active && meeting.may_join(pair, closest)).then(|| (*pair, law(), *closest))
        };
        collect(self.search.threads, nearby.near().len(), PART, |part| {
            nearby.near()[part].iter().filter_map(touching).collect()
        })
    }

    /// The law of a pair that joins with these closest points.
    fn law(&self, pair: &Pair, closest: &Closest) -> Law {
        Law::new(self.spacing(pair), self.resistance.of(pair, closest))
    }

    /// Makes all pairs near a place known.
    fn know(&mut self, x: &[Vector3<f64>]) {
        if !self.neighbourhood.knows(x) {
            self.follow(&Move::new(x, x));
        }
    }

    /// Makes all pairs near an iterate known, and measures them there.
    fn visit(&mut self, x: &[Vector3<f64>]) {
        if !self.neighbourhood.settle(&self.search, x) {
            self.know(x);
            self.neighbourhood.settle(&self.search, x);
        }
        self.neighbourhood.visit(&self.search, x);
    }

    /// Returns the pairs that join at x, where they were measured, in order.
    fn joining(&self, x: &[Vector3<f64>]) -> Vec<(Pair, Closest)> {
        let (mesh, spacings, known) = (&self.mesh, &self.spacings, &self.joined.pairs[..]);
        let (nearby, meeting) = (self.neighbourhood.nearby(), Meeting { mesh, x });
        let pairs = nearby.pairs();
        let joining = |part: &[Near]| {
            let Some(first) = part.first() else { return Vec::new() };
            let start = known.partition_point(|pair| *pair < pairs[first.number]);
            let mut known = known[start..].iter().peekable();
            let mut joining = Vec::new();
            for Near { number, closest } in part {
                let pair = &pairs[*number];
                if closest.separation > spacings.joining(mesh, pair) {
                    continue;
                }
                while known.next_if(|other| *other < pair).is_some() {}
                if known.peek() != Some(&pair) && meeting.may_join(pair, closest) {
                    joining.push((*pair, *closest));
                }
            }
            joining
        };
        collect(self.search.threads, nearby.near().len(), PART, |part| joining(&nearby.near()[part]))
    }

    /// Makes all pairs near a move known. Returns whether there are new ones.
    fn follow(&mut self, step: &Move<'_>) -> bool {
        let [least, most] = self.slack;
        let radius = |vertex: usize| (least + STRAYING * step.excursions()[vertex]).min(most);
        let is_new = self.neighbourhood.follow(&mut self.search, &self.mesh, step, radius, self.slack);
        self.counts.searches += u64::from(is_new);
        self.counts.clear += u64::from(is_new && self.neighbourhood.strays().pairs().is_empty());
        is_new
    }

    /// Returns the part of a move that certainly has no crossing.
    fn safe_part(&mut self, step: &Move<'_>) -> f64 {
        let strays = self.follow(step);
        self.neighbourhood.visit(&self.search, step.from());
        let near = self.judge(step, self.neighbourhood.nearby());
        let part = self.note(near);
        if !strays {
            return part;
        }
        let far = self.judge(step, self.neighbourhood.strays());
        part.min(self.note(far))
    }

    /// Notes a judgement, and returns the safe part of the move.
    fn note(&mut self, Judgement { part, pairs, tested, blocking }: Judgement) -> f64 {
        self.blocking.extend(blocking);
        self.counts.candidates += pairs;
        self.counts.tested += tested;
        part
    }

    /// Judges a move by some pairs, measured at its start.
    fn judge(&self, step: &Move<'_>, nearby: &Nearby) -> Judgement {
        let judge = Judge { mesh: &self.mesh, spacings: &self.spacings, step, nearby };
        judge.judge(self.search.threads)
    }
}

impl ContactModel for BarrierContact {
    fn set_threads(&mut self, threads: usize) {
        self.search.threads = threads;
    }

    fn begin_step(&mut self, x: &[Vector3<f64>]) {
        self.friction.begin_step(x);
        self.limit = None;
        self.joined.clear();
        self.blocking.clear();
        self.neighbourhood.begin_step();
    }

    fn certify(&mut self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64 {
        let step = Move::new(from, to);
        // NaN is in no region.
        if !step.is_finite() {
            return 0.0;
        }
        // The first move of a step is the warm start.
        let limit = *self.limit.get_or_insert(step.longest().max(self.least_limit));
        let part = if step.longest() > limit {
            let near = limit / step.longest();
            near * self.safe_part(&Move::new(from, &step.after(near)))
        } else {
            self.safe_part(&step)
        };
        self.counts.moves += 1;
        if part < 1.0 {
            self.counts.shortened += 1;
            self.counts.left += part;
        }
        part
    }

    fn set_resistance(&mut self, dofs: &DofMap, diagonal: Vec<Block<f64>>, inertia: Vec<f64>) {
        let mut blocks = vec![None; dofs.vertex_count()];
        for (&vertex, block) in dofs.free().iter().zip(diagonal) {
            blocks[vertex] = Some(block);
        }
        self.resistance = Resistance { blocks, inertia };
        self.begin_friction();
    }

    fn meet(&mut self, x: &[Vector3<f64>]) -> f64 {
        self.visit(x);
        let mut added = self.joining(x);
        let mut blocking = std::mem::take(&mut self.blocking);
        blocking.sort_unstable();
        blocking.dedup();
        blocking.retain(|pair| !self.joined.contains(pair) && added.binary_search_by_key(pair, |one| one.0).is_err());
        added.extend(blocking.into_iter().map(|pair| (pair, Closest::of(&pair, &pair.corners(x)))));
        let laws: Vec<Law> = added.iter().map(|(pair, closest)| self.law(pair, closest)).collect();
        let energy = |((_, closest), law): (&(Pair, Closest), &Law)| law.energy(law.apart(closest));
        let change = added.iter().zip(&laws).map(energy).sum();
        if !added.is_empty() {
            self.joined.extend(added.into_iter().map(|(pair, _)| pair).zip(laws).collect());
        }
        change
    }

    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let of_part = |active: &Active<'_>| active.barriers().iter().map(|barrier| barrier.energy).sum::<f64>();
        let energies = self.joined.evaluate(x, Order::Energy, self.search.threads, of_part);
        self.friction.energy(x, self.search.threads) + energies.iter().sum::<f64>()
    }

    fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
        let push = |(pair, closest, barrier): (&Pair, Closest, &Barrier)| {
            (*pair, closest.weights, closest.normal.map(|component| barrier.force * component))
        };
        let of_part = |active: &Active<'_>| active.iter().map(push).collect::<Vec<_>>();
        let pushes = self.joined.evaluate(x, Order::Force, self.search.threads, of_part);
        pushes.iter().flatten().for_each(|(pair, weights, push)| pair.add(*weights, *push, force));
        self.friction.add_force(x, self.search.threads, force);
    }

    fn contacts(&mut self, dofs: &DofMap, x: &[Vector3<f64>]) -> Vec<Vec<Contact>> {
        let (mesh, threads) = (&self.mesh, self.search.threads);
        let rows = |pair: &Pair| {
            pair.vertices.map(|vertex| dofs.place(vertex as usize).map_or(Contact::FIXED, energy_solve::index))
        };
        let friction = self.friction.stiffness(x, threads);
        let (active, mut contacts): (Vec<usize>, Vec<_>) = self
            .joined
            .evaluate(x, Order::Curvature, threads, |active| {
                (active.len(), stiffness::contacts(active, &friction, mesh, rows, x))
            })
            .into_iter()
            .unzip();
        if contacts.is_empty() {
            // No pair has joined, but friction acts on the pairs at the start of the step.
            contacts.push(friction.between(None, None).map(|(pair, rubbing)| rubbing.contact(rows(pair))).collect());
        }
        if !self.neighbourhood.is_restricted() {
            self.counts.active += active.iter().sum::<usize>() as u64;
            self.counts.systems += 1;
        }
        contacts
    }

    fn restrict(&mut self, moving: &[bool]) {
        self.neighbourhood.restrict(moving, self.search.threads);
        self.joined.restrict(moving);
    }

    fn release(&mut self) {
        self.neighbourhood.release(self.search.threads);
        self.joined.release();
    }

    fn touching(&self, x: &[Vector3<f64>]) -> Vec<Touching> {
        let of_part = |active: &Active<'_>| {
            let touching = |(pair, closest, barrier): (&Pair, Closest, &Barrier)| Touching {
                vertices: pair.vertices,
                first: pair.first(),
                distance: closest.distance,
                normal: closest.normal,
                force: barrier.force,
            };
            active.iter().map(touching).collect::<Vec<_>>()
        };
        self.joined.evaluate(x, Order::Force, self.search.threads, of_part).concat()
    }

    fn most_pressed(&self, x: &[Vector3<f64>]) -> Option<Pressed> {
        self.find_most_pressed(x)
    }

    fn counts(&self) -> ContactCounts {
        self.counts
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
