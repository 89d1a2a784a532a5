//! Loop's subdivision of a cloth (Loop 1987), and its limit: fair surfaces without the bumps that folds between rows of
//! vertices would have. Borders become cubic splines; corners stay.

use energy_dsl::Vector3;

use super::crease::{Curve, Side, curves, sorted_sides};
use crate::geometry::add_scaled;

/// A mesh whose triangles were divided into four, or not.
pub(super) struct Subdivided {
    pub points: Vec<Vector3<f64>>,
    pub triangles: Vec<[usize; 3]>,
    /// The ends of the original edge in whose middle a vertex lies; twice the same vertex where it is one.
    pub parents: Vec<[usize; 2]>,
}

impl Subdivided {
    /// Keeps a mesh as it is.
    pub(super) fn none(points: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Self {
        let parents = (0..points.len()).map(|vertex| [vertex; 2]).collect();
        Self { points: points.to_vec(), triangles: triangles.to_vec(), parents }
    }

    /// Divides each triangle into four.
    pub(super) fn once(points: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Self {
        let sides = sorted_sides(triangles);
        let mut new = Self { points: averaged(points, &sides, step_weight, 0.125), ..Self::none(points, triangles) };
        let mut middles = vec![[0; 3]; triangles.len()];
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            let [a, b] = group[0].0;
            let opposite = |(_, triangle, corner): &Side| points[triangles[*triangle][(corner + 2) % 3]];
            let (near, far) = if group.len() == 2 { (0.375, 0.125) } else { (0.5, 0.0) };
            let on_edge = add_scaled(points[a].map(|component| near * component), near, points[b]);
            let middle = group.iter().fold(on_edge, |sum, side| add_scaled(sum, far, opposite(side)));
            group.iter().for_each(|(_, triangle, corner)| middles[*triangle][*corner] = new.points.len());
            new.points.push(middle);
            new.parents.push([a, b]);
        }
        let divided = |(&[a, b, c], &[ab, bc, ca]): (&[usize; 3], &[usize; 3])| {
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        new.triangles = triangles.iter().zip(&middles).flat_map(divided).collect();
        new
    }

    /// Moves the vertices to their limits if the mesh were divided without end.
    pub(super) fn at_limit(mut self) -> Self {
        let sides = sorted_sides(&self.triangles);
        self.points = averaged(&self.points, &sides, |count| 1.0 / (count + 0.375 / step_weight(count)), 1.0 / 6.0);
        self
    }
}

/// Returns the vertices averaged with their neighbours, each of which has this weight: a function of their number, and
/// for the two neighbours on a border a number.
fn averaged(points: &[Vector3<f64>], sides: &[Side], weight: impl Fn(f64) -> f64, on_border: f64) -> Vec<Vector3<f64>> {
    let mut sums = vec![([0.0; 3], 0.0); points.len()];
    let mut sharp = Vec::new();
    for group in sides.chunk_by(|a, b| a.0 == b.0) {
        let [a, b] = group[0].0;
        for (vertex, other) in [(a, b), (b, a)] {
            let (sum, count) = sums[vertex];
            sums[vertex] = (add_scaled(sum, 1.0, points[other]), count + 1.0);
        }
        if group.len() != 2 {
            sharp.push([a, b]);
        }
    }
    let curves = curves(points, &sharp);
    let average = |(vertex, point): (usize, &Vector3<f64>)| {
        let (sum, count) = sums[vertex];
        let (sum, count, weight) = match curves[vertex] {
            Curve::None if count > 2.0 => (sum, count, weight(count)),
            Curve::Through([a, b]) => (add_scaled(points[a], 1.0, points[b]), 2.0, on_border),
            _ => return *point,
        };
        add_scaled(point.map(|component| (1.0 - weight * count) * component), weight, sum)
    };
    points.iter().enumerate().map(average).collect()
}

/// Returns the weight of each of `count` neighbours of a vertex in a step.
fn step_weight(count: f64) -> f64 {
    let part = 0.375 + 0.25 * (std::f64::consts::TAU / count).cos();
    (0.625 - part * part) / count
}
