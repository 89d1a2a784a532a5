use energy_dsl::Block;

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, Storage};
use crate::matrix::precision::Blocks;
use crate::matrix::vector::transposed;
use crate::terms::stencils::Stencils;

/// Scatter map for terms that add the blocks of symmetric elements one by one: for each pair of points (i, j), i ≤ j,
/// the block index in the matrix.
#[derive(Clone, Debug, Default)]
pub struct TrianglePlaces {
    /// Pairs per element.
    pairs: usize,
    places: Vec<Place>,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    slot: usize,
    /// Whether the pattern stores block (j, i) instead.
    is_transposed: bool,
    /// Index of block (j, i), if the pattern stores both.
    mirror: Option<usize>,
}

impl TrianglePlaces {
    /// Looks up the blocks of all elements. Blocks of pinned vertices map to [`Pattern::nowhere`].
    #[must_use]
    pub fn new(stencils: Stencils<'_>, dofs: &DofMap, pattern: &Pattern) -> Self {
        let n = stencils.arity();
        let mut places = Vec::new();
        for element in 0..stencils.len() {
            let row = |point: usize| dofs.place(stencils.vertex(element, point) as usize);
            let stored =
                |(i, j): (usize, usize)| row(i).zip(row(j)).and_then(|(row, column)| pattern.place(row, column));
            for i in 0..n {
                for j in i..n {
                    let (slot, is_transposed) = stored((i, j)).unwrap_or((pattern.nowhere(), false));
                    let mirrored = pattern.storage() == Storage::Whole && i != j;
                    let mirror = if mirrored { stored((j, i)) } else { None };
                    places.push(Place { slot, is_transposed, mirror: mirror.map(|(slot, _)| slot) });
                }
            }
        }
        Self { pairs: n * (n + 1) / 2, places }
    }

    /// Adds `weight` times the triangle of an element to a matrix.
    pub fn add(&self, element: usize, weight: f64, triangle: &[Block<f64>], matrix: &mut Blocks<'_>) {
        let places = &self.places[element * self.pairs..][..self.pairs];
        for (&Place { slot, is_transposed, mirror }, block) in places.iter().zip(triangle) {
            let other = transposed(block);
            matrix.add(slot, weight, if is_transposed { &other } else { block });
            if let Some(mirror) = mirror {
                matrix.add(mirror, weight, &other);
            }
        }
    }
}
