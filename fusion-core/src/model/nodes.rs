use nalgebra::Vector3;

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
