//! A track as an animation in binary glTF.

pub use mesh_io::animation::AnimationError;
use mesh_io::animation::{AnimatedMesh, Axes, Elements, Shape, animation_glb};
use nalgebra::Vector3;

use crate::body::vertex_normals;

/// Linear RGB colour of the mesh.
const COLOUR: [f32; 3] = [0.50, 0.48, 0.45];

/// Encodes a mesh whose vertices move as binary glTF 2.0, with a morph target per frame,
/// by [`animation_glb`]. `frames` has the vertices of each frame in m, in the camera's coordinates (x right, y down, z
/// forwards); in the file, (x, y, z) becomes (x, −y, −z), so that y points up. `times` has the time of each frame in s,
/// in increasing order.
///
/// # Errors
/// Returns an error if the file would exceed 4 GiB, if a frame lacks a time or has another number of vertices than the
/// first, if times do not increase, or if a triangle has a vertex that does not exist.
///
/// ```
/// use fusion_core::{animation::track_glb, body::figure};
/// use nalgebra::Vector3;
///
/// // The figure of tubes moves 10 mm to the right in 1/30 s.
/// let mesh = figure().mesh;
/// let moved = mesh.vertices.iter().map(|vertex| vertex + Vector3::new(0.01, 0.0, 0.0)).collect();
/// let glb = track_glb(&[mesh.vertices.clone(), moved], &mesh.triangles, &[0.0, 1.0 / 30.0])?;
/// assert!(glb.starts_with(b"glTF"));
/// # Ok::<(), fusion_core::animation::AnimationError>(())
/// ```
pub fn track_glb(
    frames: &[Vec<Vector3<f64>>],
    triangles: &[[u32; 3]],
    times: &[f64],
) -> Result<Vec<u8>, AnimationError> {
    let shape = |frame: usize| {
        let vertices = &frames[frame];
        let all = |vectors: &[Vector3<f64>]| vectors.iter().map(|&vector| vector.into()).collect();
        Shape { positions: all(vertices), normals: all(&unit_normals(vertices, triangles)) }
    };
    let corners = triangles.iter().map(|triangle| triangle.map(|vertex| vertex as usize)).collect();
    let body = AnimatedMesh {
        name: "Body",
        colour: COLOUR,
        elements: Elements::Triangles(corners),
        uvs: Vec::new(),
        frames: frames.len(),
        shape: Box::new(shape),
    };
    animation_glb(&[body], times, Axes::Camera)
}

/// Returns unit normals of the vertices; none if a triangle has a vertex that does not exist. glTF has no zero normals:
/// a vertex without a normal points to the camera.
fn unit_normals(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Vec<Vector3<f64>> {
    if triangles.as_flattened().iter().any(|&vertex| vertex as usize >= vertices.len()) {
        return Vec::new();
    }
    let mut normals = vertex_normals(vertices, triangles);
    normals.iter_mut().filter(|normal| **normal == Vector3::zeros()).for_each(|normal| *normal = -Vector3::z());
    normals
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the JSON part and the binary part of a file.
    fn parts(glb: &[u8]) -> (gltf::Gltf, Vec<u8>) {
        let mut file = gltf::Gltf::from_slice(glb).unwrap();
        let data = file.blob.take().unwrap();
        (file, data)
    }

    #[test]
    fn frames_are_read_back_at_their_times() {
        let rest = vec![Vector3::new(0.0, 0.0, 2.0), Vector3::new(1.0, 0.0, 2.0), Vector3::new(0.0, 1.0, 2.0)];
        let moved: Vec<_> = rest.iter().map(|vertex| vertex + Vector3::new(0.0, 0.25, 0.5)).collect();
        let glb = track_glb(&[rest, moved], &[[0, 1, 2]], &[0.0, 0.25]).unwrap();
        let (file, data) = parts(&glb);
        let mesh = file.meshes().next().unwrap();
        let primitive = mesh.primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(&data));
        let first: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
        assert_eq!(first, [[0.0, 0.0, -2.0], [1.0, 0.0, -2.0], [0.0, -1.0, -2.0]]);
        let moves: Vec<[f32; 3]> = reader.read_morph_targets().next().unwrap().0.unwrap().collect();
        assert_eq!(moves, [[0.0, -0.25, -0.5]; 3]);
        let animation = file.animations().next().unwrap();
        let channel = animation.channels().next().unwrap();
        let times: Vec<f32> = channel.reader(|_| Some(&data)).read_inputs().unwrap().collect();
        assert_eq!(times, [0.0, 0.25]);
    }

    #[test]
    fn a_triangle_without_a_vertex_is_refused() {
        let error = track_glb(&[vec![Vector3::zeros(); 2]], &[[0, 1, 2]], &[0.0]).unwrap_err().to_string();
        assert!(error.contains("2 vertices, but an element has vertex 2"), "{error}");
    }
}
