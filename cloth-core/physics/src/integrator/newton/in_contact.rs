//! Contact within a step of Newton's method: every move is filtered, and energies are evaluated at certified states.

use std::time::Instant;

use energy_dsl::Vector3;
use energy_solve::{BlockMatrix, Contact, Pressed, Resistance, SlidingStiffness};

use super::super::ContactWork;
use super::incremental_potential::IncrementalPotential;
use super::pins::shared;

impl IncrementalPotential<'_> {
    /// Shortens the move to the first iterate x until it is certain to have no crossing. Returns the part of their way
    /// that pins and obstacles have gone.
    pub(super) fn filter_warm_start(&mut self, x: &mut Vec<Vector3<f64>>) -> f64 {
        let to = std::mem::replace(x, self.body.x.clone());
        let certified = self.filter_step(x, &to);
        let is_prescribed = |vertex: usize| self.body.system.dofs().row(vertex).is_none();
        let is_driven = (0..x.len()).any(|vertex| is_prescribed(vertex) && self.body.v[vertex] != [0.0; 3]);
        let part = if is_driven { shared(certified) } else { certified };
        blend(x, &to, part);
        if is_driven { part } else { 1.0 }
    }

    /// Returns the part of the straight move that is certified to have no crossing.
    pub(super) fn filter_step(&mut self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64 {
        let Some(contact) = &mut self.contact else { return 1.0 };
        let started = Instant::now();
        let part = contact.filter_step(from, to);
        self.report.contact = ContactWork::between(&self.counted, &contact.counts());
        self.report.phases.collision += started.elapsed();
        part
    }

    /// Begins contact at the first iterate x: friction is lagged, and pairs get a stiffness in proportion to that of an
    /// assembled matrix.
    pub(super) fn begin_contact(&mut self, x: &[Vector3<f64>], matrix: &BlockMatrix<f32>) {
        let Some(contact) = &mut self.contact else { return };
        let started = Instant::now();
        let per_square = 1.0 / (self.dt * self.dt);
        let inertia: Vec<f64> = self.body.masses.iter().map(|mass| per_square * mass).collect();
        let dofs = self.body.system.dofs();
        let block = |row: usize| matrix.diagonal(row).map(|row| row.map(|entry| per_square * f64::from(entry)));
        let resistance = Resistance::new(dofs, (0..dofs.free().len()).map(block), inertia);
        contact.lag_friction(&resistance);
        self.resistance = Some(resistance);
        self.report.phases.contact += started.elapsed();
        self.update_active_set(x);
    }

    /// Adds the pairs that become active at x. Returns the change of E there.
    pub(super) fn update_active_set(&mut self, x: &[Vector3<f64>]) -> f64 {
        let (Some(contact), Some(resistance)) = (&mut self.contact, &self.resistance) else { return 0.0 };
        let started = Instant::now();
        let change = self.dt * self.dt * contact.update_active_set(x, resistance);
        self.report.phases.collision += started.elapsed();
        change
    }

    /// The contribution of contact to E.
    pub(super) fn contact_energy(&self, x: &[Vector3<f64>]) -> f64 {
        self.contact.as_ref().map_or(0.0, |contact| self.dt * self.dt * contact.energy(x))
    }

    /// Adds the contribution of contact to −∇E of the free vertices.
    pub(super) fn add_contact(&mut self, x: &[Vector3<f64>], downhill: &mut [Vector3<f64>]) {
        let Some(contact) = &self.contact else { return };
        let started = Instant::now();
        let square = self.dt * self.dt;
        let mut force = vec![[0.0; 3]; x.len()];
        contact.add_force(x, &mut force);
        for (downhill, &vertex) in downhill.iter_mut().zip(self.body.system.dofs().free()) {
            for axis in 0..3 {
                downhill[axis] += square * force[vertex][axis];
            }
        }
        self.report.phases.contact += started.elapsed();
    }

    /// Returns where contact presses the most at x.
    pub(super) fn most_pressed(&self, x: &[Vector3<f64>]) -> Option<Pressed> {
        self.contact.as_ref()?.most_pressed(x)
    }

    /// Returns the stiffness of the contacts, in N/m.
    pub(super) fn contacts(&mut self, x: &[Vector3<f64>], sliding: SlidingStiffness) -> Vec<Vec<Contact>> {
        let Some(contact) = &mut self.contact else { return Vec::new() };
        let started = Instant::now();
        let contacts = contact.stiffness(self.body.system.dofs(), x, sliding);
        self.report.contact = ContactWork::between(&self.counted, &contact.counts());
        self.report.phases.contact += started.elapsed();
        contacts
    }

    /// Does some work during which only these vertices move.
    pub(super) fn restricted_to<R>(&mut self, moving: &[bool], work: impl FnOnce(&mut Self) -> R) -> R {
        let started = Instant::now();
        self.contact.iter_mut().for_each(|contact| contact.restrict(moving));
        self.report.phases.collision += started.elapsed();
        let done = work(self);
        let started = Instant::now();
        self.contact.iter_mut().for_each(|contact| contact.release());
        self.report.phases.collision += started.elapsed();
        done
    }
}

/// x ← x + s (y − x); exactly y for s = 1.
fn blend(x: &mut [Vector3<f64>], y: &[Vector3<f64>], s: f64) {
    if s == 1.0 {
        x.copy_from_slice(y);
        return;
    }
    for (x, y) in x.iter_mut().zip(y) {
        for axis in 0..3 {
            x[axis] += s * (y[axis] - x[axis]);
        }
    }
}
