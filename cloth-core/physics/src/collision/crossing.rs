//! The exact test for crossings, the reference of every other part of contact.

use energy_dsl::Vector3;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::mesh::{CollisionMesh, bounds};
use super::{Closest, PairKind};
use crate::geometry::{Hierarchy, cross, dot, norm, subtract};

/// An edge that touches or crosses a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossing {
    /// The ends of the edge.
    pub edge: [usize; 2],
    /// The corners of the triangle.
    pub triangle: [usize; 3],
}

impl Crossing {
    /// Returns the shortest displacement that separates the edge from the triangle at x, in m.
    #[must_use]
    pub fn depth(&self, x: &[Vector3<f64>]) -> f64 {
        let [a, b] = self.edge.map(|end| x[end]);
        let [p, q, r] = self.triangle.map(|corner| x[corner]);
        let normal = cross(subtract(q, p), subtract(r, p));
        let out = |end: Vector3<f64>| dot(normal, subtract(end, p)).abs() / norm(normal);
        let beside = |side: [Vector3<f64>; 2]| Closest::between(PairKind::EdgeEdge, &[a, b, side[0], side[1]]).distance;
        // NaN, for a triangle without area, is never the smallest.
        [out(a), out(b), beside([p, q]), beside([q, r]), beside([r, p])].into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// Returns all edges that touch or cross a triangle to which they do not belong, in the order of edges and triangles.
///
/// The signs of determinants are exact (Shewchuk, "Adaptive precision floating-point arithmetic and fast robust
/// geometric predicates", 1997), so the answer is that of real arithmetic on the given coordinates. An edge that starts
/// at a corner of the triangle crosses it if they share more than this corner. Pairs that are sewn together are
/// skipped, and so are pairs of two obstacles. A triangle without area is its sides.
///
/// ```
/// use cloth_physics::collision::{CollisionMesh, crossings};
///
/// let mesh = CollisionMesh::new(5, &[[0, 1, 2]], &[[3, 4]], &[]);
/// let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let with = |from, to| [&triangle[..], &[from, to]].concat();
/// assert_eq!(crossings(&mesh, &with([0.2, 0.2, -1.0], [0.2, 0.2, 1.0])).len(), 1);
/// assert_eq!(crossings(&mesh, &with([0.2, 0.2, 1e-300], [0.2, 0.2, 1.0])).len(), 0);
/// assert_eq!(crossings(&mesh, &with([0.2, 0.2, 0.0], [0.2, 0.2, 1.0])).len(), 1, "touching counts");
/// ```
#[must_use]
pub fn crossings(mesh: &CollisionMesh, x: &[Vector3<f64>]) -> Vec<Crossing> {
    let boxes: Vec<_> = mesh.triangles().iter().map(|corners| bounds(x, corners)).collect();
    let tree = Hierarchy::new(&boxes);
    let mut found = Vec::new();
    for edge in mesh.edges() {
        let (around, mut crossed) = (bounds(x, edge), Vec::new());
        tree.near(&around, |triangle| {
            let corners = &mesh.triangles()[triangle];
            let is_own = mesh.obstacle(edge[0]).is_none() || mesh.obstacle(corners[0]).is_none();
            if is_own && crosses(mesh, x, edge, corners) {
                crossed.push(triangle);
            }
        });
        crossed.sort_unstable();
        let vertices = |triangle: usize| mesh.triangles()[triangle].map(|corner| corner as usize);
        let edge = edge.map(|end| end as usize);
        found.extend(crossed.into_iter().map(|triangle| Crossing { edge, triangle: vertices(triangle) }));
    }
    found
}

/// Whether an edge and a triangle share a point other than a common vertex.
fn crosses(mesh: &CollisionMesh, x: &[Vector3<f64>], edge: &[u32; 2], triangle: &[u32; 3]) -> bool {
    let at = |vertex: u32| x[vertex as usize];
    let corners = triangle.map(at);
    let shared: Vec<u32> = edge.iter().copied().filter(|end| triangle.contains(end)).collect();
    match shared[..] {
        [] if mesh.are_adjacent(edge, triangle) => false,
        [] => segment_meets_triangle(edge.map(at), corners),
        [common] => {
            let far = if edge[0] == common { edge[1] } else { edge[0] };
            let corner_number = triangle.iter().position(|&corner| corner == common).unwrap_or(0);
            let [next, last] = [1, 2].map(|step| corners[(corner_number + step) % 3]);
            !mesh.are_adjacent(&[far], triangle) && enters(at(common), at(far), [next, last])
        }
        _ => false,
    }
}

/// The sign of a determinant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sign {
    Negative,
    Zero,
    Positive,
}

fn sign(number: f64) -> Sign {
    match number.partial_cmp(&0.0) {
        Some(std::cmp::Ordering::Less) => Sign::Negative,
        Some(std::cmp::Ordering::Greater) => Sign::Positive,
        _ => Sign::Zero,
    }
}

/// The side of d relative to the plane through a, b and c.
fn side(a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>, d: Vector3<f64>) -> Sign {
    let [a, b, c, d] = [a, b, c, d].map(|[x, y, z]| Coord3D { x, y, z });
    sign(orient3d(a, b, c, d))
}

/// Whether no sign is opposite to another.
fn agree(signs: &[Sign]) -> bool {
    !(signs.contains(&Sign::Negative) && signs.contains(&Sign::Positive))
}

/// Whether a closed segment and a closed triangle share a point. Five signs decide, unless they are coplanar.
fn segment_meets_triangle([a, b]: [Vector3<f64>; 2], [p, q, r]: [Vector3<f64>; 3]) -> bool {
    let ends = [side(p, q, r, a), side(p, q, r, b)];
    if ends == [Sign::Zero; 2] {
        return coplanar_segment_meets_triangle([a, b], [p, q, r]);
    }
    if ends[0] == ends[1] {
        return false;
    }
    agree(&[side(a, b, p, q), side(a, b, q, r), side(a, b, r, p)])
}

/// Whether a segment from the corner v of a triangle with the other corners p and q shares more than v with it.
fn enters(v: Vector3<f64>, far: Vector3<f64>, [p, q]: [Vector3<f64>; 2]) -> bool {
    if side(v, p, q, far) != Sign::Zero {
        return false;
    }
    let Some((flat, turn)) = projection([v, p, q]) else {
        let is_on_line = projection([v, far, p]).is_none() && projection([v, far, q]).is_none();
        return is_on_line && (is_same_way(v, far, p) || is_same_way(v, far, q));
    };
    let turn_of = |b: Vector3<f64>, c: Vector3<f64>| flat.turn(v, b, c);
    let within = |sign: Sign| sign == Sign::Zero || sign == turn;
    // The segment is at least as long as a point, so it shares more than v if it starts into the angle at v.
    within(turn_of(p, far)) && within(turn_of(far, q)) && far != v
}

/// Whether two points of a line through v are on the same side of v.
fn is_same_way(v: Vector3<f64>, a: Vector3<f64>, b: Vector3<f64>) -> bool {
    (0..3).any(|axis| (a[axis] > v[axis] && b[axis] > v[axis]) || (a[axis] < v[axis] && b[axis] < v[axis]))
}

/// Whether a segment in the plane of a triangle meets it.
fn coplanar_segment_meets_triangle([a, b]: [Vector3<f64>; 2], corners: [Vector3<f64>; 3]) -> bool {
    let sides = [0, 1, 2].map(|side| [corners[side], corners[(side + 1) % 3]]);
    if sides.iter().any(|side| segments_meet([a, b], *side)) {
        return true;
    }
    let Some((flat, turn)) = projection(corners) else { return false };
    let is_inside = |x: Vector3<f64>| {
        sides.iter().all(|&[p, q]| {
            let sign = flat.turn(p, q, x);
            sign == Sign::Zero || sign == turn
        })
    };
    is_inside(a)
}

/// Whether two closed segments share a point.
fn segments_meet([a, b]: [Vector3<f64>; 2], [p, q]: [Vector3<f64>; 2]) -> bool {
    if side(a, b, p, q) != Sign::Zero {
        return false;
    }
    let planes = [[a, b, p], [a, b, q], [p, q, a], [p, q, b]];
    let Some((flat, _)) = planes.into_iter().find_map(projection) else { return overlap([a, b], [p, q]) };
    opposite(flat.turn(a, b, p), flat.turn(a, b, q)) && opposite(flat.turn(p, q, a), flat.turn(p, q, b))
}

/// Whether two points do not lie strictly on the same side.
fn opposite(a: Sign, b: Sign) -> bool {
    a != b || a == Sign::Zero
}

/// Whether two segments on one line overlap.
fn overlap([a, b]: [Vector3<f64>; 2], [p, q]: [Vector3<f64>; 2]) -> bool {
    (0..3).all(|axis| {
        let [a, b, p, q] = [a, b, p, q].map(|point| point[axis]);
        a.min(b) <= p.max(q) && p.min(q) <= a.max(b)
    })
}

/// A projection onto a plane of two axes. Dropping a coordinate is exact.
#[derive(Clone, Copy)]
struct Projection {
    dropped: usize,
}

impl Projection {
    /// The sign of the turn a → b → c.
    fn turn(self, a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>) -> Sign {
        let axes = [(self.dropped + 1) % 3, (self.dropped + 2) % 3];
        let [a, b, c] = [a, b, c].map(|point| Coord { x: point[axes[0]], y: point[axes[1]] });
        sign(orient2d(a, b, c))
    }
}

/// Returns a projection that keeps the triangle's area, and the turn of the triangle; `None` if it has no area.
fn projection([p, q, r]: [Vector3<f64>; 3]) -> Option<(Projection, Sign)> {
    let turned = |dropped: usize| (Projection { dropped }, Projection { dropped }.turn(p, q, r));
    (0..3).map(turned).find(|(_, turn)| *turn != Sign::Zero)
}
