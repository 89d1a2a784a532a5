//! Contact of cloth and hair with itself: a barrier on the gap of each pair of features, and a certificate of every
//! move.
//!
//! **Energy.** A pair at distance d, with thickness ξ and activation gap g, has the energy K β(s), β(s) =
//! −(1 − s)² ln s, s = (d − ξ)/g, below s = 1, and none above ([`DistanceBarrier`] of the gap). d is the distance of
//! two closed features: a point and a triangle, or two edges. Its gradient is c ⊗ n for the unit normal n and the
//! coefficients c of the closest points, so forces and torques of a contact cancel to rounding.
//!
//! **Which pairs act.** Two surfaces meet in many pairs. A pair joins at an iterate if its closest points are a local
//! minimum of the distance of the surfaces, and then stays until the step ends. So a line search sees a
//! single function, which a filter in every trial would not be. A pair that shortens a move joins in any case.
//!
//! **Stiffness.** K is chosen once for each pair and step: at half the gap, the barrier is ten times
//! as stiff as the vertices are against a displacement along the normal. Nothing is left to tune.
//!
//! **Guarantee.** [`crate::collision`] proves that an accepted move has no crossing. Energies are evaluated at
//! certified states only.

mod feasible;
mod start;

use std::collections::BTreeSet;

use energy_dsl::{Block, Potential, Vector3};
use energy_elements::DistanceBarrier;
use energy_solve::{Contact, ContactCounts, ContactModel, DofMap};

pub use start::ContactError;

use crate::collision::{Candidate, Candidates, Clearance, Closest, CollisionMesh, Move, Pair, Shortlist, Slack};
use crate::geometry::{add_scaled, dot};
use feasible::may_join;

/// Stiffness of the barrier at half the gap over the resistance of the vertices. Factors from 3 to 30 need about the
/// same number of iterations.
const STIFFNESS_RATIO: f64 = 10.0;
/// β″(½).
const CURVATURE_AT_HALF: f64 = 6.386_294_361_119_89;
/// Pairs within this many times the reach join if they are feasible. They have no energy yet, so they do not disturb
/// the line search in which they first act.
const JOINING: f64 = 2.0;

/// Contact of a body with itself.
#[derive(Debug)]
pub struct BarrierContact {
    mesh: CollisionMesh,
    /// Half of the thickness at each vertex, in m.
    radii: Vec<f64>,
    /// Activation gap g, in m.
    gap: f64,
    /// Largest distance at which a pair has an energy, in m.
    reach: f64,
    /// The slack of the first search of a step. The least slack doubles with further searches, because the iterates
    /// stray.
    slack: Slack,
    /// Searches in this step.
    searches: u32,
    candidates: Candidates,
    /// The candidates that matter near the current iterate.
    shortlist: Shortlist,
    joined: Vec<Joined>,
    /// The pairs of `joined`.
    known: BTreeSet<Pair>,
    /// Pairs that shortened a move since the last iterate.
    blocking: Vec<Candidate>,
    resistance: Resistance,
    counts: ContactCounts,
}

/// A pair in contact, or close to it.
#[derive(Clone, Copy, Debug)]
struct Joined {
    candidate: Candidate,
    thickness: f64,
    /// K/g², in N/m.
    stiffness: f64,
}

/// The resistance of vertices to displacement, in N/m.
#[derive(Debug, Default)]
struct Resistance {
    /// Diagonal blocks of M/h² + ∂²U/∂x² by vertex; `None` for a pinned one.
    blocks: Vec<Option<Block<f64>>>,
    /// m/h² by vertex, the least resistance.
    inertia: Vec<f64>,
}

