use mesh_io::obj::ObjMesh;
use nalgebra::Vector3;

/// Triangles with unit normals at the vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions, in m.
    pub vertices: Vec<Vector3<f64>>,
    /// Unit normals; zero at a vertex without triangles.
    pub normals: Vec<Vector3<f64>>,
    /// Vertices of each triangle, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Creates a mesh and computes its normals.
    #[must_use]
    pub fn new(vertices: Vec<Vector3<f64>>, triangles: Vec<[u32; 3]>) -> Self {
        let normals = vertex_normals(&vertices, &triangles);
        Self { vertices, normals, triangles }
    }

    /// Returns the mean of the vertices; the origin without vertices.
    #[must_use]
    pub fn centroid(&self) -> Vector3<f64> {
        self.vertices.iter().sum::<Vector3<f64>>() / self.vertices.len().max(1) as f64
    }
}

/// Returns the area-weighted mean normal of the triangles at each vertex.
#[must_use]
pub fn vertex_normals(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); vertices.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| vertices[vertex as usize]);
        let normal = (b - a).cross(&(c - a));
        for &vertex in triangle {
            normals[vertex as usize] += normal;
        }
    }
    normals.iter_mut().for_each(|normal| *normal = normal.try_normalize(0.0).unwrap_or_default());
    normals
}

/// Formats a mesh as Wavefront OBJ, with micrometre precision.
#[must_use]
pub fn obj_text(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> String {
    let positions: Vec<[f64; 3]> = vertices.iter().map(|&vertex| vertex.into()).collect();
    let triangles: Vec<[usize; 3]> = triangles.iter().map(|corners| corners.map(|corner| corner as usize)).collect();
    let mesh = ObjMesh { positions: &positions, digits: 6, normals: None, triangles: &triangles, strands: &[] };
    mesh_io::obj::obj_text(&mesh)
}
