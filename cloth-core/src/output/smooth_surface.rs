//! Smooth surfaces through the vertices of meshes, for pictures: a cubic patch per triangle (curved PN triangles,
//! Vlachos et al. 2001), which follows the normals inside and the curve of neighbouring edges along borders and creases.
//!
//! A curve depends on its ends only, so that patches meet without gaps.

use std::collections::HashMap;

use energy_dsl::Vector3;

use super::crease::{Creased, Edge, fair, unit_or_zero};
use crate::geometry::{add_scaled, dot, norm, subtract};

/// Handles of curves reach at most this part of the chord's projection on a tangent plane.
const LONGEST_HANDLE: f64 = 0.6;

/// Cosine of the angle from which on an edge of a solid is sharp.
const CREASE: f64 = 0.5;

/// A finer mesh on the smooth surface of another one.
#[derive(Debug, Default)]
pub(super) struct SmoothSurface {
    pub points: Vec<Vector3<f64>>,
    pub normals: Vec<Vector3<f64>>,
    pub triangles: Vec<[usize; 3]>,
    /// Vertices of the other mesh near each point, with weights that add up to one.
    pub origins: Vec<([usize; 3], [f32; 3])>,
    /// Segments along the edges of the other mesh; `true` for those along borders.
    pub segments: Vec<([usize; 2], bool)>,
}

impl SmoothSurface {
    /// Divides each triangle of a cloth into `level`² triangles. Vertices move to the limit of a Loop subdivision, which
    /// removes the bumps of folds between rows of vertices. Cloth has no creases: a fold is smooth, however tight.
    pub(super) fn of_cloth(points: &[Vector3<f64>], triangles: &[[usize; 3]], level: usize) -> Self {
        let fair = fair(points, triangles);
        Self::of(&fair, triangles, level, -1.0)
    }

    /// Divides each triangle of a solid into `level`² triangles.
    pub(super) fn of_solid(points: &[Vector3<f64>], triangles: &[[usize; 3]], level: usize) -> Self {
        Self::of(points, triangles, level, CREASE)
    }

    /// Divides triangles. Edges are sharp where the normals beside them have a cosine below `crease`.
    fn of(points: &[Vector3<f64>], triangles: &[[usize; 3]], level: usize, crease: f64) -> Self {
        let creased = Creased::of(points, triangles, crease);
        let originals = &creased.originals;
        let mut surface = Self {
            points: originals.iter().map(|&vertex| points[vertex]).collect(),
            normals: creased.normals.clone(),
            triangles: Vec::with_capacity(level * level * triangles.len()),
            origins: originals.iter().map(|&vertex| ([vertex; 3], [1.0, 0.0, 0.0])).collect(),
            segments: Vec::new(),
        };
        let mut known = HashMap::new();
        for triangle in 0..triangles.len() {
            let patch = Patch::of(&creased, points, triangle);
            let edges = [0, 1, 2].map(|edge| {
                let ends = [edge, (edge + 1) % 3].map(|corner| creased.triangles[triangle][corner]);
                let key = (ends[0].min(ends[1]), ends[0].max(ends[1]));
                let first = *known.entry(key).or_insert_with(|| surface.add_edge(&patch, edge, level, &creased));
                (first, ends[0] < ends[1])
            });
            surface.add_patch(&patch, edges, level);
        }
        surface
    }