impl Resistance {
    /// The resistance of a pair to a displacement along its normal: the mean over free vertices by the squares of c.
    /// The small constant keeps the mean defined while the closest points depend on pinned vertices only.
    fn of(&self, pair: &Pair, closest: &Closest) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (vertex, c) in pair.vertices.iter().zip(closest.weights) {
            let vertex = *vertex as usize;
            if let Some(block) = &self.blocks[vertex] {
                let n = closest.normal;
                let along = dot(n, block.map(|row| dot(row, n))).max(self.inertia[vertex]);
                let weight = c * c + 1e-3;
                sum += weight * along;
                weights += weight;
            }
        }
        if weights > 0.0 { sum / weights } else { 0.0 }
    }
}

impl BarrierContact {
    /// The distance at which a pair touches, in m.
    fn thickness(&self, pair: &Pair) -> f64 {
        self.radii[pair.vertices[0] as usize] + self.radii[pair.vertices[pair.first()] as usize]
    }

    /// Iterates over the joined pairs with an energy at x. `excursions` are those of the candidates.
    fn active<'a>(&'a self, x: &'a [Vector3<f64>]) -> impl Iterator<Item = (&'a Joined, Closest, f64)> + 'a {
        let excursions = self.candidates.excursions(x);
        self.joined.iter().filter_map(move |joined| {
            let within = joined.thickness + self.gap;
            if joined.candidate.is_beyond(within, x, &excursions) {
                return None;
            }
            let pair = &joined.candidate.pair;
            let closest = Closest::of(pair, &pair.corners(x));
            (closest.distance < within).then_some((joined, closest, closest.distance - joined.thickness))
        })
    }

    /// The barrier of a pair as a function of the vector between the surfaces of its features.
    fn barrier(&self, joined: &Joined) -> DistanceBarrier {
        DistanceBarrier::new(joined.stiffness, self.gap)
    }

    /// The energy of a pair at a gap, in J.
    fn energy_of(&self, joined: &Joined, gap: f64) -> f64 {
        if gap > 0.0 { self.barrier(joined).value(&between(gap)).value } else { f64::INFINITY }
    }

    /// Adds a pair, unless it is known. Returns its energy.
    fn join(&mut self, candidate: Candidate, closest: &Closest) -> f64 {
        if !self.known.insert(candidate.pair) {
            return 0.0;
        }
        let stiffness = STIFFNESS_RATIO / CURVATURE_AT_HALF * self.resistance.of(&candidate.pair, closest);
        let joined = Joined { candidate, thickness: self.thickness(&candidate.pair), stiffness };
        self.joined.push(joined);
        if closest.distance < joined.thickness + self.gap {
            self.energy_of(&joined, closest.distance - joined.thickness)
        } else {
            0.0
        }
    }

    /// Renews the candidates for a move.
    fn search(&mut self, from: &[Vector3<f64>], to: &[Vector3<f64>]) {
        let Slack { least, part, most } = self.slack;
        let least = least * f64::from(1_u32 << self.searches.min(3));
        self.candidates.search(&self.mesh, from, to, Slack { least, part, most });
        self.shortlist.clear();
        self.searches += 1;
        self.counts.searches += 1;
        for joined in &mut self.joined {
            joined.candidate = Candidate::new(joined.candidate.pair, from);
        }
    }
}

/// Two points at this distance.
fn between(gap: f64) -> [Vector3<f64>; 2] {
    [[gap, 0.0, 0.0], [0.0; 3]]
}

impl ContactModel for BarrierContact {
    fn begin_step(&mut self) {
        self.joined.clear();
        self.known.clear();
        self.blocking.clear();
        // A run that resumes from a checkpoint must find the same pairs in the same order.
        self.candidates.clear();
        self.shortlist.clear();
        self.searches = 0;
    }

