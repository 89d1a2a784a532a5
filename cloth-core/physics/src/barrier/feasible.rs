//! Selects the pairs of close features that act as a contact.
//!
//! Two layers of cloth lie close in many pairs of features. A point counts where it is nearest to a triangle, its
//! edges or corners, as a local minimum of the distance: once, although several triangles meet there (Offset geometric
//! contact: Chen, Hsu, Liu, Macklin, Yang and Yuksel 2025).
//!
//! Two edges count where their insides are nearest to each other, unless one of them lies in a valley. Edges of flat or
//! gently curved layers are not strict minima: which of them is nearest changes with every small motion. A pair that is
//! missing at one iterate would stop the next move.
//!
//! Hair has no triangles. Where its segments meet, or end, that corner counts against other segments: once, if no edge
//! there comes nearer. So do corners of cloth and obstacles against hair.
//!
//! Cloth on a ball or a rail is nearest to its core almost everywhere, so all of its features count there.

use energy_dsl::Vector3;

use crate::collision::{Closest, CollisionMesh, Pair, PairKind};
use crate::geometry::{add_scaled, cross, dot, norm, subtract};

/// Sine of the angle by which the triangles of an edge may rise towards the other edge. Beyond, the edge is a valley:
/// other features are nearer.
const VALLEY: f64 = 0.3;
/// Squared sine of the angle below which edges count as parallel. The direction of their distance is not defined; their
/// ends and the triangles suffice.
const PARALLEL: f64 = 0.01;

/// The feasible regions of all features at x: pairs there become active.
pub(super) struct FeasibleRegions<'a> {
    pub mesh: &'a CollisionMesh,
    pub x: &'a [Vector3<f64>],
}

impl FeasibleRegions<'_> {
    /// Whether a pair with these closest points is in a feasible region.
    pub fn contain(&self, pair: &Pair, closest: &Closest) -> bool {
        match pair.kind {
            PairKind::PointTriangle => self.is_feasible_on_triangle(pair, closest),
            PairKind::EdgeEdge if self.has_rail(pair) => self.is_feasible_on_rail(pair, closest),
            PairKind::EdgeEdge => self.are_edges_feasible(pair, closest),
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
            // A rail is a triangle with two equal corners.
            _ if corners[1] == corners[2] => true,
            (Some(a), Some(b), None) => on_edge(self.mesh, self.x, [a, b], corners, closest.normal),
            (Some(a), None, None) => on_vertex(self.mesh, self.x, point, a, corners),
            _ => false,
        }
    }

    fn are_edges_feasible(&self, pair: &Pair, closest: &Closest) -> bool {
        let [first, second] = pair.features;
        let [a, b, c, d] = pair.vertices;
        let towards = closest.normal;
        let away = towards.map(|component| -component);
        let are_strands = self.is_strand(first) && self.is_strand(second);
        self.counts_along([a, b], &closest.weights[..2], self.is_strand(second), away)
            && self.counts_along([c, d], &closest.weights[2..], self.is_strand(first), towards)
            && !self.is_valley(first, away)
            && !self.is_valley(second, towards)
            && (are_strands || !self.are_parallel(pair.vertices))
    }

    /// Whether an edge is a segment of hair.
    fn is_strand(&self, edge: u32) -> bool {
        self.mesh.apexes(edge as usize).is_empty()
    }

    /// Whether the closest point on an edge counts against another one, in this direction. The inside does. A corner
    /// does against hair, if no edge there comes nearer; only the first edge at the corner counts it.
    fn counts_along(&self, edge: [u32; 2], weights: &[f64], is_against_hair: bool, direction: Vector3<f64>) -> bool {
        let (corner, other) = match [weights[0] != 0.0, weights[1] != 0.0] {
            [true, true] => return true,
            [is_first, _] if is_first => (edge[0], edge[1]),
            _ => (edge[1], edge[0]),
        };
        let (here, neighbours) = (self.x[corner as usize], self.mesh.neighbours(corner));
        let behind = |&other: &u32| dot(subtract(self.x[other as usize], here), direction) <= 0.0;
        is_against_hair && neighbours.iter().min() == Some(&other) && neighbours.iter().all(behind)
    }

    /// Whether a pair of edges has the edge of a rail, which is the second.
    fn has_rail(&self, pair: &Pair) -> bool {
        self.mesh.obstacle_of(pair).is_some() && self.is_strand(pair.features[1])
    }

    /// Whether an edge of cloth or hair acts on a rail. Vertices of cloth do so, too.
    fn is_feasible_on_rail(&self, pair: &Pair, closest: &Closest) -> bool {
        self.is_strand(pair.features[0]) || are_inside(closest)
    }

    /// Whether a triangle of an edge rises in a direction.
    fn is_valley(&self, edge: u32, direction: Vector3<f64>) -> bool {
        let ends = self.mesh.edges()[edge as usize];
        let rises = |&apex: &u32| dot(across(self.x, ends, apex), direction) > VALLEY;
        self.mesh.apexes(edge as usize).iter().any(rises)
    }

    fn are_parallel(&self, [a, b, c, d]: [u32; 4]) -> bool {
        let [u, v] = [[a, b], [c, d]].map(|[a, b]| subtract(self.x[b as usize], self.x[a as usize]));
        let area = cross(u, v);
        dot(area, area) <= PARALLEL * dot(u, u) * dot(v, v)
    }
}

