use energy_dsl::Vector3;
use energy_solve::index;

use super::mesh::{CollisionMesh, bounds};
use super::{Measured, Pair, PairKind};
use crate::geometry::{Bounds, Hierarchy, add_scaled, norm, subtract};

/// All pairs that can come within reach of each other, sorted by kind and vertices, with the region in which each
/// vertex may move before the list must be renewed.
///
/// Distances do not change if all vertices are translated, so regions are relative to the mean displacement. A sheet in
/// free fall needs no new list.
#[derive(Clone, Debug)]
pub(crate) struct Candidates {
    points: Hierarchy,
    triangles: Hierarchy,
    edges: Hierarchy,
    /// Whether each pair of features may respond to a contact: some vertex of it is free.
    is_free: Vec<bool>,
    /// Distance within which pairs are wanted, in m.
    reach: f64,
    /// Positions at the last search; empty before the first.
    origin: Vec<Vector3<f64>>,
    /// The region of each vertex.
    regions: Vec<Bounds>,
    pairs: Vec<Pair>,
    /// The pairs at the last search.
    measured: Measured,
}

/// Pairs are listed if they can come within this many times the reach, because contacts join before they have an
/// energy. The guarantee needs 1, and rounding errors are far smaller than the rest.
const KEPT: f64 = 2.0;

/// How far regions extend beyond the move of each vertex relative to the mean, so that the next moves need no new list.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slack {
    /// Added to every region, in m.
    pub least: f64,
    /// Added in proportion to the vertex's displacement.
    pub part: f64,
    /// The largest extension, in m.
    pub most: f64,
}

impl Slack {
    /// Regions end where the move ends.
    pub const NONE: Self = Self { least: 0.0, part: 0.0, most: 0.0 };
}

impl Candidates {
    /// Creates an empty list. Pairs without a vertex of `is_free` are never listed.
    pub fn new(mesh: &CollisionMesh, x: &[Vector3<f64>], is_free: Vec<bool>, reach: f64) -> Self {
        let boxes_of_triangles: Vec<_> = mesh.triangles().iter().map(|corners| bounds(x, corners)).collect();
        let boxes_of_edges: Vec<_> = mesh.edges().iter().map(|ends| bounds(x, ends)).collect();
        let boxes_of_points: Vec<_> = mesh.points().iter().map(|&point| bounds(x, &[point])).collect();
        let [points, triangles, edges] =
            [&boxes_of_points, &boxes_of_triangles, &boxes_of_edges].map(|boxes| Hierarchy::new(boxes));
        let (origin, regions, pairs, measured) = Default::default();
        Self { points, triangles, edges, is_free, reach, origin, regions, pairs, measured }
    }

    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// The pairs at the last search.
    pub fn measured(&self) -> &Measured {
        &self.measured
    }

    /// Discards the list, so that the next one depends on the state alone.
    pub fn clear(&mut self) {
        self.origin.clear();
        self.pairs.clear();
        self.measured.clear();
    }

    /// Returns the distance of each vertex from its place at the last search, relative to the mean displacement, in m.
    pub fn excursions(&self, x: &[Vector3<f64>]) -> Vec<f64> {
        excursions(&self.origin, x)
    }

    /// Whether the list holds every pair that comes within reach on a straight way to `x` from a covered state. Regions
    /// are convex, so the whole way lies within them if both ends do.
    pub fn cover(&self, x: &[Vector3<f64>]) -> bool {
        if self.origin.len() != x.len() {
            return false;
        }
        let mean = mean_displacement(&self.origin, x);
        x.iter().zip(&self.regions).all(|(x, region)| region.contains(subtract(*x, mean)))
    }

