//! Potentials whose parameters change from step to step.

use std::fmt::Debug;

use energy_dsl::{Declaration, Element, Packed, PackedPotential, Vector3};

use super::changing::{Changing, PlacedChangingTerm};
use super::named_stencils::NamedStencils;
use super::placed::PlacedPotentialTerm;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::terms::active::Active;
use crate::terms::scatter_map::ScatterMaps;
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, PlacedTerm, Term, TermDescription};

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
    /// Takes the size of the next step, in s. Returns whether an element changed.
    fn begin_step(&mut self, _dt: f64) -> bool {
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
    pub(super) law: L,
    pub(super) on: NamedStencils,
}

impl<L: DrivenLaw> DrivenTerm<L> {
    /// Creates a term for a law whose element has N points. Before the first step, elements are those of time 0.
    #[must_use]
    pub fn new<const N: usize>(name: String, law: L, stencils: &[[usize; N]]) -> Self {
        Self { law, on: NamedStencils::new(name, stencils) }
    }
}

impl<L: DrivenLaw> TermDescription for DrivenTerm<L> {
    fn name(&self) -> &str {
        &self.on.name
    }

    fn declaration(&self) -> &Declaration {
        <L::Element as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, quadratic: false, curved: true }
    }

    fn stencils(&self) -> Stencils<'_> {
        self.on.stencils()
    }
}

impl<L: DrivenLaw + 'static> Changing for DrivenTerm<L> {
    type Packs = Packed<L::Element>;

    fn pack(&mut self, time: f64, active: &Active, maps: &ScatterMaps) -> PlacedPotentialTerm<Packed<L::Element>> {
        let elements: Vec<L::Element> = active.iter().map(|number| self.law.element(number, time)).collect();
        self.on.pack(&elements, active.clone(), maps.clone())
    }

    fn varies(&self, from: f64, to: f64) -> bool {
        self.law.varies(from, to)
    }

    fn begin_step(&mut self, dt: f64) -> bool {
        self.law.begin_step(dt)
    }

    fn advance(&mut self, x: &[Vector3<f64>]) -> bool {
        self.law.advance(self.on.stencils(), x)
    }

    fn history(&self) -> Vec<f64> {
        self.law.history()
    }

    fn restore(&mut self, history: &[f64]) {
        self.law.restore(history);
    }
}

impl<L: DrivenLaw + 'static> Term for DrivenTerm<L> {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        Box::new(PlacedChangingTerm::new(*self, dofs, pattern))
    }
}