/// Whether the closest points of two edges are inside of both.
fn are_inside(closest: &Closest) -> bool {
    closest.weights.iter().all(|weight| *weight != 0.0)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the middle edges of two pairs of triangles are feasible. The edge above crosses the one below, which
    /// is along x, at an angle. The outer corners above fall by a height, those below rise by one.
    fn are_feasible(angle: f64, falls: f64, rises: f64) -> bool {
        let mesh = CollisionMesh::new(8, &[[0, 1, 2], [1, 0, 3], [4, 5, 6], [5, 4, 7]], &[], &[]);
        let ([c, s], up) = ([angle.cos(), angle.sin()], 0.002);
        let above = [[c, s, 0.0], [-c, -s, 0.0], [-s, c, -falls], [s, -c, -falls]].map(|[x, y, z]| [x, y, z + up]);
        let below = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, rises], [0.0, -1.0, rises]];
        let x = [below, above].concat();
        let edge = |ends: [u32; 2]| (0..).zip(mesh.edges()).find(|(_, other)| **other == ends).map(|(edge, _)| edge);
        let features = [edge([0, 1]).unwrap(), edge([4, 5]).unwrap()];
        let pair = Pair { kind: PairKind::EdgeEdge, features, vertices: [0, 1, 4, 5] };
        FeasibleRegions { mesh: &mesh, x: &x }.contain(&pair, &Closest::of(&pair, &pair.corners(&x)))
    }

    #[test]
    fn corners_of_hair_are_feasible_once() {
        // A strand with a kink at vertex 1 above a straight one, which ends at vertex 5.
        let mesh = CollisionMesh::new(6, &[], &[[0, 1], [1, 2], [3, 4], [4, 5]], &[]);
        let feasible = |kinked: [Vector3<f64>; 3], straight: [Vector3<f64>; 3]| {
            let x = [kinked, straight].concat();
            let regions = FeasibleRegions { mesh: &mesh, x: &x };
            let edges = mesh.edges();
            let pairs = (0..2).flat_map(|one| (2..4).map(move |other| [one, other]));
            let pairs = pairs.map(|features: [usize; 2]| {
                let [[a, b], [c, d]] = features.map(|edge| edges[edge]);
                Pair { kind: PairKind::EdgeEdge, features: features.map(|one| one as u32), vertices: [a, b, c, d] }
            });
            let is_feasible = |pair: &Pair| regions.contain(pair, &Closest::of(pair, &pair.corners(&x)));
            pairs.filter(is_feasible).map(|pair| pair.features).collect::<Vec<_>>()
        };
        let straight = [[-1.0, 0.0, 0.0], [0.25, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let hangs = [[0.5, -0.5, 1.0], [0.5, 0.0, 0.1], [0.5, 0.5, 1.0]];
        assert_eq!(feasible(hangs, straight), [[0, 3]], "a kink above the inside");
        let over_corner = hangs.map(|[x, y, z]| [x - 0.25, y, z]);
        assert_eq!(feasible(over_corner, straight), [[0, 2]], "a kink above a corner");
        let stands = hangs.map(|[x, y, z]| [x, y, 0.2 - z]);
        assert_eq!(feasible(stands, straight), [[0, 3], [1, 3]], "the insides of both segments come nearer");
        let crosses = [[0.5, -0.5, 0.1], [0.5, 0.5, 0.1], [0.5, 0.9, 0.1]];
        assert_eq!(feasible(crosses, straight), [[0, 3]], "insides");
        let parallel = straight.map(|[x, y, z]| [0.7 * x + 0.05, y + 0.1, z]);
        assert!(!feasible(parallel, straight).is_empty(), "side by side");
    }

    #[test]
    fn edges_are_feasible_unless_one_is_a_valley_or_they_are_parallel() {
        // Flat layers, ridges, and gentle valleys.
        assert!(are_feasible(1.5, 0.0, 0.0) && are_feasible(0.2, 0.0, 0.0));
        assert!(are_feasible(1.5, -0.5, -0.5) && are_feasible(1.5, 0.25, 0.25));
        assert!(!are_feasible(1.5, 0.4, 0.0) && !are_feasible(1.5, 0.0, 0.4));
        assert!(!are_feasible(0.05, 0.0, 0.0));
    }

    #[test]
    fn a_triangle_that_collapsed_to_a_line_keeps_the_contact_of_its_edge() {
        let mesh = CollisionMesh::new(5, &[[0, 1, 2], [1, 0, 3]], &[], &[]);
        let pair = Pair { kind: PairKind::PointTriangle, features: [4, 0], vertices: [4, 0, 1, 2] };
        let is_feasible = |apex: Vector3<f64>| {
            // The point is above the middle of the edge, and outside of the first triangle.
            let x = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], apex, [0.5, -0.01, 0.1]];
            FeasibleRegions { mesh: &mesh, x: &x }.contain(&pair, &Closest::of(&pair, &pair.corners(&x)))
        };
        assert!(is_feasible([0.5, -1.0, -1.0]), "a ridge");
        assert!(!is_feasible([0.5, -1.0, 0.0]), "nearer to the other triangle");
        assert!(is_feasible([0.25, 0.0, 0.0]), "on the line of the edge");
    }
}
