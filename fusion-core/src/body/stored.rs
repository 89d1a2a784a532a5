use std::path::{Path, PathBuf};

use mesh_io::obj::{ObjFile, ObjFileError};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::mesh::Mesh;
use super::skinned::{BodyError, Bone, SkinnedBody};
use crate::json_file::{JsonFileError, read_json, write_json};

/// A file of a body or mesh that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BodyFileError {
    /// A stored body cannot be read or written, or is malformed.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// The OBJ file cannot be read or is malformed.
    #[error(transparent)]
    Obj(#[from] ObjFileError),
    /// A vertex of the OBJ file is infinite or NaN.
    #[error("{}:{line}: the vertex is not finite", .path.display())]
    NonFinite {
        /// Path of the file.
        path: PathBuf,
        /// The line, from 1.
        line: u32,
    },
    /// The parts do not fit.
    #[error("{}", .path.display())]
    Body {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error.
        source: BodyError,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    bones: Vec<Bone>,
    weights: Vec<Vec<(usize, f64)>>,
}

/// Reads a skinned body in the format of [`write_body`]: JSON with vertices, triangles, bones and weights.
///
/// # Errors
/// If the file is malformed or its parts do not fit.
pub fn read_body(path: &Path) -> Result<SkinnedBody, BodyFileError> {
    let stored: Stored = read_json(path)?;
    let vertices: Vec<Vector3<f64>> = stored.vertices.into_iter().map(Vector3::from).collect();
    let mesh = checked(vertices, stored.triangles);
    SkinnedBody::new(mesh, stored.bones, stored.weights)
        .map_err(|source| BodyFileError::Body { path: path.into(), source })
}

/// Writes a skinned body completely or not at all.
///
/// # Errors
/// If the body's parts do not fit, as after a motion that is not finite, or the file cannot be written.
pub fn write_body(path: &Path, body: &SkinnedBody) -> Result<(), BodyFileError> {
    SkinnedBody::new(body.mesh.clone(), body.bones.clone(), body.weights.clone())
        .map_err(|source| BodyFileError::Body { path: path.into(), source })?;
    let stored = Stored {
        vertices: body.mesh.vertices.iter().map(|&vertex| vertex.into()).collect(),
        triangles: body.mesh.triangles.clone(),
        bones: body.bones.clone(),
        weights: body.weights.clone(),
    };
    Ok(write_json(path, &stored)?)
}

/// Reads the vertices of an OBJ file.
///
/// # Errors
/// If the file cannot be read or is malformed.
pub fn read_vertices(path: &Path) -> Result<Vec<Vector3<f64>>, BodyFileError> {
    positions(&mut ObjFile::read(path)?, path)
}

/// Reads an OBJ file, in metres, as a body without bones. Polygons are split into triangles.
///
/// # Errors
/// If the file cannot be read, is malformed, or has no triangles.
pub fn read_obj(path: &Path) -> Result<SkinnedBody, BodyFileError> {
    let mut file = ObjFile::read(path)?;
    let vertices = positions(&mut file, path)?;
    let mut triangles = Vec::with_capacity(file.faces.iter().map(|&face| file.corners(face).len() - 2).sum());
    for &face in &file.faces {
        let corners = file.corners(face);
        let vertex = |corner: usize| corners[corner].vertex() as u32;
        triangles.extend((2..corners.len()).map(|end| [vertex(0), vertex(end - 1), vertex(end)]));
    }
    drop(file);
    SkinnedBody::without_bones(Mesh::new(vertices, triangles))
        .map_err(|source| BodyFileError::Body { path: path.into(), source })
}

/// Takes the positions of a file.
fn positions(file: &mut ObjFile, path: &Path) -> Result<Vec<Vector3<f64>>, BodyFileError> {
    match file.vertices.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        Some(vertex) => Err(BodyFileError::NonFinite { path: path.into(), line: file.vertex_lines[vertex] }),
        None => Ok(std::mem::take(&mut file.vertices).into_iter().map(Vector3::from).collect()),
    }
}

/// Creates a mesh that [`SkinnedBody::new`] will check: normals need valid triangles.
fn checked(vertices: Vec<Vector3<f64>>, triangles: Vec<[u32; 3]>) -> Mesh {
    if triangles.iter().flatten().all(|&vertex| (vertex as usize) < vertices.len()) {
        Mesh::new(vertices, triangles)
    } else {
        Mesh { normals: Vec::new(), vertices, triangles }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_obj_file_is_a_body_without_bones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("square.obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n").unwrap();
        let body = read_obj(&path).unwrap();
        assert_eq!((body.mesh.vertices.len(), body.bones.len()), (4, 0));
        assert_eq!(body.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(body.mesh.normals[2], Vector3::z());
        std::fs::write(&path, "v 0 0 0\n").unwrap();
        let empty = read_obj(&path).unwrap_err();
        assert!(matches!(&empty, BodyFileError::Body { source: BodyError::Empty, .. }), "{empty}");
        std::fs::write(&path, "v 0 0 zero\n").unwrap();
        let error = read_obj(&path).unwrap_err().to_string();
        assert!(error.ends_with("square.obj:1: expected a number, got `zero`: `v 0 0 zero`"), "{error}");
        std::fs::write(&path, "v 0 0 0\nv 0 0 nan\nv 0 1 0\nf 1 2 3\n").unwrap();
        assert!(read_obj(&path).unwrap_err().to_string().ends_with("square.obj:2: the vertex is not finite"));
    }
}
