//! Elements with a free vertex, and their points.

use energy_dsl::{Array, Vector3};

use crate::dofs::DofMap;
use crate::term::Stencils;

/// The elements with a free vertex.
pub(crate) fn active_elements(stencils: Stencils<'_>, dofs: &DofMap) -> Vec<usize> {
    let is_active = |stencil: &[usize]| stencil.iter().any(|&vertex| dofs.place(vertex).is_some());
    stencils.iter().enumerate().filter(|(_, stencil)| is_active(stencil)).map(|(element, _)| element).collect()
}

/// The vectors of an element's vertices.
pub(crate) fn points_of<Points: Array<Vector3<f64>>>(stencil: &[usize], all: &[Vector3<f64>]) -> Points {
    Points::from_fn(|point| all[stencil[point]])
}
