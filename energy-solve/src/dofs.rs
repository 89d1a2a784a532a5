use energy_dsl::Vector3;

/// Which vertices move, and their places in a vector of free vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DofMap {
    place: Vec<Option<usize>>,
    free: Vec<usize>,
}

impl DofMap {
    /// Vertex i is pinned where `pinned[i]`.
    #[must_use]
    pub fn new(pinned: &[bool]) -> Self {
        let free: Vec<usize> = (0..pinned.len()).filter(|&vertex| !pinned[vertex]).collect();
        let mut place = vec![None; pinned.len()];
        for (index, &vertex) in free.iter().enumerate() {
            place[vertex] = Some(index);
        }
        Self { place, free }
    }

    /// The place of a vertex among the free ones; `None` when it is pinned.
    #[must_use]
    pub fn place(&self, vertex: usize) -> Option<usize> {
        self.place[vertex]
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
