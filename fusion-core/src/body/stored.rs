use std::io::BufReader;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::mesh::Mesh;
use super::skinned::{BodyError, Bone, SkinnedBody};

/// A file of a body or mesh that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BodyFileError {
    /// The file cannot be read or written.
    #[error("{}", .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is malformed.
    #[error("{}", .path.display())]
    Json {
        /// Path of the file.
        path: PathBuf,
        /// Error of the parser, with its position.
        source: serde_json::Error,
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
    let text = std::fs::read_to_string(path).map_err(|source| BodyFileError::File { path: path.into(), source })?;
    let stored: Stored =
        serde_json::from_str(&text).map_err(|source| BodyFileError::Json { path: path.into(), source })?;
    let vertices: Vec<Vector3<f64>> = stored.vertices.into_iter().map(Vector3::from).collect();
    let in_range = stored.triangles.iter().flatten().all(|&vertex| (vertex as usize) < vertices.len());
    // A mesh with invalid triangles is rejected below and needs no normals.
    let mesh = if in_range {
        Mesh::new(vertices, stored.triangles)
    } else {
        Mesh { normals: Vec::new(), vertices, triangles: stored.triangles }
    };
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
    let text = serde_json::to_vec(&stored).map_err(|source| BodyFileError::Json { path: path.into(), source })?;
    energy_cli::write_whole(path, &text).map_err(|source| BodyFileError::File { path: path.into(), source })
}

/// Reads the vertices of an OBJ file.
///
/// # Errors
/// If the file cannot be read or is malformed.
pub fn read_vertices(path: &Path) -> Result<Vec<Vector3<f64>>, BodyFileError> {
    let file = std::fs::File::open(path).map_err(|source| BodyFileError::File { path: path.into(), source })?;
    let raw = obj::raw::parse_obj(BufReader::new(file))
        .map_err(|error| BodyFileError::Obj { path: path.into(), message: error.to_string() })?;
    Ok(raw.positions.iter().map(|p| Vector3::new(p.0, p.1, p.2).map(f64::from)).collect())
}
