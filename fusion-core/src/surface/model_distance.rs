//! Signed distances from a model's own surface.

use nalgebra::Vector3;

use super::grid::Grid;
use crate::body::Mesh;

/// The point of a surface that is nearest to a voxel.
#[derive(Clone, Copy, Debug)]
struct Nearest {
    square: f64,
    /// n·(x − p) with the normal n of the point's triangle.
    plane: f64,
}

/// Returns the distance of every voxel from a mesh, in m, at most `truncation`; negative inside.
///
/// Voxels that a path along the grid joins with its boundary, past the surface, are outside. This holds for parts that
/// overlap, whose union counts, and for gaps narrower than a voxel.
pub(super) fn model_distances(grid: &Grid, mesh: &Mesh, truncation: f64) -> Vec<f32> {
    let mut nearest: Vec<Option<Nearest>> = vec![None; grid.len()];
    for triangle in &mesh.triangles {
        let corners = triangle.map(|vertex| mesh.vertices[vertex as usize]);
        let [a, b, c] = corners;
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        samples(corners, 0.5 * grid.step, |point| {
            grid.near(&point, truncation, |index, square| {
                if nearest[index].is_none_or(|known| square < known.square) {
                    let plane = normal.dot(&(grid.place(grid.voxel(index)) - point));
                    nearest[index] = Some(Nearest { square, plane });
                }
            });
        });
    }
    let on_surface = |index: usize| nearest[index].is_some_and(|near| near.square <= grid.step * grid.step);
    let outside = grid.outside(on_surface);
    let distance = |index: usize| match nearest[index] {
        // The plane decides next to the outside. A surface within the body, where parts overlap, does not count.
        Some(near) if on_surface(index) && grid.around(index).any(|at| outside[at]) => near.plane,
        near => near.map_or(truncation, |near| near.square.sqrt()) * if outside[index] { 1.0 } else { -1.0 },
    };
    (0..grid.len()).map(|index| distance(index) as f32).collect()
}

/// Calls `each` with points of a triangle at most `spacing` m apart.
fn samples([a, b, c]: [Vector3<f64>; 3], spacing: f64, mut each: impl FnMut(Vector3<f64>)) {
    let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
    let parts = (longest / spacing).ceil().max(1.0) as usize;
    for i in 0..=parts {
        for j in 0..=parts - i {
            let (s, t) = (i as f64 / parts as f64, j as f64 / parts as f64);
            each(a + s * (b - a) + t * (c - a));
        }
    }
}
