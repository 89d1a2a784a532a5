use energy_dsl::Block;

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, Storage};
use crate::matrix::precision::Blocks;
use crate::matrix::vector::transposed;
use crate::terms::stencils::Stencils;

/// Where the blocks of symmetric elements go, for terms that add them one by one: of each pair of points (i, j), i ≤ j, in the order of
/// an element's triangle.
#[derive(Clone, Debug, Default)]
pub struct TrianglePlaces {
    /// Pairs of an element.
    pairs: usize,
    places: Vec<Place>,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    slot: usize,
    /// Whether block (j, i) is what is stored.
    turned: bool,
    /// Where block (j, i) is stored as well, if all are.
    mirror: Option<usize>,
}

impl TrianglePlaces {
    /// The places of all elements with these stencils. Blocks of pinned vertices go nowhere.
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
                    let (slot, turned) = stored((i, j)).unwrap_or((pattern.nowhere(), false));
                    let mirrored = pattern.storage() == Storage::Whole && i != j;
                    let mirror = if mirrored { stored((j, i)) } else { None };
                    places.push(Place { slot, turned, mirror: mirror.map(|(slot, _)| slot) });
                }
            }
        }
        Self { pairs: n * (n + 1) / 2, places }
    }

    /// Adds `weight` times the triangle of an element to the blocks of a matrix.
    pub fn add(&self, element: usize, weight: f64, triangle: &[Block<f64>], matrix: &mut Blocks<'_>) {
        let places = &self.places[element * self.pairs..][..self.pairs];
        for (&Place { slot, turned, mirror }, block) in places.iter().zip(triangle) {
            let other = transposed(block);
            matrix.add(slot, weight, if turned { &other } else { block });
            if let Some(mirror) = mirror {
                matrix.add(mirror, weight, &other);
            }
        }
    }
}
