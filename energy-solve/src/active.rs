//! Elements with a free vertex, and their points.

use energy_dsl::{Array, Vector3};

use crate::dofs::DofMap;
use crate::pattern::index;
use crate::term::Stencils;

/// The elements that are evaluated: those with a free vertex.
#[derive(Clone, Debug, Default)]
pub(crate) struct Active {
    count: usize,
    /// Which they are, unless all are.
    chosen: Option<Vec<u32>>,
}

impl Active {
    pub(crate) fn new(stencils: Stencils<'_>, dofs: &DofMap) -> Self {
        let is_active = |stencil: &[u32]| stencil.iter().any(|&vertex| dofs.place(vertex as usize).is_some());
        let active = || stencils.iter().enumerate().filter(|(_, stencil)| is_active(stencil));
        let count = active().count();
        let chosen = (count < stencils.iter().len()).then(|| active().map(|(element, _)| index(element)).collect());
        Self { count, chosen }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// The index among all elements.
    #[inline(always)]
    pub(crate) fn element(&self, number: usize) -> usize {
        self.chosen.as_ref().map_or(number, |chosen| chosen[number] as usize)
    }

    /// All indices.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> {
        (0..self.count).map(|number| self.element(number))
    }
}

/// The vectors of an element's vertices.
#[inline(always)]
pub(crate) fn points_of<Points: Array<Vector3<f64>>>(stencil: &[u32], all: &[Vector3<f64>]) -> Points {
    Points::from_fn(|point| all[stencil[point] as usize])
}
