//! Contact during a step: the step filter, the active set, and lagged friction.

use energy_dsl::Vector3;
use energy_solve::threads::collect;
use energy_solve::{Contact, ContactCounts, ContactForces, ContactStep, DofMap, Pressed, Resistance, SlidingStiffness};

use super::active_set::ActivePart;
use super::feasible::FeasibleRegions;
use super::law::{Law, Order};
use super::resistance::along_normal;
use super::step_filter::{FilteredStep, StepFilter};
use super::{BarrierContact, PART, stiffness};
use crate::collision::{Candidates, Closest, Move, Near, Pair};

/// The contact of a step.
#[derive(Debug)]
pub(super) struct BarrierStep<'a> {
    pub contact: &'a mut BarrierContact,
}

impl BarrierStep<'_> {
    /// Returns the candidates in contact at x, where they were measured, in order.
    fn in_contact(
        &self,
        candidates: &Candidates,
        x: &[Vector3<f64>],
        resistance: &Resistance,
    ) -> Vec<(Pair, Law, Closest)> {
        let BarrierContact { mesh, spacings, search, .. } = &*self.contact;
        let (pairs, regions) = (candidates.pairs(), FeasibleRegions { mesh, x });
        let in_contact = |Near { number, closest }: &Near| {
            let pair = &pairs[*number];
            let spacing = spacings.of(mesh, pair);
            let is_active = closest.distance - spacing.thickness < spacing.gap;
            let law = || Law::new(spacing, along_normal(resistance, pair, closest));
            (is_active && regions.contain(pair, closest)).then(|| (*pair, law(), *closest))
        };
        collect(search.threads, candidates.near().len(), PART, |part| {
            candidates.near()[part].iter().filter_map(in_contact).collect()
        })
    }

    /// Returns the candidates that become active at x, where they were measured, in order.
    fn newly_active(&self, x: &[Vector3<f64>]) -> Vec<(Pair, Closest)> {
        let BarrierContact { mesh, spacings, active, neighbourhood, search, .. } = &*self.contact;
        let (candidates, regions) = (neighbourhood.candidates(), FeasibleRegions { mesh, x });
        let (pairs, active) = (candidates.pairs(), &active.pairs[..]);
        let newly_active = |part: &[Near]| {
            let Some(first) = part.first() else { return Vec::new() };
            let start = active.partition_point(|pair| *pair < pairs[first.number]);
            let mut active = active[start..].iter().peekable();
            let mut added = Vec::new();
            for Near { number, closest } in part {
                let pair = &pairs[*number];
                if closest.separation > spacings.activation(mesh, pair) {
                    continue;
                }
                while active.next_if(|other| *other < pair).is_some() {}
                if active.peek() != Some(&pair) && regions.contain(pair, closest) {
                    added.push((*pair, *closest));
                }
            }
            added
        };
        collect(search.threads, candidates.near().len(), PART, |part| newly_active(&candidates.near()[part]))
    }

    /// Returns the part of a move that is certified to have no crossing.
    fn safe_part(&mut self, step: &Move<'_>) -> f64 {
        let has_escaped = self.contact.search_along(step);
        self.contact.neighbourhood.measure(&self.contact.search, step.from);
        let near = self.filter(step, self.contact.neighbourhood.candidates());
        let part = self.record(near);
        if !has_escaped {
            return part;
        }
        let far = self.filter(step, self.contact.neighbourhood.escaped());
        part.min(self.record(far))
    }

    /// Filters a move by some candidates, measured at its start.
    fn filter(&self, step: &Move<'_>, candidates: &Candidates) -> FilteredStep {
        let BarrierContact { mesh, spacings, search, .. } = &*self.contact;
        StepFilter { mesh, spacings, step, candidates }.filter(search.threads)
    }

    /// Records the result of a filter, and returns the safe part of the move.
    fn record(&mut self, FilteredStep { part, pairs, tested, blocking }: FilteredStep) -> f64 {
        self.contact.blocking.extend(blocking);
        self.contact.counts.candidates += pairs;
        self.contact.counts.tested += tested;
        part
    }
}

impl ContactForces for BarrierStep<'_> {
    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        self.contact.energy(x)
    }

    fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
        self.contact.add_force(x, force);
    }
}

