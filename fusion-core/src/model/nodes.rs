use nalgebra::Vector3;

/// Vertices no two of which are closer than `radius`, such that every vertex is within it of one: greedily, in the order of the vertices,
/// so that a mesh has always the same nodes.
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
