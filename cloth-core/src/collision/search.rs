use energy_dsl::Vector3;
use energy_solve::index;

use super::mesh::CollisionMesh;
use super::{Pair, PairKind};
use crate::geometry::{Bounds, Hierarchy};

/// Finds the pairs whose vertices may meet within given regions.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    points: Hierarchy,
    triangles: Hierarchy,
    edges: Hierarchy,
    /// Whether each vertex may respond to a contact.
    is_free: Vec<bool>,
}

/// The boxes around the regions of all features, extended by half the reach.
struct Boxes {
    points: Vec<Bounds>,
    triangles: Vec<Bounds>,
    edges: Vec<Bounds>,
}

impl Boxes {
    fn new(mesh: &CollisionMesh, mut regions: Vec<Bounds>, reach: f64) -> Self {
        regions.iter_mut().for_each(|region| *region = region.extended(0.5 * reach));
        let around = |vertices: &[u32]| {
            vertices.iter().fold(Bounds::EMPTY, |all, &vertex| all.around(regions[vertex as usize]))
        };
        Self {
            points: mesh.points().iter().map(|&point| regions[point as usize]).collect(),
            triangles: mesh.triangles().iter().map(|corners| around(corners)).collect(),
            edges: mesh.edges().iter().map(|ends| around(ends)).collect(),
        }
    }
}

/// Features by their places in the mesh's lists, as pairs are ordered.
type Features = [u32; 2];

impl Search {
    /// Prepares searches in a mesh that starts at x. Pairs without a vertex of `is_free` are never found.
    pub fn new(mesh: &CollisionMesh, x: &[Vector3<f64>], is_free: Vec<bool>) -> Self {
        let boxes = Boxes::new(mesh, x.iter().map(|x| Bounds::of(&[*x])).collect(), 0.0);
        let [points, triangles, edges] =
            [&boxes.points, &boxes.triangles, &boxes.edges].map(|boxes| Hierarchy::new(boxes));
        Self { points, triangles, edges, is_free }
    }

    /// Returns all pairs that can come within `reach` of each other while each vertex stays in its region, and others
    /// whose boxes meet. Pairs are in order.
    pub fn pairs(&mut self, mesh: &CollisionMesh, regions: Vec<Bounds>, reach: f64) -> Vec<Pair> {
        self.refit(mesh, regions, reach);
        let (mut on_triangles, mut of_edges) = (Vec::new(), Vec::new());
        self.points.meeting(&self.triangles, |point, triangle| {
            on_triangles.extend(self.point_and_triangle(mesh, point, triangle));
        });
        self.edges.meeting_itself(|one, other| of_edges.extend(self.two_edges(mesh, one, other)));
        in_order(mesh, on_triangles, of_edges)
    }

    /// Those of [`Search::pairs`] that have a changed vertex.
    pub fn pairs_with(
        &mut self,
        is_changed: &[bool],
        mesh: &CollisionMesh,
        regions: Vec<Bounds>,
        reach: f64,
    ) -> Vec<Pair> {
        let boxes = self.refit(mesh, regions, reach);
        let (mut on_triangles, mut of_edges) = (Vec::new(), Vec::new());
        let changed = |vertices: &[u32]| vertices.iter().any(|vertex| is_changed[*vertex as usize]);
        for (point, around) in boxes.points.iter().enumerate().filter(|(point, _)| changed(&[mesh.points()[*point]])) {
            self.triangles.near(around, |triangle| {
                on_triangles.extend(self.point_and_triangle(mesh, point, triangle));
            });
        }
        let triangles = mesh.triangles().iter().zip(&boxes.triangles).enumerate();
        for (triangle, (_, around)) in triangles.filter(|(_, (corners, _))| changed(*corners)) {
            self.points.near(around, |point| {
                on_triangles.extend(self.point_and_triangle(mesh, point, triangle));
            });
        }
        for (edge, (_, around)) in mesh.edges().iter().zip(&boxes.edges).enumerate().filter(|(_, (e, _))| changed(*e)) {
            self.edges.near(around, |other| {
                of_edges.extend(self.two_edges(mesh, edge, other));
            });
        }
        in_order(mesh, on_triangles, of_edges)
    }

    fn refit(&mut self, mesh: &CollisionMesh, regions: Vec<Bounds>, reach: f64) -> Boxes {
        let boxes = Boxes::new(mesh, regions, reach);
        self.points.refit(&boxes.points);
        self.triangles.refit(&boxes.triangles);
        self.edges.refit(&boxes.edges);
        boxes
    }

    /// Returns a point and a triangle if they can collide.
    fn point_and_triangle(&self, mesh: &CollisionMesh, point: usize, triangle: usize) -> Option<Features> {
        let can_collide = self.can_collide(mesh, &[mesh.points()[point]], &mesh.triangles()[triangle]);
        can_collide.then(|| [index(point), index(triangle)])
    }

    /// Returns two edges if they can collide.
    fn two_edges(&self, mesh: &CollisionMesh, one: usize, other: usize) -> Option<Features> {
        let can_collide = self.can_collide(mesh, &mesh.edges()[one], &mesh.edges()[other]);
        can_collide.then(|| [index(one.min(other)), index(one.max(other))])
    }

    fn can_collide(&self, mesh: &CollisionMesh, a: &[u32], b: &[u32]) -> bool {
        !mesh.are_joined(a, b) && a.iter().chain(b).any(|vertex| self.is_free[*vertex as usize])
    }
}

/// Returns the pairs of these features once and in order.
fn in_order(mesh: &CollisionMesh, mut on_triangles: Vec<Features>, mut of_edges: Vec<Features>) -> Vec<Pair> {
    for features in [&mut on_triangles, &mut of_edges] {
        features.sort_unstable_by_key(|[a, b]| u64::from(*a) << 32 | u64::from(*b));
        features.dedup();
    }
    let on_triangle = |features: Features| {
        let (point, [a, b, c]) = (mesh.points()[features[0] as usize], mesh.triangles()[features[1] as usize]);
        Pair { kind: PairKind::PointTriangle, features, vertices: [point, a, b, c] }
    };
    let of_edges = of_edges.into_iter().map(|features| {
        let [[a, b], [c, d]] = features.map(|edge| mesh.edges()[edge as usize]);
        Pair { kind: PairKind::EdgeEdge, features, vertices: [a, b, c, d] }
    });
    on_triangles.into_iter().map(on_triangle).chain(of_edges).collect()
}