    fn certify(&mut self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64 {
        // NaN is in no region.
        if !to.iter().flatten().all(|coordinate| coordinate.is_finite()) {
            return 0.0;
        }
        if !(self.candidates.cover(from) && self.candidates.cover(to)) {
            self.search(from, to);
        }
        let step = Move::new(from, to);
        self.shortlist.prepare(&self.candidates, from, to, step.rounding());
        let excursions = [from, to].map(|x| self.candidates.excursions(x));
        let from_centre = self.shortlist.excursions(from, to);
        let out_of_reach = self.reach + step.rounding();
        let mut part = 1.0;
        let mut tested = 0;
        for listed in self.shortlist.pairs() {
            if listed.is_beyond(out_of_reach, &from_centre) {
                continue;
            }
            let candidate = &listed.candidate;
            let clearance = Clearance { thickness: self.thickness(&candidate.pair), reach: self.reach };
            if step.is_plainly_safe(candidate, clearance, &excursions) {
                continue;
            }
            tested += 1;
            let own = step.safe_part(&candidate.pair, clearance, part);
            if own < 1.0 {
                self.blocking.push(*candidate);
            }
            part = own.min(part);
        }
        self.counts.moves += 1;
        self.counts.candidates += self.shortlist.pairs().len() as u64;
        self.counts.tested += tested;
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
    }

    fn meet(&mut self, x: &[Vector3<f64>]) -> f64 {
        if !self.candidates.cover(x) {
            self.search(x, x);
        }
        // A list that was made for a move covers its end. A shorter one would not cover the next move.
        if !self.shortlist.covers(x, x) {
            self.shortlist.prepare(&self.candidates, x, x, Move::new(x, x).rounding());
        }
        let excursions = self.candidates.excursions(x);
        let from_centre = self.shortlist.excursions(x, x);
        let near = JOINING * self.reach;
        let mut added = Vec::new();
        for listed in self.shortlist.pairs() {
            let candidate = &listed.candidate;
            if listed.is_beyond(near, &from_centre)
                || candidate.is_beyond(near, x, &excursions)
                || self.known.contains(&candidate.pair)
            {
                continue;
            }
            let closest = Closest::of(&candidate.pair, &candidate.pair.corners(x));
            if closest.distance <= near && may_join(&self.mesh, &candidate.pair, &closest, x) {
                added.push((*candidate, closest));
            }
        }
        for candidate in std::mem::take(&mut self.blocking) {
            // A search since then has forgotten the place that its distance refers to.
            let found = self.candidates.find(&candidate.pair);
            let candidate = found.unwrap_or(Candidate { distance: 0.0, normal: [0.0; 3], ..candidate });
            added.push((candidate, Closest::of(&candidate.pair, &candidate.pair.corners(x))));
        }
        added.iter().map(|(candidate, closest)| self.join(*candidate, closest)).sum()
    }

    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        self.active(x).map(|(joined, _, gap)| self.energy_of(joined, gap)).sum()
    }

    fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
        for (joined, closest, gap) in self.active(x) {
            let slope = self.barrier(joined).gradient(&between(gap)).gradient[0][0];
            for (&vertex, weight) in joined.candidate.pair.vertices.iter().zip(closest.weights) {
                let pull = &mut force[vertex as usize];
                *pull = add_scaled(*pull, -slope * weight, closest.normal);
            }
        }
    }

    fn contacts(&mut self, dofs: &DofMap, x: &[Vector3<f64>]) -> Vec<Contact> {
        let row = |&vertex: &u32| dofs.place(vertex as usize).map_or(Contact::FIXED, energy_solve::index);
        let contact = |(joined, closest, gap): (&Joined, Closest, f64)| {
            let curvature = self.barrier(joined).hessian(&between(gap)).hessian.as_ref()[0][0][0];
            let n = closest.normal;
            Contact {
                rows: joined.candidate.pair.vertices.each_ref().map(row),
                weights: closest.weights,
                block: std::array::from_fn(|i| std::array::from_fn(|j| curvature * n[i] * n[j])),
            }
        };
        let contacts: Vec<Contact> = self.active(x).map(contact).collect();
        self.counts.active += contacts.len() as u64;
        self.counts.systems += 1;
        contacts
    }

    fn counts(&self) -> ContactCounts {
        self.counts
    }
}

#[cfg(test)]
mod tests;
