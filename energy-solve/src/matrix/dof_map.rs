use energy_dsl::Vector3;

use crate::matrix::pattern::index;

/// Marks a pinned vertex in [`DofMap::row`].
const PINNED: u32 = u32::MAX;

/// Maps vertices to the rows of a vector or matrix over the free vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DofMap {
    /// The row of each vertex; [`PINNED`] if it is pinned.
    rows: Vec<u32>,
    free: Vec<usize>,
}

impl DofMap {
    /// Creates the map; vertex i is pinned if `pinned[i]`.
    #[must_use]
    pub fn new(pinned: &[bool]) -> Self {
        let mut free: Vec<usize> = (0..pinned.len()).filter(|&vertex| !pinned[vertex]).collect();
        free.shrink_to_fit();
        let mut rows = vec![PINNED; pinned.len()];
        for (number, &vertex) in free.iter().enumerate() {
            rows[vertex] = index(number);
        }
        Self { rows, free }
    }

    /// Returns the row of a vertex; `None` if it is pinned.
    #[must_use]
    pub fn row(&self, vertex: usize) -> Option<usize> {
        let row = self.rows[vertex];
        (row != PINNED).then_some(row as usize)
    }

    /// Returns the free vertices, ascending.
    #[must_use]
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Returns the number of vertices, including pinned ones.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.rows.len()
    }

    /// Returns the entries of the free vertices.
    #[must_use]
    pub fn gather(&self, all: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        self.free.iter().map(|&vertex| all[vertex]).collect()
    }
}
