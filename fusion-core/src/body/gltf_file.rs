use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mesh_io::gltf::json::mesh::{Mode, Primitive, Semantic};
use mesh_io::gltf::json::validation::Checked;
use mesh_io::gltf::{Accessors, Container, Fault, Usage, Values};
use nalgebra::Vector3;

use super::mesh::Mesh;
use super::skin::SkinBones;
use super::skinned::{BodyError, SkinnedBody};

/// The largest file, in bytes.
const LARGEST_FILE: u64 = 256 << 20;

/// A glTF file without a usable skinned body.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GltfError {
    /// The file cannot be read.
    #[error("{}", .path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A part is malformed or missing.
    #[error("{}: {part}: {reason}", .path.display())]
    Part {
        /// Path of the file.
        path: PathBuf,
        /// The part, such as an accessor with its number.
        part: String,
        /// The reason, with a remedy if one is known.
        reason: String,
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

/// Reads the first skinned mesh of a binary glTF file (`.glb`): positions, triangles, joints and weights. The inverse
/// bind matrices give the joints' positions at rest. A bone's tail is the mean of its children's heads, or its own head
/// without children.
///
/// Everything that the file says about its data is checked before it is used. Memory is at most 20 times the file and
/// 300 MB.
///
/// # Errors
/// If the file is malformed or has no skinned mesh with embedded data.
pub fn read_gltf(path: &Path) -> Result<SkinnedBody, GltfError> {
    let bytes = energy_files::read(path, LARGEST_FILE)
        .map_err(|source| GltfError::Unreadable { path: path.to_owned(), source })?;
    parse_gltf(&bytes, path)
}

/// Reads the contents of a file as [`read_gltf`] does. `path` is used in messages.
///
/// # Errors
/// Returns the errors of [`read_gltf`], except for unreadable files.
///
/// ```
/// use std::path::Path;
/// let error = fusion_core::body::parse_gltf(b"no glTF", Path::new("body.glb")).unwrap_err();
/// assert!(error.to_string().starts_with("body.glb: the header: expected `glTF`"));
/// ```
pub fn parse_gltf(bytes: &[u8], path: &Path) -> Result<SkinnedBody, GltfError> {
    parse(bytes).map_err(|fault| match fault {
        Unusable::Part(Fault { part, reason }) => GltfError::Part { path: path.to_owned(), part, reason },
        Unusable::Body(source) => GltfError::Body { path: path.to_owned(), source },
    })
}

/// Why a file does not contain a body.
#[derive(Debug)]
enum Unusable {
    Part(Fault),
    Body(BodyError),
}

impl From<Fault> for Unusable {
    fn from(fault: Fault) -> Self {
        Self::Part(fault)
    }
}

fn parse(bytes: &[u8]) -> Result<SkinnedBody, Unusable> {
    let file = Container::parse(bytes)?;
    let mut rigged = file.root.nodes.iter().filter_map(|node| node.mesh.zip(node.skin));
    let (mesh, skin) =
        rigged.next().ok_or_else(|| Fault::new("the nodes", "no skinned mesh; export the body with its armature"))?;
    let mut accessors = Accessors::new(&file);
    let SkinBones { bones, order } = SkinBones::read(&file.root, &file.root.skins[skin.value()], &mut accessors)?;
    let mut surface = Surface::default();
    for (number, primitive) in file.root.meshes[mesh.value()].primitives.iter().enumerate() {
        let within = |Fault { part, reason }| Fault::new(format!("mesh {mesh}, primitive {number}: {part}"), reason);
        surface.add(primitive, &order, &mut accessors).map_err(within)?;
    }
    let Surface { vertices, triangles, weights, .. } = surface;
    SkinnedBody::new(Mesh::new(vertices, triangles), bones, weights).map_err(Unusable::Body)
}

/// The surface of the primitives so far.
#[derive(Debug, Default)]
struct Surface {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    weights: Vec<Vec<(usize, f64)>>,
    /// First vertex and number of vertices of accessors, which several primitives may share.
    shared: BTreeMap<Vec<usize>, (u32, usize)>,
}

impl Surface {
    /// Adds a primitive. Points and lines are not part of a surface.
    fn add(&mut self, primitive: &Primitive, order: &[usize], accessors: &mut Accessors<'_>) -> Result<(), Fault> {
        match primitive.mode {
            Checked::Valid(Mode::Triangles) => {}
            Checked::Valid(Mode::TriangleStrip | Mode::TriangleFan) => {
                return Err(Fault::new("its mode", "strips and fans are not supported; export triangles"));
            }
            _ => return Ok(()),
        }
        let (first, count) = self.vertices_of(primitive, order, accessors)?;
        let fault = |reason| Fault::new("its corners", reason);
        let Some(indices) = primitive.indices else {
            accessors.charge(count as u64).map_err(fault)?;
            return self.add_triangles(count, (0..count as u32).map(|corner| first + corner)).map_err(fault);
        };
        let indices: Values<'_, 1> = accessors.read(indices.value(), &Usage::INDICES)?;
        let corners = || indices.iter().map(|[index]| index as u32);
        if let Some(index) = corners().find(|&index| index as usize >= count) {
            return Err(fault(format!("one is vertex {index}, but there are only {count} vertices")));
        }
        self.add_triangles(indices.len(), corners().map(|corner| first + corner)).map_err(fault)
    }

    fn add_triangles(&mut self, count: usize, mut corners: impl Iterator<Item = u32>) -> Result<(), String> {
        if !count.is_multiple_of(3) {
            return Err(format!("expected 3 for each triangle, got {count} in all"));
        }
        let mut triangle = || Some([corners.next()?, corners.next()?, corners.next()?]);
        self.triangles.extend(std::iter::from_fn(&mut triangle));
        Ok(())
    }

    /// Returns the first vertex and the number of vertices of a primitive, after adding them if they are new.
    fn vertices_of(
        &mut self,
        primitive: &Primitive,
        order: &[usize],
        accessors: &mut Accessors<'_>,
    ) -> Result<(u32, usize), Fault> {
        let accessor = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let positions = accessor(Semantic::Positions).ok_or_else(|| Fault::new("its positions", "there are none"))?;
        let mut key = vec![positions];
        for set in 0.. {
            match (accessor(Semantic::Joints(set)), accessor(Semantic::Weights(set))) {
                (Some(joints), Some(weights)) => key.extend([joints, weights]),
                (None, None) if set > 0 => break,
                _ => return Err(Fault::new(format!("joints and weights {set}"), "expected both")),
            }
        }
        if let Some(known) = self.shared.get(&key) {
            return Ok(*known);
        }
        let positions: Values<'_, 3> = accessors.read(positions, &Usage::POSITIONS)?;
        let place = (self.vertices.len() as u32, positions.len());
        self.add_weights(&key[1..], positions.len(), order, accessors)?;
        self.vertices.extend(positions.iter().map(Vector3::from));
        self.shared.insert(key, place);
        Ok(place)
    }

    /// Adds the bones and weights of new vertices from pairs of accessors.
    fn add_weights(
        &mut self,
        pairs: &[usize],
        vertices: usize,
        order: &[usize],
        accessors: &mut Accessors<'_>,
    ) -> Result<(), Fault> {
        let first = self.weights.len();
        self.weights.resize_with(first + vertices, Vec::new);
        let (pairs, _) = pairs.as_chunks::<2>();
        for (set, &[joints, amounts]) in pairs.iter().enumerate() {
            let fault = |reason: String| Fault::new(format!("joints and weights {set}"), reason);
            let joints: Values<'_, 4> = accessors.read(joints, &Usage::JOINTS)?;
            let amounts: Values<'_, 4> = accessors.read(amounts, &Usage::WEIGHTS)?;
            if (joints.len(), amounts.len()) != (vertices, vertices) {
                let found = format!("{} and {}", joints.len(), amounts.len());
                return Err(fault(format!("expected one of each per vertex, {vertices}, got {found}")));
            }
            for (vertex, (joints, amounts)) in joints.iter().zip(amounts.iter()).enumerate() {
                for (joint, amount) in joints.into_iter().zip(amounts).filter(|&(_, amount)| amount != 0.0) {
                    let bone = order.get(joint as usize).ok_or_else(|| {
                        let joints = order.len();
                        fault(format!("vertex {vertex} has joint {joint}, but the skin has only {joints} joints"))
                    })?;
                    self.weights[first + vertex].push((*bone, amount));
                }
            }
        }
        Ok(())
    }
}
