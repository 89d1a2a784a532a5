//! A cubic patch per triangle (curved PN triangles, Vlachos et al. 2001). It follows the normals inside, and the curve
//! of neighbouring edges along borders and creases.
//!
//! The curve of an edge depends on its ends only, so that patches meet without gaps.

use energy_dsl::Vector3;

use super::crease::{Creased, Edge, SIMILAR, unit_or_zero};
use crate::geometry::{add_scaled, dot, norm, subtract};

/// Handles of curves reach at most this part of the chord's projection on a tangent plane.
const LONGEST_HANDLE: f64 = 0.6;

/// A cubic patch with quadratic normals.
pub(super) struct Patch {
    pub number: usize,
    pub corners: [usize; 3],
    places: [Vector3<f64>; 3],
    /// For each edge the two handles, from the corner of its index on.
    handles: [[Vector3<f64>; 2]; 3],
    centre: Vector3<f64>,
    normals: [Vector3<f64>; 3],
    /// Normals in the middle of the edges.
    middles: [Vector3<f64>; 3],
}

impl Patch {
    pub(super) fn of(creased: &Creased, points: &[Vector3<f64>], number: usize) -> Self {
        let corners = creased.triangles[number];
        let vertices = corners.map(|corner| creased.originals[corner]);
        let places = vertices.map(|vertex| points[vertex]);
        let normals = corners.map(|corner| creased.normals[corner]);
        let handles = [0, 1, 2].map(|edge| {
            let ends = [edge, (edge + 1) % 3];
            [ends, [ends[1], ends[0]]].map(|[at, to]| {
                let chord = subtract(places[to], places[at]);
                let tangent = creased.tangents[vertices[at]];
                let projected = match creased.edges[number][edge] {
                    Edge::Smooth => add_scaled(chord, -dot(chord, normals[at]), normals[at]),
                    _ if tangent == [0.0; 3] => chord,
                    _ => tangent.map(|component| dot(chord, tangent) * component),
                };
                // A direction says little about an edge much longer than its neighbours, which stays straight.
                let similar = (SIMILAR * creased.shortest[corners[at]] / norm(chord)).min(1.0);
                let along = add_scaled(chord, similar * similar, subtract(projected, chord));
                handle(places[at], chord, along)
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
        Self { number, corners, places, handles, centre, normals, middles }
    }

    pub(super) fn point(&self, [u, v, w]: [f64; 3]) -> Vector3<f64> {
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

    pub(super) fn normal(&self, [u, v, w]: [f64; 3]) -> Vector3<f64> {
        let [a, b, c] = self.normals;
        let [ab, bc, ca] = self.middles;
        let terms = [(u * u, a), (v * v, b), (w * w, c), (2.0 * u * v, ab), (2.0 * v * w, bc), (2.0 * w * u, ca)];
        let normal =
            unit_or_zero(terms.into_iter().fold([0.0; 3], |sum, (weight, part)| add_scaled(sum, weight, part)));
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
