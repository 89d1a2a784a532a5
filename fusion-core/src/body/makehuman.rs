use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mesh_io::obj::{ObjFile, ObjFileError};
use nalgebra::Vector3;
use serde::Deserialize;

use super::mesh::Mesh;
use super::skinned::{BodyError, Bone, SkinnedBody};
use crate::json_file::{JsonFileError, read_json};

/// Files that do not describe a body.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MakeHumanError {
    /// The mesh cannot be read or is malformed.
    #[error(transparent)]
    Mesh(#[from] ObjFileError),
    /// The rig or the weights cannot be read or are malformed.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// The mesh lacks a required group.
    #[error("{}: the mesh has no group `{group}`, which {needed_by} needs", .path.display())]
    MissingGroup {
        /// Path of the mesh.
        path: PathBuf,
        /// Name of the group.
        group: String,
        /// Name of what needs the group.
        needed_by: String,
    },
    /// A file names something that does not exist.
    #[error("{}: {message}", .path.display())]
    Unknown {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error.
        message: String,
    },
    /// The parts do not fit.
    #[error("{}", .path.display())]
    Body {
        /// Path of the mesh.
        path: PathBuf,
        /// Description of the error.
        source: BodyError,
    },
}

#[derive(Deserialize)]
struct RigBone {
    parent: String,
    head: Place,
    tail: Place,
}

#[derive(Deserialize)]
#[serde(tag = "strategy", rename_all = "UPPERCASE")]
enum Place {
    /// The centre of a small cube in the mesh.
    Cube { cube_name: String },
    /// The mean of some vertices.
    Mean { vertex_indices: Vec<usize> },
    /// The position of a vertex.
    Vertex { vertex_index: usize },
}

#[derive(Deserialize)]
struct WeightFile {
    weights: BTreeMap<String, Vec<(usize, f64)>>,
}

/// A mesh with its named groups.
struct Groups {
    path: PathBuf,
    positions: Vec<Vector3<f64>>,
    file: ObjFile,
    /// The faces of each name of the file.
    faces: Vec<Vec<u32>>,
    /// The index of each name that has faces.
    names: BTreeMap<String, usize>,
}

/// Metres per decimetre, the unit of the mesh.
const METRES: f64 = 0.1;

/// Reads a body in MakeHuman's format: an OBJ mesh in decimetres, a rig, and skinning weights by bone and vertex. The
/// group `body` is the skin, and the groups `joint-…` are small cubes at the joints; the rig says which joints each
/// bone connects.
///
/// # Errors
/// If a file is malformed, or names a joint, bone or vertex that does not exist.
pub fn read_makehuman(mesh: &Path, rig: &Path, weights: &Path) -> Result<SkinnedBody, MakeHumanError> {
    let groups = Groups::read(mesh)?;
    let bones = read_bones(rig, &groups)?;
    let file: WeightFile = read_json(weights)?;
    let mut by_vertex = vec![Vec::new(); groups.positions.len()];
    for (name, list) in &file.weights {
        let unknown = |message| MakeHumanError::Unknown { path: weights.to_owned(), message };
        let bone = bones
            .iter()
            .position(|bone| bone.name == *name)
            .ok_or_else(|| unknown(format!("weights for bone `{name}`, which the rig does not have")))?;
        for &(vertex, weight) in list {
            let row = by_vertex.get_mut(vertex);
            row.ok_or_else(|| unknown(format!("bone `{name}`: no vertex {vertex}")))?.push((bone, weight));
        }
    }
    groups.skin(bones, &by_vertex)
}

impl Groups {
    fn read(path: &Path) -> Result<Self, MakeHumanError> {
        let mut file = ObjFile::read(path)?;
        let positions = std::mem::take(&mut file.vertices).into_iter().map(|p| METRES * Vector3::from(p)).collect();
        let mut faces = vec![Vec::new(); file.names.len()];
        for (number, &face) in file.faces.iter().enumerate() {
            file.groups(face).iter().for_each(|&group| faces[group as usize].push(number as u32));
        }
        let names = std::mem::take(&mut file.names).into_iter().zip(0..);
        let names = names.filter(|&(_, number): &(String, usize)| !faces[number].is_empty()).collect();
        Ok(Self { path: path.to_owned(), positions, file, faces, names })
    }

