use std::ops::Range;

use energy_dsl::BLOCK;

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, index};
use crate::terms::active::Active;
use crate::terms::stencils::Stencils;

/// Where the blocks of elements go: for each pair of an element's points one place in the matrix, for which block (i, j) may have to be
/// transposed to block (j, i).
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    pairs: usize,
    /// By element, pair.
    slots: Vec<u32>,
    /// By block of elements, pair: bit e is set where the pair of element e is transposed.
    transposed: Vec<u16>,
}

impl Places {
    /// The places of the `active` elements, pairs of points in the order of `pairs`.
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

    /// Whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The places of the pairs of elements, one element after the other.
    #[inline(always)]
    pub(crate) fn of(&self, elements: Range<usize>) -> &[u32] {
        &self.slots[elements.start * self.pairs..elements.end * self.pairs]
    }

    /// Bit e is set where the pair of element `first` + e is transposed.
    #[inline(always)]
    pub(crate) fn transposed(&self, first: usize, pair: usize) -> u32 {
        u32::from(self.transposed[first / BLOCK * self.pairs + pair] >> (first % BLOCK))
    }
}
