//! Terms with f = −∇U.

mod changing;
mod dissipation;
mod driven;
mod evaluated;
mod named_stencils;
mod pack_energies;
mod placed;
mod stateful;
mod steered;
mod tapes;
mod waiting;
mod work;

use std::fmt::Debug;
use std::sync::Arc;

use energy_dsl::tape::TapeElements;
use energy_dsl::{Declaration, Packed, PackedPotential};

use self::changing::PlacedChangingTerm;
pub use self::dissipation::{DissipationLaw, DissipationTerm};
pub use self::driven::{DrivenLaw, DrivenTerm};
use self::placed::PlacedPotentialTerm;
pub use self::stateful::StatefulLaw;
use self::stateful::StatefulTapes;
pub use self::steered::{SteeredTapeTerm, SteeredTapes};
use self::tapes::TapePacks;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, index};
use crate::terms::active::Active;
use crate::terms::element_list::ElementList;
use crate::terms::scatter_map::ScatterMaps;
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, PlacedTerm, Term, TermDescription};

/// A term with f = −∇U: independent of velocity, with symmetric Jacobians.
///
/// Elements are evaluated in SIMD lanes. Sums run in the order of the elements, so results do not depend on the number
/// of lanes.
#[derive(Debug)]
pub struct PotentialTerm<E> {
    list: ElementList<E>,
}

impl<E: PackedPotential<f64>> PotentialTerm<E> {
    /// Creates the sum of the potentials of a list. Hessians that the declaration proves zero (gravity's) are never
    /// evaluated.
    #[must_use]
    pub fn new(list: ElementList<E>) -> Self {
        Self { list }
    }
}

impl<E: PackedPotential<f64> + Debug + Send + Sync> TermDescription for PotentialTerm<E> {
    fn name(&self) -> &str {
        self.list.name()
    }

    fn declaration(&self) -> &Declaration {
        E::DECLARATION
    }

    fn character(&self) -> Character {
        character(E::DECLARATION)
    }

    fn stencils(&self) -> Stencils<'_> {
        self.list.stencils()
    }
}

impl<E: PackedPotential<f64> + Debug + Send + Sync + 'static> Term for PotentialTerm<E> {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let list = self.list;
        let (stencils, count) = (list.stencils(), list.elements().len());
        let active = Active::new(stencils, dofs);
        let vertex = |number: usize, point: usize| stencils.vertex(active.element(number), point);
        let element = |number: usize| &list.elements()[active.element(number)];
        let packed = Packed::from_fn(active.len(), list.arity(), element, vertex);
        let (name, vertices) = list.into_name_and_vertices();
        Box::new(PlacedPotentialTerm::new(name, (count, vertices), (active, packed), dofs, pattern))
    }
}

/// A term with f = −∇U whose elements were read at run time. It does what [`PotentialTerm`] does, with the same bits;
/// routines are interpreted, a block of elements at a time. Elements with a state take their next one at the end of each
/// step.
#[derive(Clone, Debug)]
pub struct TapeTerm {
    name: String,
    declaration: Arc<Declaration>,
    elements: TapeElements,
    vertices: Vec<u32>,
}

impl TapeTerm {
    /// Creates the sum of the energies of some elements. Each stencil has as many `vertices` as the declaration has
    /// points; they follow each other.
    ///
    /// # Panics
    /// When the declaration is not an energy or constraint, or there are not as many stencils as elements.
    #[must_use]
    pub fn new(
        name: String,
        declaration: &Arc<Declaration>,
        elements: TapeElements,
        vertices: impl IntoIterator<Item = usize>,
    ) -> Self {
        let vertices: Vec<u32> = vertices.into_iter().map(index).collect();
        assert!(elements.routines().expansion.is_some(), "{name}: {} is no energy", declaration.name);
        assert_eq!(vertices.len(), elements.len() * declaration.points.len(), "{name}: every element needs a stencil");
        Self { name, declaration: Arc::clone(declaration), elements, vertices }
    }

    /// Returns the active elements, which write by `maps`.
    fn packed(&self, active: &Active, maps: &ScatterMaps) -> PlacedPotentialTerm<TapePacks> {
        let all = (self.elements.len(), self.vertices.clone());
        let packed = TapePacks::of_active(&self.declaration, self.elements.clone(), self.stencils(), active);
        PlacedPotentialTerm::with_maps(self.name.clone(), all, (active.clone(), packed), maps.clone())
    }
}

impl TermDescription for TapeTerm {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn character(&self) -> Character {
        character(&self.declaration)
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.declaration.points.len(), &self.vertices)
    }
}

impl Term for TapeTerm {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        if !self.declaration.state.is_empty() {
            return Box::new(PlacedChangingTerm::new(StatefulTapes::new(*self), dofs, pattern));
        }
        let stencils = self.stencils();
        let active = Active::new(stencils, dofs);
        let packed = TapePacks::of_active(&self.declaration, self.elements.clone(), stencils, &active);
        let Self { name, elements, vertices, .. } = *self;
        Box::new(PlacedPotentialTerm::new(name, (elements.len(), vertices), (active, packed), dofs, pattern))
    }
}

fn character(&Declaration { quadratic, curved, ref state, .. }: &Declaration) -> Character {
    // A state may change second derivatives that are constant during a step.
    Character { symmetric: true, velocity_dependent: false, quadratic: quadratic && state.is_empty(), curved }
}