    /// Returns the vertices of each face of a group.
    fn group(&self, group: &str, needed_by: &str) -> Result<impl Iterator<Item = Vec<usize>>, MakeHumanError> {
        let missing = || MakeHumanError::MissingGroup {
            path: self.path.clone(),
            group: group.to_owned(),
            needed_by: needed_by.to_owned(),
        };
        let number = self.names.get(group).copied().ok_or_else(missing)?;
        let vertices = |&face: &u32| {
            let corners = self.file.corners(self.file.faces[face as usize]);
            corners.iter().map(|corner| corner.vertex()).collect()
        };
        Ok(self.faces[number].iter().map(vertices))
    }

    fn mean(&self, vertices: impl Iterator<Item = usize>) -> Option<Vector3<f64>> {
        let places: Option<Vec<_>> = vertices.map(|vertex| self.positions.get(vertex)).collect();
        places.filter(|p| !p.is_empty()).map(|p| p.iter().copied().sum::<Vector3<f64>>() / p.len() as f64)
    }

    /// Returns the skin: the vertices of the group `body`, with quadrilaterals split in two.
    fn skin(&self, bones: Vec<Bone>, weights: &[Vec<(usize, f64)>]) -> Result<SkinnedBody, MakeHumanError> {
        let mut place = vec![None; self.positions.len()];
        let (mut vertices, mut rows, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for polygon in self.group("body", "the skin")? {
            let corners: Vec<u32> = polygon
                .iter()
                .map(|&vertex| {
                    *place[vertex].get_or_insert_with(|| {
                        vertices.push(self.positions[vertex]);
                        rows.push(weights[vertex].clone());
                        vertices.len() as u32 - 1
                    })
                })
                .collect();
            triangles.extend((2..corners.len()).map(|i| [corners[0], corners[i - 1], corners[i]]));
        }
        SkinnedBody::new(Mesh::new(vertices, triangles), bones, rows)
            .map_err(|source| MakeHumanError::Body { path: self.path.clone(), source })
    }
}

/// Returns the bones, parents first.
fn read_bones(path: &Path, groups: &Groups) -> Result<Vec<Bone>, MakeHumanError> {
    let rig: BTreeMap<String, RigBone> = read_json(path)?;
    let unknown = |message| MakeHumanError::Unknown { path: path.to_owned(), message };
    let mut bones: Vec<Bone> = Vec::with_capacity(rig.len());
    while bones.len() < rig.len() {
        let before = bones.len();
        for (name, bone) in &rig {
            if bones.iter().any(|known| known.name == *name) {
                continue;
            }
            let parent = bones.iter().position(|known| known.name == bone.parent);
            if parent.is_none() && !bone.parent.is_empty() {
                continue;
            }
            let end = |place: &Place| -> Result<[f64; 3], MakeHumanError> {
                let found = match place {
                    Place::Cube { cube_name } => groups.mean(distinct(groups.group(cube_name, name)?).into_iter()),
                    Place::Mean { vertex_indices } => groups.mean(vertex_indices.iter().copied()),
                    Place::Vertex { vertex_index } => groups.mean([*vertex_index].into_iter()),
                };
                found
                    .map(Into::into)
                    .ok_or_else(|| unknown(format!("bone `{name}` ends at vertices that do not exist")))
            };
            bones.push(Bone { name: name.clone(), parent, head: end(&bone.head)?, tail: end(&bone.tail)? });
        }
        if bones.len() == before {
            let lost = rig.keys().find(|name| bones.iter().all(|bone| bone.name != **name)).expect("one is missing");
            return Err(unknown(format!(
                "bone `{lost}`: its parent `{}` is missing or one of its descendants",
                rig[lost].parent
            )));
        }
    }
    Ok(bones)
}

fn distinct(polygons: impl Iterator<Item = Vec<usize>>) -> Vec<usize> {
    let mut vertices: Vec<usize> = polygons.flatten().collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}
