use std::io::BufReader;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use obj::raw::object::{Polygon, RawObj, parse_obj};
use serde::{Deserialize, Serialize};

use super::mesh::Mesh;
use super::skinned::{BodyError, Bone, SkinnedBody};
use crate::json_file::{JsonFileError, read_json, write_json};

/// A file of a body or mesh that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BodyFileError {
    /// A stored body cannot be read or written, or is malformed.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// The OBJ file cannot be read.
    #[error("{}", .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The mesh is malformed.
    #[error("{}: not a Wavefront OBJ: {message}", .path.display())]
    Obj {
        /// Path of the file.
        path: PathBuf,
        /// Error of the parser.
        message: String,
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
/// If the file cannot be written.
pub fn write_body(path: &Path, body: &SkinnedBody) -> Result<(), BodyFileError> {
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
    Ok(positions(&read_raw(path)?))
}

/// Reads an OBJ file, in metres, as a body without bones. Polygons are split into triangles.
///
/// # Errors
/// If the file cannot be read, is malformed, or has no triangles.
pub fn read_obj(path: &Path) -> Result<SkinnedBody, BodyFileError> {
    let raw = read_raw(path)?;
    let corners = |polygon: &Polygon| -> Vec<u32> {
        match polygon {
            Polygon::P(list) => list.iter().map(|&vertex| vertex as u32).collect(),
            Polygon::PT(list) | Polygon::PN(list) => list.iter().map(|corner| corner.0 as u32).collect(),
            Polygon::PTN(list) => list.iter().map(|corner| corner.0 as u32).collect(),
        }
    };
    let polygons: Vec<Vec<u32>> = raw.polygons.iter().map(corners).collect();
    let fan = |p: &Vec<u32>| p.windows(2).skip(1).map(|pair| [p[0], pair[0], pair[1]]).collect::<Vec<_>>();
    let (vertices, triangles) = (positions(&raw), polygons.iter().flat_map(fan).collect());
    SkinnedBody::without_bones(checked(vertices, triangles))
        .map_err(|source| BodyFileError::Body { path: path.into(), source })
}

fn read_raw(path: &Path) -> Result<RawObj, BodyFileError> {
    let file = std::fs::File::open(path).map_err(|source| BodyFileError::File { path: path.into(), source })?;
    parse_obj(BufReader::new(file))
        .map_err(|error| BodyFileError::Obj { path: path.into(), message: error.to_string() })
}

fn positions(raw: &RawObj) -> Vec<Vector3<f64>> {
    raw.positions.iter().map(|p| Vector3::new(p.0, p.1, p.2).map(f64::from)).collect()
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
        assert!(matches!(read_obj(&path), Err(BodyFileError::Obj { .. })));
    }
}
