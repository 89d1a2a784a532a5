//! Sharp edges of a mesh, the curves that they form, and the normals of the smooth parts between them.

use energy_dsl::Vector3;

use crate::geometry::{add_scaled, cross, dot, norm, subtract};

/// A polyline of sharp edges that turns by more than this has a corner: cosine of 70°.
const CORNER: f64 = 0.342;

/// The edges at a vertex are of similar length up to this ratio.
pub(super) const SIMILAR: f64 = 4.0;

/// An edge of a triangle: its vertices in ascending order, and the triangle with the index of the edge's first corner.
pub(super) type Side = ([usize; 2], usize, usize);

/// A mesh whose vertices are split along its sharp edges: each smooth part has separate vertices.
pub(super) struct Creased {
    /// The original vertex of each vertex.
    pub originals: Vec<usize>,
    pub triangles: Vec<[usize; 3]>,
    pub normals: Vec<Vector3<f64>>,
    /// The shortest edge at each vertex, in m.
    pub shortest: Vec<f64>,
    /// For each triangle and each edge, which starts at the corner of that index.
    pub edges: Vec<[Edge; 3]>,
    /// Unit tangent of the curve of sharp edges at each original vertex; zero at corners and off the curves.
    pub tangents: Vec<Vector3<f64>>,
}

/// Kinds of edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edge {
    Smooth,
    /// Between triangles at an angle, or between more than two.
    Sharp,
    /// An edge of one triangle.
    Border,
}

impl Creased {
    /// Splits a mesh at borders, at edges of more than two triangles, and where the normals of two triangles have a
    /// cosine below `crease`.
    pub(super) fn of(points: &[Vector3<f64>], triangles: &[[usize; 3]], crease: f64) -> Self {
        let unit = |corners: &[usize; 3]| {
            let [a, b, c] = corners.map(|corner| points[corner]);
            unit_or_zero(cross(subtract(b, a), subtract(c, a)))
        };
        let faces: Vec<Vector3<f64>> = triangles.iter().map(unit).collect();
        let sides = sorted_sides(triangles);
        let mut edges = vec![[Edge::Border; 3]; triangles.len()];
        let mut fans = Fans::new(3 * triangles.len());
        let mut sharp: Vec<[usize; 2]> = Vec::new();
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            let kind = kind_of(group, triangles, &faces, crease);
            for (_, triangle, corner) in group {
                edges[*triangle][*corner] = kind;
            }
            if kind == Edge::Smooth {
                let [(ends, a, _), (_, b, _)] = [group[0], group[1]];
                ends.iter().for_each(|&end| fans.join(corner_of(triangles, a, end), corner_of(triangles, b, end)));
            } else {
                sharp.push(group[0].0);
            }
        }
        let (originals, split) = fans.numbered(triangles);
        let (normals, shortest) = normals(points, triangles, &split, originals.len());
        Self { originals, triangles: split, normals, shortest, edges, tangents: tangents(points, &sharp) }
    }
}

/// Returns the edges of all triangles, those of one edge in a row.
pub(super) fn sorted_sides(triangles: &[[usize; 3]]) -> Vec<Side> {
    let side = |(triangle, corners): (usize, &[usize; 3])| {
        let corners = *corners;
        (0..3).map(move |from| {
            let (a, b) = (corners[from], corners[(from + 1) % 3]);
            ([a.min(b), a.max(b)], triangle, from)
        })
    };
    let mut sides: Vec<Side> = triangles.iter().enumerate().flat_map(side).collect();
    sides.sort_unstable();
    sides
}

/// Returns the kind of the edge that these sides share. Triangles that see it in the same direction have opposite
/// fronts.
fn kind_of(group: &[Side], triangles: &[[usize; 3]], faces: &[Vector3<f64>], crease: f64) -> Edge {
    match group {
        [_] => Edge::Border,
        [(_, a, at_a), (_, b, at_b)] if triangles[*a][*at_a] != triangles[*b][*at_b] => {
            if dot(faces[*a], faces[*b]) >= crease { Edge::Smooth } else { Edge::Sharp }
        }
        _ => Edge::Sharp,
    }
}

/// Returns the number of a triangle's corner at a vertex.
fn corner_of(triangles: &[[usize; 3]], triangle: usize, vertex: usize) -> usize {
    3 * triangle + triangles[triangle].iter().position(|corner| *corner == vertex).unwrap_or(0)
}

/// Corners of triangles that share a vertex of a smooth part: disjoint sets.
struct Fans(Vec<usize>);

impl Fans {
    fn new(corners: usize) -> Self {
        Self((0..corners).collect())
    }

