use std::collections::HashMap;

use nalgebra::Vector3;

use crate::body::Mesh;
use crate::model::bone_distance;

/// Distances of points from a mesh. Its triangles are kept by cells of a grid.
#[derive(Clone, Debug)]
pub struct SurfaceDistance<'a> {
    mesh: &'a Mesh,
    cells: HashMap<[i32; 3], Vec<u32>>,
}

impl<'a> SurfaceDistance<'a> {
    /// Largest distance, in m, and width of a cell.
    pub const REACH: f64 = 0.06;

    /// Prepares a mesh.
    #[must_use]
    pub fn new(mesh: &'a Mesh) -> Self {
        let mut cells: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
        for (at, triangle) in mesh.triangles.iter().enumerate() {
            let corners = triangle.map(|vertex| mesh.vertices[vertex as usize]);
            let [a, b, c] = corners;
            let (low, high) = (cell(&a.inf(&b).inf(&c)), cell(&a.sup(&b).sup(&c)));
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        cells.entry([x, y, z]).or_default().push(at as u32);
                    }
                }
            }
        }
        Self { mesh, cells }
    }

    /// Returns the distance of a point from the nearest triangle, at most [`Self::REACH`], in m.
    #[must_use]
    pub fn of(&self, point: &Vector3<f64>) -> f64 {
        let [x, y, z] = cell(point);
        let offsets = (0..27).map(|i| [x + i / 9 - 1, y + i / 3 % 3 - 1, z + i % 3 - 1]);
        let near = offsets.filter_map(|cell| self.cells.get(&cell)).flatten();
        let distance = |&at: &u32| {
            let corners = self.mesh.triangles[at as usize].map(|vertex| self.mesh.vertices[vertex as usize]);
            distance_from_triangle(point, corners)
        };
        near.map(distance).fold(Self::REACH, f64::min)
    }
}

fn cell(point: &Vector3<f64>) -> [i32; 3] {
    point.map(|x| (x / SurfaceDistance::REACH).floor() as i32).into()
}

/// Returns the distance from the plane if the point is above the triangle, else from the nearest edge.
fn distance_from_triangle(point: &Vector3<f64>, corners: [Vector3<f64>; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    let inside = |p: &Vector3<f64>, q: &Vector3<f64>| (q - p).cross(&(point - p)).dot(&normal) >= 0.0;
    if normal.norm_squared() > 0.0 && inside(&a, &b) && inside(&b, &c) && inside(&c, &a) {
        return normal.normalize().dot(&(point - a)).abs();
    }
    let edges = [[a, b], [b, c], [c, a]];
    edges.iter().map(|edge| bone_distance(point, edge)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_from_a_triangle() {
        let vertices = vec![Vector3::zeros(), Vector3::x(), Vector3::y()];
        let mesh = Mesh::new(vertices, vec![[0, 1, 2]]);
        let distance = SurfaceDistance::new(&mesh);
        let far = std::f64::consts::FRAC_1_SQRT_2 * 0.02;
        let cases = [
            ([0.2, 0.3, 0.05], 0.05),
            ([-0.03, 0.5, 0.04], 0.05),
            ([0.51, 0.51, 0.0], far),
            ([0.2, 0.2, 1.0], SurfaceDistance::REACH),
        ];
        for (point, expected) in cases {
            let found = distance.of(&Vector3::from(point));
            assert!((found - expected).abs() < 1e-12, "{point:?}: {found}, expected {expected}");
        }
    }
}