    /// Adds another surface.
    pub(super) fn append(&mut self, other: Self) {
        let first = self.points.len();
        self.points.extend(other.points);
        self.normals.extend(other.normals);
        self.triangles.extend(other.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
        self.origins.extend(other.origins);
        self.segments.extend(other.segments.iter().map(|(ends, border)| (ends.map(|end| first + end), *border)));
    }

    /// Adds the points inside an edge, from its lower end to its higher one. Returns the first of them.
    fn add_edge(&mut self, patch: &Patch, edge: usize, level: usize, creased: &Creased) -> usize {
        let [from, to] = [edge, (edge + 1) % 3];
        let (low, high) =
            if patch.corners[from] < patch.corners[to] { (from, to) } else { (to, from) };
        let first = self.points.len();
        for step in 1..level {
            let mut weights = [0.0; 3];
            weights[high] = step as f64 / level as f64;
            weights[low] = 1.0 - weights[high];
            self.add_point(patch, weights);
        }
        let is_border = creased.edges[patch.number][edge] == Edge::Border;
        let inside = first..first + level - 1;
        let all = std::iter::once(patch.corners[low]).chain(inside).chain([patch.corners[high]]);
        let all: Vec<usize> = all.collect();
        self.segments.extend(all.windows(2).map(|ends| ([ends[0], ends[1]], is_border)));
        first
    }

    /// Adds the triangles of a patch, and the points inside.
    fn add_patch(&mut self, patch: &Patch, edges: [(usize, bool); 3], level: usize) {
        let first = self.points.len();
        for row in 1..level {
            for column in 1..level - row {
                let [second, third] = [column, row].map(|step| step as f64 / level as f64);
                self.add_point(patch, [1.0 - second - third, second, third]);
            }
        }
        let on_edge = |edge: usize, step: usize| {
            let (start, is_forward) = edges[edge];
            start + if is_forward { step - 1 } else { level - 1 - step }
        };
        // The number of the point `column` steps towards the second corner and `row` steps towards the third.
        let number = |row: usize, column: usize| match (row, column) {
            (0, 0) => patch.corners[0],
            (0, column) if column == level => patch.corners[1],
            (row, 0) if row == level => patch.corners[2],
            (0, column) => on_edge(0, column),
            (row, 0) => on_edge(2, level - row),
            (row, column) if row + column == level => on_edge(1, row),
            // Rows before this one have level − 2, level − 3, … points.
            (row, column) => first + (row - 1) * (level - 1) - row * (row - 1) / 2 + column - 1,
        };
        for row in 0..level {
            for column in 0..level - row {
                let [a, b, c] = [number(row, column), number(row, column + 1), number(row + 1, column)];
                self.triangles.push([a, b, c]);
                if row + column + 1 < level {
                    self.triangles.push([b, number(row + 1, column + 1), c]);
                }
            }
        }
    }

    fn add_point(&mut self, patch: &Patch, weights: [f64; 3]) {
        self.points.push(patch.point(weights));
        self.normals.push(patch.normal(weights));
        self.origins.push((patch.vertices, weights.map(|weight| weight as f32)));
    }
}

/// A cubic patch with quadratic normals.
struct Patch {
    number: usize,
    /// Corners in the split mesh, and in the original one.
    corners: [usize; 3],
    vertices: [usize; 3],
    places: [Vector3<f64>; 3],
    /// For each edge the two handles, from the corner of its index on.
    handles: [[Vector3<f64>; 2]; 3],
    centre: Vector3<f64>,
    normals: [Vector3<f64>; 3],
    /// Normals in the middle of the edges.
    middles: [Vector3<f64>; 3],
}

impl Patch {
    fn of(creased: &Creased, points: &[Vector3<f64>], number: usize) -> Self {
        let corners = creased.triangles[number];
        let vertices = corners.map(|corner| creased.originals[corner]);
        let places = vertices.map(|vertex| points[vertex]);
        let normals = corners.map(|corner| creased.normals[corner]);
        let handles = [0, 1, 2].map(|edge| {
            let ends = [edge, (edge + 1) % 3];
            [ends, [ends[1], ends[0]]].map(|[at, to]| {
                let chord = subtract(places[to], places[at]);
                let tangent = creased.tangents[vertices[at]];
                match creased.edges[number][edge] {
                    Edge::Smooth => {
                        let lift = dot(chord, normals[at]);
                        handle(places[at], chord, add_scaled(chord, -lift, normals[at]))
                    }
                    _ if tangent == [0.0; 3] => add_scaled(places[at], 1.0 / 3.0, chord),
                    _ => {
                        let along = dot(chord, tangent);
                        handle(places[at], chord, tangent.map(|component| along * component))
                    }
                }
            })
        });
        let mean = |of: &[Vector3<f64>]| -> Vector3<f64> {
            std::array::from_fn(|axis| of.iter().map(|point| point[axis]).sum::<f64>() / of.len() as f64)
        };
        let (ring, flat) = (mean(handles.as_flattened()), mean(&places));
        let centre = add_scaled(ring, 0.5, subtract(ring, flat));
        let middles = [0, 1, 2].map(|edge| {
            let other = (edge + 1) % 3;
            middle_normal(subtract(places[other], places[edge]), normals[edge], normals[other])
        });
        Self { number, corners, vertices, places, handles, centre, normals, middles }
    }

    fn point(&self, [u, v, w]: [f64; 3]) -> Vector3<f64> {
        let [[ab, ba], [bc, cb], [ca, ac]] = self.handles;
        let [a, b, c] = self.places;
        let terms = [
            (u * u * u, a),
            (v * v * v, b),
            (w * w * w, c),
            (3.0 * u * u * v, ab),
            (3.0 * u * v * v, ba),
            (3.0 * v * v * w, bc),
            (3.0 * v * w * w, cb),
            (3.0 * w * w * u, ca),
            (3.0 * w * u * u, ac),
            (6.0 * u * v * w, self.centre),
        ];
        terms.into_iter().fold([0.0; 3], |sum, (weight, point)| add_scaled(sum, weight, point))
    }

    fn normal(&self, [u, v, w]: [f64; 3]) -> Vector3<f64> {
        let [a, b, c] = self.normals;
        let [ab, bc, ca] = self.middles;
        let terms = [(u * u, a), (v * v, b), (w * w, c), (2.0 * u * v, ab), (2.0 * v * w, bc), (2.0 * w * u, ca)];
        let normal = unit_or_zero(terms.into_iter().fold([0.0; 3], |sum, (weight, part)| add_scaled(sum, weight, part)));
        if normal == [0.0; 3] { a } else { normal }
    }
}

/// Returns the handle of a curve at a point, from the chord to the other end and its projection on the tangent. For an
/// arc of a circle at an angle α to its chord, a handle of ⅔ ‖chord‖/(1 + cos α) is nearest to the arc.
fn handle(at: Vector3<f64>, chord: Vector3<f64>, projected: Vector3<f64>) -> Vector3<f64> {
    let cosine = norm(projected) / norm(chord);
    let part = 2.0 / (3.0 * cosine * (1.0 + cosine));
    // Also where the chord has no length.
    add_scaled(at, if part < LONGEST_HANDLE { part } else { LONGEST_HANDLE }, projected)
}

/// Returns the normal in the middle of an edge: the mean of those at its ends, mirrored in the plane across the edge,
/// which reproduces inflections.
fn middle_normal(edge: Vector3<f64>, a: Vector3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    let sum: Vector3<f64> = std::array::from_fn(|axis| a[axis] + b[axis]);
    let square = dot(edge, edge);
    let mirrored = if square > 0.0 { add_scaled(sum, -2.0 * dot(edge, sum) / square, edge) } else { sum };
    unit_or_zero(mirrored)
}
