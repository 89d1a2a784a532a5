//! Terms with f = −∇U.

mod pack_energies;
mod placed;
mod work;

use std::fmt::Debug;

use energy_dsl::{Declaration, PackedPotential};

use self::placed::PlacedPotentialTerm;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::terms::element_list::ElementList;
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

impl<E: PackedPotential<f64> + Debug + Sync> TermDescription for PotentialTerm<E> {
    fn name(&self) -> &str {
        self.list.name()
    }

    fn declaration(&self) -> &'static Declaration {
        E::DECLARATION
    }

    fn character(&self) -> Character {
        character(E::DECLARATION)
    }

    fn stencils(&self) -> Stencils<'_> {
        self.list.stencils()
    }
}

impl<E: PackedPotential<f64> + Debug + Sync + 'static> Term for PotentialTerm<E> {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        Box::new(PlacedPotentialTerm::new(self.list, dofs, pattern))
    }
}

fn character(&Declaration { quadratic, curved, .. }: &Declaration) -> Character {
    Character { symmetric: true, velocity_dependent: false, quadratic, curved }
}
