use energy_dsl::Vector3;

use crate::matrix::pattern::index;

/// The place of a vertex that has none.
const PINNED: u32 = u32::MAX;

/// Which vertices move, and their places in a vector of free vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DofMap {
    /// [`PINNED`] for a pinned one.
    place: Vec<u32>,
    free: Vec<usize>,
}

impl DofMap {
    /// Vertex i is pinned where `pinned[i]`.
    #[must_use]
    pub fn new(pinned: &[bool]) -> Self {
        let mut free: Vec<usize> = (0..pinned.len()).filter(|&vertex| !pinned[vertex]).collect();
        free.shrink_to_fit();
        let mut place = vec![PINNED; pinned.len()];
        for (number, &vertex) in free.iter().enumerate() {
            place[vertex] = index(number);
        }
        Self { place, free }
    }

    /// The place of a vertex among the free ones; `None` when it is pinned.
    #[must_use]
    pub fn place(&self, vertex: usize) -> Option<usize> {
        let place = self.place[vertex];
        (place != PINNED).then_some(place as usize)
    }

    /// The free vertices in ascending order.
    #[must_use]
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// The number of vertices, pinned ones included.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.place.len()
    }

    /// The entries of the free vertices.
    #[must_use]
    pub fn gather(&self, all: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        self.free.iter().map(|&vertex| all[vertex]).collect()
    }
}
