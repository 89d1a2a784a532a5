//! Which pairs of close features act as a contact.
//!
//! Two layers of cloth lie close in many pairs of features. Only local minima of the distance count: the closest points
//! of a pair must lie in the feasible region of both features (Offset geometric contact: Chen, Hsu, Liu, Macklin, Yang
//! and Yuksel 2025). Each minimum counts once.

use energy_dsl::Vector3;

use crate::collision::{Closest, CollisionMesh, Pair, PairKind};
use crate::geometry::{add_scaled, cross, dot, norm, subtract};

/// Sine of the angle by which both edges must be ridges towards each other. Flat layers lie on the boundary of the
/// feasible region of all their edges; their points and triangles suffice.
const RIDGE: f64 = 0.1;
/// Squared sine of the angle below which edges count as parallel. The direction of their distance is not defined; their
/// ends and the triangles suffice.
const PARALLEL: f64 = 0.01;

/// Decides which pairs become contacts at x.
pub(super) struct Meeting<'a> {
    pub(super) mesh: &'a CollisionMesh,
    pub(super) x: &'a [Vector3<f64>],
    /// The edge that was last looked at, and whether it is a ridge in some direction.
    last: Option<(u32, bool)>,
}

impl<'a> Meeting<'a> {
    pub fn new(mesh: &'a CollisionMesh, x: &'a [Vector3<f64>]) -> Self {
        Self { mesh, x, last: None }
    }

    /// Whether a pair with these closest points becomes a contact. Fastest if pairs come in order.
    pub fn may_join(&mut self, pair: &Pair, closest: &Closest) -> bool {
        match pair.kind {
            PairKind::PointTriangle => self.is_feasible_on_triangle(pair, closest),
            PairKind::EdgeEdge if self.mesh.obstacle_of(pair).is_some() => self.edges_meet_obstacle(pair, closest),
            PairKind::EdgeEdge => self.may_be_ridge(pair.features[0]) && self.are_ridges(pair, closest),
        }
    }

    fn is_feasible_on_triangle(&self, pair: &Pair, closest: &Closest) -> bool {
        let [point, corners @ ..] = pair.vertices;
        if self.mesh.is_round(point) {
            return true;
        }
        let is_touched = |corner: &usize| closest.weights[1 + corner] != 0.0;
        let mut touched = (0..3).filter(is_touched).map(|corner| corners[corner]);
        match (touched.next(), touched.next(), touched.next()) {
            (Some(_), Some(_), Some(_)) => true,
            // A rail.
            _ if corners[1] == corners[2] => true,
            (Some(a), Some(b), None) => on_edge(self.mesh, self.x, [a, b], corners, closest.normal),
            (Some(a), None, None) => on_vertex(self.mesh, self.x, point, a, corners),
            _ => false,
        }
    }

    fn are_ridges(&self, pair: &Pair, closest: &Closest) -> bool {
        let Self { mesh, x, .. } = *self;
        let [a, b, c, d] = pair.vertices;
        let [first, second] = pair.features;
        let towards = closest.normal;
        let away = towards.map(|component| -component);
        closest.weights.iter().all(|weight| *weight != 0.0)
            && is_ridge(mesh, x, first, away)
            && is_ridge(mesh, x, second, towards)
            && !are_parallel(x, [a, b], [c, d])
    }

    /// Whether an edge is a ridge in some direction. Most edges of smooth cloth are not.
    fn may_be_ridge(&mut self, edge: u32) -> bool {
        if let Some((last, may_be)) = self.last
            && last == edge
        {
            return may_be;
        }
        let ends = self.mesh.edges()[edge as usize];
        let heights = self.mesh.apexes(edge as usize).iter().map(|&apex| across(self.x, ends, apex));
        // If n unit vectors all fall away from a direction by the sine, the length of their sum is at least n times it.
        let (sum, count) = heights.fold(([0.0; 3], 0.0), |(sum, n), height| (add_scaled(sum, 1.0, height), n + 1.0));
        let may_be = norm(sum) >= RIDGE * count;
        self.last = Some((edge, may_be));
        may_be
    }
}

pub(super) fn are_parallel(x: &[Vector3<f64>], first: [u32; 2], second: [u32; 2]) -> bool {
    let [u, v] = [first, second].map(|[a, b]| subtract(x[b as usize], x[a as usize]));
    let area = cross(u, v);
    dot(area, area) <= PARALLEL * dot(u, u) * dot(v, v)
}

/// Whether the triangles of an edge all fall away from a direction.
pub(super) fn is_ridge(mesh: &CollisionMesh, x: &[Vector3<f64>], edge: u32, direction: Vector3<f64>) -> bool {
    falls_away(mesh, x, edge, direction, -RIDGE)
}

/// Whether no triangle of an edge rises in a direction by more than an angle, given its sine.
pub(super) fn falls_away(
    mesh: &CollisionMesh,
    x: &[Vector3<f64>],
    edge: u32,
    direction: Vector3<f64>,
    sine: f64,
) -> bool {
    let ends = mesh.edges()[edge as usize];
    mesh.apexes(edge as usize).iter().all(|&apex| dot(across(x, ends, apex), direction) <= sine)
}

/// Whether a point nearest to the inside of an edge, in this direction, is nearest to it among the edge's triangles.
/// Only the first of the triangles counts the pair.
fn on_edge(
    mesh: &CollisionMesh,
    x: &[Vector3<f64>],
    edge: [u32; 2],
    corners: [u32; 3],
    direction: Vector3<f64>,
) -> bool {
    let apexes = apexes(mesh, edge);
    let own = corners.into_iter().find(|corner| !edge.contains(corner));
    own == apexes.iter().copied().min() && apexes.iter().all(|&apex| dot(across(x, edge, apex), direction) <= 0.0)
}

/// Whether a point is nearest to a vertex among all edges there. Only the first triangle at the vertex counts the pair.
fn on_vertex(mesh: &CollisionMesh, x: &[Vector3<f64>], point: u32, vertex: u32, corners: [u32; 3]) -> bool {
    let here = x[vertex as usize];
    let direction = subtract(x[point as usize], here);
    let behind = |&other: &u32| dot(subtract(x[other as usize], here), direction) <= 0.0;
    mesh.first_triangle(vertex) == Some(corners) && mesh.neighbours(vertex).iter().all(behind)
}

fn apexes(mesh: &CollisionMesh, [a, b]: [u32; 2]) -> &[u32] {
    mesh.edges().binary_search(&[a.min(b), a.max(b)]).map_or(&[], |edge| mesh.apexes(edge))
}

/// The unit vector from an edge to an apex, perpendicular to the edge; zero if they lie on a line.
fn across(x: &[Vector3<f64>], [a, b]: [u32; 2], apex: u32) -> Vector3<f64> {
    let (start, along) = (x[a as usize], subtract(x[b as usize], x[a as usize]));
    let to = subtract(x[apex as usize], start);
    let length = dot(along, along);
    let part = if length > 0.0 { dot(to, along) / length } else { 0.0 };
    let height = add_scaled(to, -part, along);
    let size = norm(height);
    if size > 0.0 { height.map(|component| component / size) } else { [0.0; 3] }
}
