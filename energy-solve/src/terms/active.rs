//! Elements with a free vertex, and their points.

use energy_dsl::{Array, Vector3};

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::index;
use crate::terms::stencils::Stencils;

/// The active elements, which are evaluated: those with a free vertex.
#[derive(Clone, Debug, Default)]
pub(crate) struct Active {
    count: usize,
    /// Indices of the active elements; `None` if every element is active.
    indices: Option<Vec<u32>>,
}

impl Active {
    pub(crate) fn new(stencils: Stencils<'_>, dofs: &DofMap) -> Self {
        let is_free = |vertex: u32| dofs.row(vertex as usize).is_some();
        let active = || (0..stencils.len()).filter(|&element| stencils.stencil(element).any(is_free));
        let count = active().count();
        let indices = (count < stencils.len()).then(|| active().map(index).collect());
        Self { count, indices }
    }

    /// Every one of `count` elements.
    pub(crate) fn all(count: usize) -> Self {
        Self { count, indices: None }
    }

    /// The elements with these indices.
    pub(crate) fn some(indices: Vec<u32>) -> Self {
        Self { count: indices.len(), indices: Some(indices) }
    }

    /// Whether every element is active.
    pub(crate) fn is_all(&self) -> bool {
        self.indices.is_none()
    }

    /// Returns the number of active elements.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Returns the index, among all elements, of an active element.
    #[inline(always)]
    pub(crate) fn element(&self, number: usize) -> usize {
        self.indices.as_ref().map_or(number, |indices| indices[number] as usize)
    }

    /// Returns the indices, among all elements, of the active ones.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> {
        (0..self.count).map(|number| self.element(number))
    }
}

/// Gathers the vectors of an element's vertices.
#[inline(always)]
pub(crate) fn points_of<Points: Array<Vector3<f64>>>(stencil: &[u32], all: &[Vector3<f64>]) -> Points {
    Points::from_fn(|point| all[stencil[point] as usize])
}
