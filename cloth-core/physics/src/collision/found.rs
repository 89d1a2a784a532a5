//! The pairs that a search found, in order.

use energy_solve::threads::{concatenated, for_each};

use super::{CollisionMesh, Pair, PairKind};

/// Fewer pairs are put in order on one thread.
const FEW_PAIRS: usize = 4096;

/// Features by their numbers in the mesh's lists, as pairs are ordered.
pub(super) type Features = [u32; 2];

/// The features that a search found.
#[derive(Default)]
pub(super) struct Found {
    pub on_triangles: Vec<Features>,
    pub of_edges: Vec<Features>,
}

impl Found {
    pub fn all(parts: &[Self]) -> Self {
        let on_triangles: Vec<_> = parts.iter().map(|part| &part.on_triangles[..]).collect();
        let of_edges: Vec<_> = parts.iter().map(|part| &part.of_edges[..]).collect();
        Self { on_triangles: on_triangles.concat(), of_edges: of_edges.concat() }
    }

    /// Drops the pairs without one of some vertices.
    pub fn keep_around(&mut self, mesh: &CollisionMesh, is_one: &[bool]) {
        let has_one = |vertices: &[u32]| vertices.iter().any(|vertex| is_one[*vertex as usize]);
        self.on_triangles.retain(|[point, triangle]| {
            is_one[mesh.points()[*point as usize] as usize] || has_one(&mesh.triangles()[*triangle as usize])
        });
        self.of_edges.retain(|edges| edges.iter().any(|edge| has_one(&mesh.edges()[*edge as usize])));
    }

    /// Returns the pairs once and in order.
    pub fn in_order(self, mesh: &CollisionMesh, threads: usize) -> Vec<Pair> {
        let Self { on_triangles, of_edges } = self;
        let threads = if on_triangles.len() + of_edges.len() < FEW_PAIRS { 1 } else { threads };
        let kinds = vec![(PairKind::PointTriangle, on_triangles), (PairKind::EdgeEdge, of_edges)];
        concatenated(for_each(threads, kinds, |(kind, features)| pairs_in_order(mesh, kind, features)))
    }
}

fn pairs_in_order(mesh: &CollisionMesh, kind: PairKind, features: Vec<Features>) -> Vec<Pair> {
    let [points, triangles, edges] = [mesh.points().len(), mesh.triangles().len(), mesh.edges().len()];
    match kind {
        PairKind::PointTriangle => {
            let pair = |features: Features| {
                let (point, [a, b, c]) = (mesh.points()[features[0] as usize], mesh.triangles()[features[1] as usize]);
                Pair { kind, features, vertices: [point, a, b, c] }
            };
            sorted(features, [points, triangles]).into_iter().map(pair).collect()
        }
        PairKind::EdgeEdge => {
            let pair = |features: Features| {
                let [[a, b], [c, d]] = features.map(|edge| mesh.edges()[edge as usize]);
                Pair { kind, features, vertices: [a, b, c, d] }
            };
            sorted(features, [edges, edges]).into_iter().map(pair).collect()
        }
    }
}

/// Sorts features whose numbers are below some counts, and drops repeated ones. Time is linear: they are counted by
/// their second number, then by the first.
fn sorted(mut features: Vec<Features>, counts: [usize; 2]) -> Vec<Features> {
    let mut sorted = vec![[0; 2]; features.len()];
    for key in [1, 0] {
        let mut starts = vec![0; counts[key] + 1];
        features.iter().for_each(|one| starts[one[key] as usize + 1] += 1);
        for number in 1..starts.len() {
            starts[number] += starts[number - 1];
        }
        for one in &features {
            let next = &mut starts[one[key] as usize];
            sorted[*next] = *one;
            *next += 1;
        }
        std::mem::swap(&mut features, &mut sorted);
    }
    features.dedup();
    features
}
