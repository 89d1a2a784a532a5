use std::ops::Range;

use energy_dsl::BLOCK;

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, index};
use crate::terms::active::Active;
use crate::terms::stencils::Stencils;

/// Scatter map from elements to a matrix: the block index of each pair of an element's points. If the pattern stores
/// only block (j, i) of a pair, the block (i, j) is transposed first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    pairs: usize,
    /// Block indices, by element, then pair.
    slots: Vec<u32>,
    /// Masks, sorted by pack of elements, then pair: bit e is set if the block of element e must be transposed.
    transposed: Vec<u16>,
}

impl Places {
    /// Looks up the blocks of the active elements, for each of the `pairs` of points.
    pub(crate) fn new(
        active: &Active,
        stencils: Stencils<'_>,
        pairs: &[(usize, usize)],
        dofs: &DofMap,
        pattern: &Pattern,
    ) -> Self {
        let mut slots = Vec::with_capacity(active.len() * pairs.len());
        let mut transposed = vec![0; active.len().div_ceil(BLOCK) * pairs.len()];
        for (number, element) in active.iter().enumerate() {
            let row = |point: usize| dofs.place(stencils.vertex(element, point) as usize);
            for (pair, &(i, j)) in pairs.iter().enumerate() {
                let place = row(i).zip(row(j)).and_then(|(row, column)| pattern.place(row, column));
                let (slot, flipped) = place.unwrap_or((pattern.nowhere(), false));
                slots.push(index(slot));
                transposed[number / BLOCK * pairs.len() + pair] |= u16::from(flipped) << (number % BLOCK);
            }
        }
        Self { pairs: pairs.len(), slots, transposed }
    }

    /// Whether the map is empty.
    pub(crate) fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Returns the block indices of a range of elements, one element after the other.
    #[inline(always)]
    pub(crate) fn of(&self, elements: Range<usize>) -> &[u32] {
        &self.slots[elements.start * self.pairs..elements.end * self.pairs]
    }

    /// Returns a mask: bit e is set if the pair's block of element `first` + e must be transposed.
    #[inline(always)]
    pub(crate) fn transposed(&self, first: usize, pair: usize) -> u32 {
        u32::from(self.transposed[first / BLOCK * self.pairs + pair] >> (first % BLOCK))
    }
}
