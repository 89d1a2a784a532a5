//! Elements with a free vertex, and their points.

use energy_dsl::{Array, Vector3};

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::index;
use crate::terms::stencils::Stencils;

/// The elements that are evaluated: those with a free vertex.
#[derive(Clone, Debug, Default)]
pub(crate) struct Active {
    count: usize,
    /// Which they are, unless all are.
    chosen: Option<Vec<u32>>,
}

impl Active {
    pub(crate) fn new(stencils: Stencils<'_>, dofs: &DofMap) -> Self {
        let is_free = |vertex: u32| dofs.place(vertex as usize).is_some();
        let active = || (0..stencils.len()).filter(|&element| stencils.stencil(element).any(is_free));
        let count = active().count();
        let chosen = (count < stencils.len()).then(|| active().map(index).collect());
        Self { count, chosen }
    }

    /// Whether there are no others.
    pub(crate) fn is_all(&self) -> bool {
        self.chosen.is_none()
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
