//! Potentials whose elements change between steps, within a system.

use energy_dsl::Vector3;

use super::evaluated::Evaluated;
use super::placed::PlacedPotentialTerm;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::terms::active::Active;
use crate::terms::counts::Tally;
use crate::terms::linearisation::Linearisation;
use crate::terms::restriction::Restriction;
use crate::terms::scatter_map::ScatterMaps;
use crate::terms::share::{Divisible, Share};
use crate::terms::state::{State, StepStart};
use crate::terms::term::{MadeFromTerm, PlacedTerm, Quantity, TermDescription};

/// A term whose elements are packed again when they change. They stay fixed during a step.
pub(super) trait Changing: TermDescription + Sync + 'static {
    /// The packed elements.
    type Packs: Evaluated;
    /// Packs the active elements at a time, in s.
    fn pack(&mut self, time: f64, active: &Active, maps: &ScatterMaps) -> PlacedPotentialTerm<Self::Packs>;
    /// Whether elements differ between two times, in s, or from those that were packed.
    fn varies(&self, from: f64, to: f64) -> bool;
    /// Takes the size of the next step, in s. Returns whether an element changed.
    fn begin_step(&mut self, _dt: f64) -> bool {
        false
    }
    /// Advances the history at the end of a step. Returns whether an element changed.
    fn advance(&mut self, _x: &[Vector3<f64>]) -> bool {
        false
    }
    /// Returns the history, for a checkpoint; empty for a term without one.
    fn history(&self) -> Vec<f64> {
        Vec::new()
    }
    /// Restores what [`Changing::history`] returned.
    fn restore(&mut self, _history: &[f64]) {}
}

/// A [`Changing`] term within a system.
#[derive(Debug)]
pub(super) struct PlacedChangingTerm<T: Changing> {
    term: T,
    active: Active,
    maps: ScatterMaps,
    shares: Vec<Share>,
    /// The elements at [`PlacedChangingTerm::time`].
    now: PlacedPotentialTerm<T::Packs>,
    time: f64,
    /// Whether the history changed since the elements were packed.
    is_stale: bool,
}

impl<T: Changing> PlacedChangingTerm<T> {
    /// Packs the elements of time 0.
    pub(super) fn new(mut term: T, dofs: &DofMap, pattern: &Pattern) -> Self {
        let active = Active::new(term.stencils(), dofs);
        let maps = match term.character().curved {
            true => ScatterMaps::new(&active, term.stencils(), dofs, pattern),
            false => ScatterMaps::default(),
        };
        let now = term.pack(0.0, &active, &maps);
        Self { term, active, maps, shares: Vec::new(), now, time: 0.0, is_stale: false }
    }

    fn renew(&mut self, time: f64) {
        self.now = self.term.pack(time, &self.active, &self.maps);
        self.now.divide(&self.shares);
        (self.time, self.is_stale) = (time, false);
    }
}

impl<T: Changing> MadeFromTerm for PlacedChangingTerm<T> {
    fn term(&self) -> &dyn TermDescription {
        &self.term
    }
}

impl<T: Changing> Divisible for PlacedChangingTerm<T> {
    fn energy_parts(&self) -> usize {
        self.now.energy_parts()
    }

    fn energy_part(&self, part: usize, x: &[Vector3<f64>]) -> (f64, Tally) {
        self.now.energy_part(part, x)
    }

    fn add_force_of(&self, share: &Share, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.now.add_force_of(share, state, force)
    }

    fn add_linearisation_of(&self, share: &Share, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        self.now.add_linearisation_of(share, state, sum)
    }
}

impl<T: Changing> PlacedTerm for PlacedChangingTerm<T> {
    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        self.now.restricted(restriction)
    }

    /// Takes the elements at the end of the step.
    fn begin_step(&mut self, start: StepStart<'_>) {
        let end = start.time + start.dt;
        self.is_stale |= self.term.begin_step(start.dt);
        if self.is_stale || self.term.varies(self.time, end) {
            self.renew(end);
        }
    }

    fn end_step(&mut self, state: State<'_>) {
        if self.term.advance(state.x) {
            self.renew(self.time);
        }
    }

    fn is_driven(&self) -> bool {
        true
    }

    fn varies(&self, from: f64, to: f64) -> bool {
        self.term.varies(from, to)
    }

    fn history(&self) -> Vec<f64> {
        self.term.history()
    }

    fn restore_history(&mut self, history: &[f64]) {
        self.term.restore(history);
        self.is_stale = true;
    }

    fn divide(&mut self, shares: &[Share]) {
        shares.clone_into(&mut self.shares);
        self.now.divide(shares);
    }

    fn divisible(&self) -> Option<&dyn Divisible> {
        Some(self)
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        self.now.energy(x)
    }

    fn energy_found(&self) -> Option<f64> {
        self.now.energy_found()
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        self.now.element_energies(x)
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.now.add_force(state, force)
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        self.now.add_linearisation(state, sum)
    }

    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize> {
        self.now.find_non_finite(quantity, state)
    }
}