    fn first(&mut self, mut corner: usize) -> usize {
        while self.0[corner] != corner {
            // Path halving.
            self.0[corner] = self.0[self.0[corner]];
            corner = self.0[corner];
        }
        corner
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.first(a), self.first(b));
        self.0[a.max(b)] = a.min(b);
    }

    /// Numbers the sets. Returns the original vertex of each, and the triangles in the new numbers.
    fn numbered(mut self, triangles: &[[usize; 3]]) -> (Vec<usize>, Vec<[usize; 3]>) {
        let (mut originals, mut numbers) = (Vec::new(), vec![0; self.0.len()]);
        let mut split = triangles.to_vec();
        for (corner, vertex) in split.as_flattened_mut().iter_mut().enumerate() {
            // The first corner of a set precedes the others.
            let first = self.first(corner);
            if first == corner {
                numbers[corner] = originals.len();
                originals.push(*vertex);
            }
            *vertex = numbers[first];
        }
        (originals, split)
    }
}

/// Returns unit normals, and the length of the shortest edge at each vertex. Where edges are of similar length, the
/// weights are those of Max (1999), which are exact on spheres: n = Σ a × b/(‖a‖² ‖b‖²) over the triangles with edges a
/// and b at the vertex. Elsewhere they are areas, so that large flat triangles next to those of a rounded edge look flat.
fn normals(
    points: &[Vector3<f64>],
    originals: &[[usize; 3]],
    split: &[[usize; 3]],
    count: usize,
) -> (Vec<Vector3<f64>>, Vec<f64>) {
    let mut sums = vec![([0.0; 3], [0.0; 3]); count];
    let mut lengths = vec![(f64::INFINITY, 0.0_f64); count];
    for (corners, numbers) in originals.iter().zip(split) {
        let places = corners.map(|corner| points[corner]);
        for corner in 0..3 {
            let [a, b] = [1, 2].map(|step| subtract(places[(corner + step) % 3], places[corner]));
            let (normal, [a, b]) = (cross(a, b), [a, b].map(norm));
            let (exact, by_area) = &mut sums[numbers[corner]];
            if (a * b).is_normal() {
                *exact = add_scaled(*exact, 1.0 / (a * a * b * b), normal);
                *by_area = add_scaled(*by_area, 1.0, normal);
            }
            let (shortest, longest) = &mut lengths[numbers[corner]];
            (*shortest, *longest) = (shortest.min(a).min(b), longest.max(a).max(b));
        }
    }
    let normal = |((exact, by_area), (shortest, longest)): (_, &(f64, f64))| {
        let normal = unit_or_zero(if *longest < SIMILAR * shortest { exact } else { by_area });
        // The normals of folded triangles may cancel; any unit vector is good enough for shading.
        if normal == [0.0; 3] { [0.0, 0.0, 1.0] } else { normal }
    };
    let normals = sums.into_iter().zip(&lengths).map(normal).collect();
    (normals, lengths.into_iter().map(|(shortest, _)| shortest).collect())
}

/// The curve of sharp edges at a vertex.
#[derive(Clone, Copy)]
pub(super) enum Curve {
    None,
    /// One sharp edge.
    End(usize),
    /// From one neighbour to another, smoothly.
    Through([usize; 2]),
    /// A corner, or more than two sharp edges.
    Corner,
}

/// Returns the curve at each vertex.
pub(super) fn curves(points: &[Vector3<f64>], sharp: &[[usize; 2]]) -> Vec<Curve> {
    let mut curves = vec![Curve::None; points.len()];
    for &[a, b] in sharp {
        for (vertex, other) in [(a, b), (b, a)] {
            let turn = |from: usize| {
                let (before, after) = (subtract(points[vertex], points[from]), subtract(points[other], points[vertex]));
                dot(before, after) > CORNER * norm(before) * norm(after)
            };
            curves[vertex] = match curves[vertex] {
                Curve::None => Curve::End(other),
                Curve::End(from) if turn(from) => Curve::Through([from, other]),
                _ => Curve::Corner,
            };
        }
    }
    curves
}

/// Returns the tangents of curves. Between edges a and b, the direction a ‖b‖/‖a‖ + b ‖a‖/‖b‖ is exact on circles.
fn tangents(points: &[Vector3<f64>], sharp: &[[usize; 2]]) -> Vec<Vector3<f64>> {
    let tangent = |(point, curve): (&Vector3<f64>, Curve)| {
        let Curve::Through([from, to]) = curve else { return [0.0; 3] };
        let (a, b) = (subtract(*point, points[from]), subtract(points[to], *point));
        let ratio = norm(b) / norm(a);
        unit_or_zero(add_scaled(a.map(|component| ratio * component), 1.0 / ratio, b))
    };
    points.iter().zip(curves(points, sharp)).map(tangent).collect()
}

/// Returns the unit vector of a direction; zero if its length is 0 or not finite.
pub(super) fn unit_or_zero(direction: Vector3<f64>) -> Vector3<f64> {
    let length = norm(direction);
    if length > 0.0 && length.is_finite() { direction.map(|component| component / length) } else { [0.0; 3] }
}
