use nalgebra::Vector3;

use super::surface::{Surface, SurfaceSearch};

/// Selects vertices at least `radius` apart such that every vertex is within `radius` of one. Greedy, in the order of
/// the vertices, so that the nodes of a mesh are reproducible.
#[must_use]
pub fn sample_nodes(vertices: &[Vector3<f64>], radius: f64) -> Vec<usize> {
    let mut nodes: Vec<usize> = Vec::new();
    let square = radius * radius;
    for (vertex, place) in vertices.iter().enumerate() {
        if nodes.iter().all(|&node| (vertices[node] - place).norm_squared() >= square) {
            nodes.push(vertex);
        }
    }
    nodes
}

/// Selects vertices as [`sample_nodes`] does, by distances along a surface: a hand on a thigh keeps its own nodes.
#[must_use]
pub fn sample_on_surface(surface: &Surface, vertices: usize, radius: f64) -> Vec<usize> {
    let mut search = SurfaceSearch::new(surface);
    let (mut nodes, mut covered) = (Vec::new(), vec![false; vertices]);
    for vertex in 0..vertices {
        if !covered[vertex] {
            nodes.push(vertex);
            search.within(vertex, radius, |near, _| covered[near] = true);
        }
    }
    nodes
}
