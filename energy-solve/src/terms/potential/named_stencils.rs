use std::fmt::Debug;

use energy_dsl::{Packed, PackedPotential};

use super::placed::PlacedPotentialTerm;
use crate::matrix::pattern::index;
use crate::terms::active::Active;
use crate::terms::scatter_map::ScatterMaps;
use crate::terms::stencils::Stencils;

/// The name and the stencils of a term whose elements are created again when they change.
#[derive(Debug)]
pub(super) struct NamedStencils {
    pub name: String,
    pub vertices: Vec<u32>,
    pub arity: usize,
}

impl NamedStencils {
    pub fn new<const N: usize>(name: String, stencils: &[[usize; N]]) -> Self {
        let vertices = stencils.as_flattened().iter().copied().map(index).collect();
        Self { name, vertices, arity: N }
    }

    pub fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.arity, &self.vertices)
    }

    /// Packs the active elements, which write by `maps`.
    pub fn pack<E: PackedPotential<f64> + Debug + Send + Sync + 'static>(
        &self,
        elements: &[E],
        active: Active,
        maps: ScatterMaps,
    ) -> PlacedPotentialTerm<Packed<E>> {
        let stencils = self.stencils();
        let vertex = |number: usize, point: usize| stencils.vertex(active.element(number), point);
        let packed = Packed::from_fn(elements.len(), self.arity, |number| &elements[number], vertex);
        let all = (stencils.len(), self.vertices.clone());
        PlacedPotentialTerm::with_maps(self.name.clone(), all, (active, packed), maps)
    }
}
