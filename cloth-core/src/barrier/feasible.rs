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

/// Whether a pair with these closest points becomes a contact at x.
pub(super) fn may_join(mesh: &CollisionMesh, pair: &Pair, closest: &Closest, x: &[Vector3<f64>]) -> bool {
    match pair.kind {
        PairKind::PointTriangle => {
            let [point, corners @ ..] = pair.vertices;
            let touched: Vec<u32> =
                corners.into_iter().zip(&closest.weights[1..]).filter(|(_, c)| **c != 0.0).map(|(v, _)| v).collect();
            match touched[..] {
                [_, _, _] => true,
                [a, b] => on_edge(mesh, x, [a, b], corners, closest.normal),
                [a] => on_vertex(mesh, x, point, a, corners),
                _ => false,
            }
        }
        PairKind::EdgeEdge => {
            let [a, b, c, d] = pair.vertices;
            let inside = closest.weights.iter().all(|weight| *weight != 0.0);
            let towards = closest.normal;
            let away = towards.map(|component| -component);
            inside
                && !are_parallel(x, [a, b], [c, d])
                && is_ridge(mesh, x, [a, b], away)
                && is_ridge(mesh, x, [c, d], towards)
        }
    }
}

fn are_parallel(x: &[Vector3<f64>], first: [u32; 2], second: [u32; 2]) -> bool {
    let [u, v] = [first, second].map(|[a, b]| subtract(x[b as usize], x[a as usize]));
    let area = cross(u, v);
    dot(area, area) <= PARALLEL * dot(u, u) * dot(v, v)
}

/// Whether the triangles of an edge all fall away from a direction.
fn is_ridge(mesh: &CollisionMesh, x: &[Vector3<f64>], edge: [u32; 2], direction: Vector3<f64>) -> bool {
    apexes(mesh, edge).iter().all(|&apex| dot(across(x, edge, apex), direction) <= -RIDGE)
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
