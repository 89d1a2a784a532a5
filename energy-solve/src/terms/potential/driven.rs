//! Potentials whose parameters change from step to step.

use std::fmt::Debug;

use energy_dsl::{Declaration, Element, Packed, PackedPotential, Vector3};

use super::named_stencils::NamedStencils;
use super::placed::PlacedPotentialTerm;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::terms::active::Active;
use crate::terms::counts::Tally;
use crate::terms::linearisation::Linearisation;
use crate::terms::places::BlockPlaces;
use crate::terms::restriction::Restriction;
use crate::terms::share::{Divisible, Share};
use crate::terms::state::{State, StepStart};
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, PlacedTerm, Quantity, Term, TermDescription};

/// Gives each element its parameters, which depend on the time or on the history of the motion.
pub trait DrivenLaw: Debug + Send + Sync {
    /// The element, declared as an energy.
    type Element: PackedPotential<f64> + Debug + Send + Sync + 'static;
    /// Returns the element of a stencil at a time, in s.
    fn element(&self, stencil: usize, time: f64) -> Self::Element;
    /// Whether elements differ between two times, in s, with the same history.
    fn varies(&self, _from: f64, _to: f64) -> bool {
        false
    }
    /// Advances the history at the end of a step. Returns whether an element changed.
    fn advance(&mut self, _stencils: Stencils<'_>, _x: &[Vector3<f64>]) -> bool {
        false
    }
    /// Returns the history, for a checkpoint; empty for a law without one.
    fn history(&self) -> Vec<f64> {
        Vec::new()
    }
    /// Restores what [`DrivenLaw::history`] returned.
    fn restore(&mut self, _history: &[f64]) {}
}

/// The forces −∇U of potentials whose parameters are fixed during a step and change between steps.
#[derive(Debug)]
pub struct DrivenTerm<L> {
    law: L,
    on: NamedStencils,
}

impl<L: DrivenLaw> DrivenTerm<L> {
    /// Creates a term for a law whose element has N points. Before the first step, elements are those of time 0.
    #[must_use]
    pub fn new<const N: usize>(name: String, law: L, stencils: &[[usize; N]]) -> Self {
        Self { law, on: NamedStencils::new(name, stencils) }
    }
}

const CHARACTER: Character = Character { symmetric: true, velocity_dependent: false, quadratic: false, curved: true };

impl<L: DrivenLaw> TermDescription for DrivenTerm<L> {
    fn name(&self) -> &str {
        &self.on.name
    }

    fn declaration(&self) -> &'static Declaration {
        <L::Element as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        CHARACTER
    }

    fn stencils(&self) -> Stencils<'_> {
        self.on.stencils()
    }
}

impl<L: DrivenLaw + 'static> Term for DrivenTerm<L> {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let active = Active::new(self.stencils(), dofs);
        let places = BlockPlaces::new(&active, self.stencils(), dofs, pattern);
        let now = renewed(&self, &active, &places, 0.0);
        Box::new(PlacedDrivenTerm { term: *self, active, places, shares: Vec::new(), now, time: 0.0, is_stale: false })
    }
}

/// A [`DrivenTerm`] within a system.
#[derive(Debug)]
struct PlacedDrivenTerm<L: DrivenLaw> {
    term: DrivenTerm<L>,
    active: Active,
    places: BlockPlaces,
    shares: Vec<Share>,
    /// The elements at [`PlacedDrivenTerm::time`].
    now: PlacedPotentialTerm<Packed<L::Element>>,
    time: f64,
    /// Whether the history changed since the elements were packed.
    is_stale: bool,
}

/// Packs the active elements at a time.
fn renewed<L: DrivenLaw>(
    term: &DrivenTerm<L>,
    active: &Active,
    places: &BlockPlaces,
    time: f64,
) -> PlacedPotentialTerm<Packed<L::Element>> {
    let elements: Vec<L::Element> = active.iter().map(|number| term.law.element(number, time)).collect();
    term.on.pack(&elements, active.clone(), places.clone())
}

impl<L: DrivenLaw> PlacedDrivenTerm<L> {
    fn renew(&mut self, time: f64) {
        self.now = renewed(&self.term, &self.active, &self.places, time);
        self.now.divide(&self.shares);
        (self.time, self.is_stale) = (time, false);
    }
}

impl<L: DrivenLaw> TermDescription for PlacedDrivenTerm<L> {
    fn name(&self) -> &str {
        self.term.name()
    }

    fn declaration(&self) -> &'static Declaration {
        self.term.declaration()
    }

    fn character(&self) -> Character {
        CHARACTER
    }

    fn stencils(&self) -> Stencils<'_> {
        self.term.stencils()
    }
}

impl<L: DrivenLaw> Divisible for PlacedDrivenTerm<L> {
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

impl<L: DrivenLaw> PlacedTerm for PlacedDrivenTerm<L> {
    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        self.now.restricted(restriction)
    }

    /// Takes the elements at the end of the step.
    fn begin_step(&mut self, start: StepStart<'_>) {
        let end = start.time + start.dt;
        if self.is_stale || self.term.law.varies(self.time, end) {
            self.renew(end);
        }
    }

    fn end_step(&mut self, state: State<'_>) {
        if self.term.law.advance(self.term.on.stencils(), state.x) {
            self.renew(self.time);
        }
    }

    fn is_driven(&self) -> bool {
        true
    }

    fn varies(&self, from: f64, to: f64) -> bool {
        self.term.law.varies(from, to)
    }

    fn history(&self) -> Vec<f64> {
        self.term.law.history()
    }

    fn restore_history(&mut self, history: &[f64]) {
        self.term.law.restore(history);
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