impl ContactStep for BarrierStep<'_> {
    fn filter_step(&mut self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64 {
        let step = Move::new(from, to);
        // NaN is in no region.
        if !step.is_finite() {
            return 0.0;
        }
        // The first move of a step is the warm start.
        let limit = *self.contact.limit.get_or_insert(step.longest().max(self.contact.least_limit));
        let part = if step.longest() > limit {
            let near = limit / step.longest();
            near * self.safe_part(&Move::new(from, &step.after(near)))
        } else {
            self.safe_part(&step)
        };
        let counts = &mut self.contact.counts;
        counts.moves += 1;
        if part < 1.0 {
            counts.shortened += 1;
            counts.left += part;
        }
        part
    }

    fn lag_friction(&mut self, resistance: &Resistance) {
        if !self.contact.friction.has_friction() {
            return;
        }
        let start = std::mem::take(&mut self.contact.friction.start);
        self.contact.search_at(&start);
        self.contact.neighbourhood.measure(&self.contact.search, &start);
        let neighbourhood = &self.contact.neighbourhood;
        let all = [neighbourhood.candidates(), neighbourhood.escaped()];
        let mut in_contact = all.map(|candidates| self.in_contact(candidates, &start, resistance)).concat();
        // Both kinds may hold the same pair.
        in_contact.sort_by_key(|(pair, ..)| *pair);
        in_contact.dedup_by_key(|(pair, ..)| *pair);
        let BarrierContact { friction, mesh, search, .. } = &mut *self.contact;
        friction.start = start;
        friction.lag(mesh, &in_contact, search.threads);
    }

    fn update_active_set(&mut self, x: &[Vector3<f64>], resistance: &Resistance) -> f64 {
        self.contact.refit(x);
        let mut added = self.newly_active(x);
        let mut blocking = std::mem::take(&mut self.contact.blocking);
        blocking.sort_unstable();
        blocking.dedup();
        let active = &self.contact.active;
        blocking.retain(|pair| !active.contains(pair) && added.binary_search_by_key(pair, |one| one.0).is_err());
        added.extend(blocking.into_iter().map(|pair| (pair, Closest::of(&pair, &pair.corners(x)))));
        let law = |(pair, closest): &(Pair, Closest)| {
            Law::new(self.contact.spacing(pair), along_normal(resistance, pair, closest))
        };
        let laws: Vec<Law> = added.iter().map(law).collect();
        let energy = |((_, closest), law): (&(Pair, Closest), &Law)| law.energy(law.apart(closest));
        let change = added.iter().zip(&laws).map(energy).sum();
        if !added.is_empty() {
            self.contact.active.extend(added.into_iter().map(|(pair, _)| pair).zip(laws).collect());
        }
        change
    }

    fn stiffness(&mut self, dofs: &DofMap, x: &[Vector3<f64>], sliding: SlidingStiffness) -> Vec<Vec<Contact>> {
        let BarrierContact { mesh, active, friction, neighbourhood, search, counts, .. } = &mut *self.contact;
        let rows = |pair: &Pair| {
            pair.vertices.map(|vertex| dofs.row(vertex as usize).map_or(Contact::FIXED, energy_solve::index))
        };
        let friction = friction.stiffness(x, sliding, search.threads);
        let with_stiffness = |part: &ActivePart<'_>| (part.len(), stiffness::contacts(part, &friction, mesh, rows, x));
        let (active, mut contacts): (Vec<usize>, Vec<_>) =
            active.evaluate(x, Order::Curvature, search.threads, with_stiffness).into_iter().unzip();
        if contacts.is_empty() {
            // No pair is active, but friction acts on the pairs in contact at the start of the step.
            contacts
                .push(friction.between(None, None).map(|(pair, one)| Contact { rows: rows(pair), ..one }).collect());
        }
        if !neighbourhood.is_restricted() {
            counts.active += active.iter().sum::<usize>() as u64;
            counts.systems += 1;
        }
        contacts
    }

    fn restrict(&mut self, moving: &[bool]) {
        self.contact.neighbourhood.restrict(moving, self.contact.search.threads);
        self.contact.active.restrict(moving);
    }

    fn release(&mut self) {
        self.contact.neighbourhood.release(self.contact.search.threads);
        self.contact.active.release();
    }

    fn most_pressed(&self, x: &[Vector3<f64>]) -> Option<Pressed> {
        self.contact.find_most_pressed(x)
    }

    fn counts(&self) -> ContactCounts {
        self.contact.counts
    }
}
