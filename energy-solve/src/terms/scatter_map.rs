use std::ops::Range;

use energy_dsl::BLOCK;

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::terms::active::Active;
use crate::terms::restriction::Restriction;
use crate::terms::stencils::Stencils;

/// Scatter maps of elements whose Hessians are symmetric.
#[derive(Clone, Debug, Default)]
pub struct ScatterMaps {
    /// ScatterMap of the blocks (i, j), i ≤ j.
    pub(crate) upper: ScatterMap,
    /// ScatterMap of the blocks (j, i), i < j, if the pattern stores both halves.
    pub(crate) mirrored: ScatterMap,
}

impl ScatterMaps {
    /// Looks up the blocks of all elements. Blocks of pinned vertices map to [`Pattern::nowhere`].
    #[must_use]
    pub fn of_all(stencils: Stencils<'_>, dofs: &DofMap, pattern: &Pattern) -> Self {
        Self::new(&Active::all(stencils.len()), stencils, dofs, pattern)
    }

    /// Looks up the blocks of the active elements.
    pub(crate) fn new(active: &Active, stencils: Stencils<'_>, dofs: &DofMap, pattern: &Pattern) -> Self {
        let n = stencils.arity();
        let maps = |pairs: &[_]| ScatterMap::new(active, stencils, pairs, dofs, pattern);
        let upper = maps(&(0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect::<Vec<_>>());
        let mirrored = match pattern.storage() {
            Storage::Upper => ScatterMap::default(),
            Storage::Whole => maps(&(0..n).flat_map(|i| (i + 1..n).map(move |j| (j, i))).collect::<Vec<_>>()),
        };
        Self { upper, mirrored }
    }

    /// Returns the maps of some of the elements to a restricted matrix.
    #[must_use]
    pub fn restricted(&self, elements: &[usize], restriction: &Restriction<'_>) -> Self {
        let (upper, mirrored) = (&self.upper, &self.mirrored);
        Self { upper: upper.restricted(elements, restriction), mirrored: mirrored.restricted(elements, restriction) }
    }

    /// Returns the maps of some of the elements.
    pub(crate) fn of(&self, elements: &[usize]) -> Self {
        Self { upper: self.upper.selected(elements), mirrored: self.mirrored.selected(elements) }
    }
}

/// Scatter map from elements to a matrix: the block index of each pair of an element's points. If the pattern stores
/// only block (j, i) of a pair, the block (i, j) is transposed first.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScatterMap {
    pairs: usize,
    /// Block indices, by element, then pair.
    slots: Vec<u32>,
    /// Masks, sorted by pack of elements, then pair: bit e is set if the block of element e must be transposed.
    transposed: Vec<u16>,
}

impl ScatterMap {
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
            let row = |point: usize| dofs.row(stencils.vertex(element, point) as usize);
            for (pair, &(i, j)) in pairs.iter().enumerate() {
                let found = row(i).zip(row(j)).and_then(|(row, column)| pattern.slot(row, column));
                let (slot, flipped) = found.unwrap_or((pattern.nowhere(), false));
                slots.push(index(slot));
                transposed[number / BLOCK * pairs.len() + pair] |= u16::from(flipped) << (number % BLOCK);
            }
        }
        Self { pairs: pairs.len(), slots, transposed }
    }

    /// Returns the map of some of the elements.
    fn selected(&self, elements: &[usize]) -> Self {
        let mut transposed = vec![0; elements.len().div_ceil(BLOCK) * self.pairs];
        for (number, &element) in elements.iter().enumerate() {
            for pair in 0..self.pairs {
                let flipped = self.transposed(element, pair) & 1;
                transposed[number / BLOCK * self.pairs + pair] |= u16::from(flipped == 1) << (number % BLOCK);
            }
        }
        let slots = elements.iter().flat_map(|&element| self.of(element..element + 1)).copied().collect();
        Self { pairs: self.pairs, slots, transposed }
    }

    /// Returns the map of some of the elements to a restricted matrix.
    pub(crate) fn restricted(&self, elements: &[usize], restriction: &Restriction<'_>) -> Self {
        let mut maps = self.selected(elements);
        maps.slots.iter_mut().for_each(|slot| *slot = restriction.slot(*slot));
        maps
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
