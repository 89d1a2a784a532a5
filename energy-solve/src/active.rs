//! Elements with a free vertex, and their points.

use energy_dsl::{Array, Vector3};

use crate::dofs::DofMap;
use crate::pattern::index;
use crate::term::Stencils;

/// The elements with a free vertex.
pub(crate) fn active_elements(stencils: Stencils<'_>, dofs: &DofMap) -> Vec<u32> {
    let is_active = |stencil: &[u32]| stencil.iter().any(|&vertex| dofs.place(vertex as usize).is_some());
    stencils.iter().enumerate().filter(|(_, stencil)| is_active(stencil)).map(|(element, _)| index(element)).collect()
}

/// The vectors of an element's vertices.
#[inline(always)]
pub(crate) fn points_of<Points: Array<Vector3<f64>>>(stencil: &[u32], all: &[Vector3<f64>]) -> Points {
    Points::from_fn(|point| all[stencil[point] as usize])
}