    /// Renews the list for a move from `x` to `to`.
    pub fn search(&mut self, mesh: &CollisionMesh, x: &[Vector3<f64>], to: &[Vector3<f64>], slack: Slack) {
        let mean = mean_displacement(x, to);
        x.clone_into(&mut self.origin);
        let region = |(&x, &to): (&Vector3<f64>, &Vector3<f64>)| {
            let to = subtract(to, mean);
            let slack = (slack.least + slack.part * norm(subtract(to, x))).min(slack.most);
            Bounds::of(&[x, to]).extended(slack)
        };
        self.regions = x.iter().zip(to).map(region).collect();
        self.pairs.clear();
        self.find_points_near_triangles(mesh);
        self.find_edges_near_edges(mesh);
        self.measured.clear();
        self.measured.measure(&self.pairs, x);
        let radii: Vec<f64> = self.regions.iter().zip(x).map(|(region, x)| region.farthest(*x)).collect();
        // Boxes of tilted features meet long before the features do.
        let may_meet = |(pair, separation): (&Pair, &f64)| separation - pair.approach(&radii) <= KEPT * self.reach;
        let is_kept: Vec<bool> = self.pairs.iter().zip(self.measured.separations()).map(may_meet).collect();
        self.measured.retain(&is_kept);
        let mut kept = is_kept.into_iter();
        self.pairs.retain(|_| kept.next().expect("one for each pair"));
    }

    /// The box around the regions of some vertices, extended by half the reach.
    fn swept(&self, vertices: &[u32]) -> Bounds {
        let region = |&vertex: &u32| self.regions[vertex as usize];
        vertices.iter().map(region).fold(Bounds::EMPTY, Bounds::around).extended(0.5 * self.reach)
    }

    fn may_respond(&self, a: &[u32], b: &[u32]) -> bool {
        a.iter().chain(b).any(|vertex| self.is_free[*vertex as usize])
    }

    fn find_points_near_triangles(&mut self, mesh: &CollisionMesh) {
        let boxes: Vec<_> = mesh.triangles().iter().map(|corners| self.swept(corners)).collect();
        let around: Vec<_> = mesh.points().iter().map(|&point| self.swept(&[point])).collect();
        self.triangles.refit(&boxes);
        self.points.refit(&around);
        let mut near = Vec::new();
        self.points.meeting(&self.triangles, [&around, &boxes], |place, triangle| {
            let (point, corners) = (mesh.points()[place], &mesh.triangles()[triangle]);
            if !mesh.are_joined(&[point], corners) && self.may_respond(&[point], corners) {
                near.push([index(place), index(triangle)]);
            }
        });
        near.sort_unstable();
        self.pairs.extend(near.into_iter().map(|features| {
            let (point, [a, b, c]) = (mesh.points()[features[0] as usize], mesh.triangles()[features[1] as usize]);
            Pair { kind: PairKind::PointTriangle, features, vertices: [point, a, b, c] }
        }));
    }

    fn find_edges_near_edges(&mut self, mesh: &CollisionMesh) {
        let boxes: Vec<_> = mesh.edges().iter().map(|ends| self.swept(ends)).collect();
        self.edges.refit(&boxes);
        let mut near = Vec::new();
        self.edges.meeting_itself(&boxes, |one, other| {
            let (ends, others) = (&mesh.edges()[one], &mesh.edges()[other]);
            if !mesh.are_joined(ends, others) && self.may_respond(ends, others) {
                near.push([index(one.min(other)), index(one.max(other))]);
            }
        });
        near.sort_unstable();
        self.pairs.extend(near.into_iter().map(|features| {
            let [[a, b], [c, d]] = features.map(|edge| mesh.edges()[edge as usize]);
            Pair { kind: PairKind::EdgeEdge, features, vertices: [a, b, c, d] }
        }));
    }
}

/// Returns the length of each displacement relative to their mean, in m.
pub(super) fn excursions(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vec<f64> {
    let mean = mean_displacement(from, to);
    let excursion = |(from, to): (&Vector3<f64>, &Vector3<f64>)| norm(subtract(subtract(*to, *from), mean));
    from.iter().zip(to).map(excursion).collect()
}

/// Returns the mean of to − from.
fn mean_displacement(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vector3<f64> {
    let sum = from.iter().zip(to).fold([0.0; 3], |sum, (from, to)| add_scaled(sum, 1.0, subtract(*to, *from)));
    sum.map(|component| component / from.len().max(1) as f64)
}
