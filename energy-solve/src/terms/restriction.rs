use crate::matrix::dof_map::DofMap;
use crate::terms::stencils::Stencils;

/// A choice of free vertices of a system; the others are fixed.
///
/// [`PlacedTerm::restricted`](crate::PlacedTerm::restricted) uses it to find the elements that remain, and the slots
/// of their blocks in the smaller matrix.
#[derive(Debug)]
pub struct Restriction<'a> {
    pub(crate) dofs: &'a DofMap,
    /// The index of each block of the whole matrix in the restricted one.
    pub(crate) slots: &'a [u32],
}

impl Restriction<'_> {
    /// Returns the elements, among those with these indices, that have a chosen vertex, as positions in `elements`.
    pub fn remaining(&self, elements: impl Iterator<Item = usize>, stencils: Stencils<'_>) -> Vec<usize> {
        let is_chosen = |vertex: u32| self.dofs.row(vertex as usize).is_some();
        let remains = |&(_, element): &(usize, usize)| stencils.stencil(element).any(is_chosen);
        elements.enumerate().filter(remains).map(|(position, _)| position).collect()
    }

    /// Returns the index, in the restricted matrix, of a block of the whole matrix;
    /// [`Pattern::nowhere`](crate::Pattern::nowhere) if the block is left out.
    #[must_use]
    pub fn slot(&self, slot: u32) -> u32 {
        self.slots[slot as usize]
    }
}
