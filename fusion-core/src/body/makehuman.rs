use std::collections::{BTreeMap, BTreeSet};
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
    let numbers: BTreeMap<&str, usize> = bones.iter().map(|bone| bone.name.as_str()).zip(0..).collect();
    for (name, list) in &file.weights {
        let unknown = |message| MakeHumanError::Unknown { path: weights.to_owned(), message };
        let bone = *numbers
            .get(name.as_str())
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
    let order = parents_first(&rig).map_err(|lost| {
        let parent = &rig[lost].parent;
        unknown(format!("bone `{lost}`: its parent `{parent}` is missing or one of its descendants"))
    })?;
    let numbers: BTreeMap<&str, usize> = order.iter().copied().zip(0..).collect();
    // Many bones may name one large group.
    let mut centres = BTreeMap::<String, Option<Vector3<f64>>>::new();
    let mut bones = Vec::with_capacity(order.len());
    for name in order {
        let RigBone { parent, head, tail } = &rig[name];
        let mut end = |place: &Place| -> Result<[f64; 3], MakeHumanError> {
            let found = match place {
                Place::Cube { cube_name } => match centres.get(cube_name) {
                    Some(&centre) => centre,
                    None => {
                        let centre = groups.mean(distinct(groups.group(cube_name, name)?).into_iter());
                        centres.insert(cube_name.clone(), centre);
                        centre
                    }
                },
                Place::Mean { vertex_indices } => groups.mean(vertex_indices.iter().copied()),
                Place::Vertex { vertex_index } => groups.mean([*vertex_index].into_iter()),
            };
            found.map(Into::into).ok_or_else(|| unknown(format!("bone `{name}` ends at vertices that do not exist")))
        };
        let parent = numbers.get(parent.as_str()).copied().filter(|_| !parent.is_empty());
        bones.push(Bone { name: name.to_owned(), parent, head: end(head)?, tail: end(tail)? });
    }
    Ok(bones)
}

/// Returns the names of all bones, parents first. If the parent of a bone is missing or one of its descendants, returns
/// the name of the first such bone instead.
fn parents_first(rig: &BTreeMap<String, RigBone>) -> Result<Vec<&str>, &str> {
    let mut children = BTreeMap::<&str, Vec<&str>>::new();
    rig.iter().for_each(|(name, bone)| children.entry(&bone.parent).or_default().push(name));
    // Bones are listed in rounds, each in alphabetical order. A child that comes before its parent in this order waits
    // for the next round.
    let mut ready: BTreeSet<(usize, &str)> = children.remove("").into_iter().flatten().map(|name| (0, name)).collect();
    let mut order = Vec::with_capacity(rig.len());
    while let Some((round, name)) = ready.pop_first() {
        order.push(name);
        let children = children.remove(name).into_iter().flatten();
        ready.extend(children.map(|child| (round + usize::from(child < name), child)));
    }
    let listed: BTreeSet<&str> = order.iter().copied().collect();
    rig.keys().map(String::as_str).find(|name| !listed.contains(name)).map_or(Ok(order), Err)
}

fn distinct(polygons: impl Iterator<Item = Vec<usize>>) -> Vec<usize> {
    let mut vertices: Vec<usize> = polygons.flatten().collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads the bones of a rig and a mesh.
    fn bones(rig: &str, mesh: &str) -> Result<Vec<Bone>, String> {
        let folder = tempfile::tempdir().unwrap();
        let [rig_file, mesh_file] = ["rig.json", "base.obj"].map(|name| folder.path().join(name));
        std::fs::write(&rig_file, rig).unwrap();
        std::fs::write(&mesh_file, mesh).unwrap();
        read_bones(&rig_file, &Groups::read(&mesh_file).unwrap()).map_err(|error| error.to_string())
    }

    /// Returns a rig of bones with parents; their heads are the centre of a group, their tails a vertex.
    fn rig<'a>(bones: impl IntoIterator<Item = (&'a str, &'a str)>) -> String {
        let bone = |(name, parent)| {
            let head = r#""head": {"strategy": "CUBE", "cube_name": "all"}"#;
            let tail = r#""tail": {"strategy": "VERTEX", "vertex_index": 0}"#;
            format!(r#""{name}": {{"parent": "{parent}", {head}, {tail}}}"#)
        };
        format!("{{{}}}", bones.into_iter().map(bone).collect::<Vec<_>>().join(","))
    }

    const TRIANGLE: &str = "v 0 0 0\nv 30 0 0\nv 0 30 0\ng all\nf 1 2 3\n";

    #[test]
    fn parents_come_first() {
        let text = rig([("b", "c"), ("c", ""), ("d", "c"), ("a", "b"), ("e", "")]);
        let read = bones(&text, TRIANGLE).unwrap();
        let found: Vec<_> = read.iter().map(|bone| (bone.name.as_str(), bone.parent)).collect();
        assert_eq!(found, [("c", None), ("d", Some(0)), ("e", None), ("b", Some(0)), ("a", Some(3))]);
        assert_eq!((read[0].head, read[0].tail), ([1.0, 1.0, 0.0], [0.0; 3]));
        for bones_with_parents in [[("a", ""), ("b", "x")], [("a", ""), ("b", "b")], [("b", "c"), ("c", "b")]] {
            let message = bones(&rig(bones_with_parents), TRIANGLE).unwrap_err();
            assert!(message.contains("bone `b`: its parent `"), "{message}");
            assert!(message.ends_with("is missing or one of its descendants"), "{message}");
        }
    }

    #[test]
    fn large_rigs_take_linear_time() {
        // Each bone but the last waits for its parent, and all name one group. Time that grows with the square of the
        // bones, or with bones times faces, would be hours.
        let names: Vec<String> = (0..20_000).map(|number| format!("{number:05}")).collect();
        let parents = names[1..].iter().map(String::as_str).chain([""]);
        let text = rig(names.iter().map(String::as_str).zip(parents));
        let mesh = format!("{TRIANGLE}{}", "f 1 2 3\n".repeat(100_000));
        let read = bones(&text, &mesh).unwrap();
        assert_eq!((read.len(), read[0].name.as_str(), read[1].parent), (20_000, "19999", Some(0)));
    }
}
