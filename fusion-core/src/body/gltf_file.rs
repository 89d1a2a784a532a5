use std::path::{Path, PathBuf};

use nalgebra::{Matrix4, Point3, Vector3};

use super::mesh::Mesh;
use super::skinned::{BodyError, Bone, SkinnedBody};

/// A glTF file without a usable skinned body.
#[derive(Debug, thiserror::Error)]
pub enum GltfError {
    /// The file cannot be read or is malformed.
    #[error("{}", .path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the parser.
        source: Box<gltf::Error>,
    },
    /// A required part is missing.
    #[error("{}: {what}", .path.display())]
    Missing {
        /// Path of the file.
        path: PathBuf,
        /// The missing part, and a remedy.
        what: &'static str,
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
/// # Errors
/// If the file is malformed or has no skinned mesh with embedded data.
pub fn read_gltf(path: &Path) -> Result<SkinnedBody, GltfError> {
    let unreadable = |source| GltfError::Unreadable { path: path.to_owned(), source: Box::new(source) };
    let missing = |what| GltfError::Missing { path: path.to_owned(), what };
    let bytes = std::fs::read(path).map_err(|error| unreadable(gltf::Error::Io(error)))?;
    let file = gltf::Gltf::from_slice(&bytes).map_err(unreadable)?;
    let blob = file.blob.as_deref().ok_or_else(|| missing("no embedded data; save it as one binary file (.glb)"))?;
    let data = |buffer: gltf::Buffer<'_>| matches!(buffer.source(), gltf::buffer::Source::Bin).then_some(blob);
    let (mesh, skin) = file
        .nodes()
        .find_map(|node| node.mesh().zip(node.skin()))
        .ok_or_else(|| missing("no skinned mesh; export the body with its armature"))?;

    let (bones, order) =
        bones(&skin, data).ok_or_else(|| missing("the skin has no inverse bind matrices, or cyclic joints"))?;
    let (mut vertices, mut triangles, mut weights) = (Vec::new(), Vec::new(), Vec::new());
    for primitive in mesh.primitives().filter(|p| p.mode() == gltf::mesh::Mode::Triangles) {
        let reader = primitive.reader(data);
        let first = vertices.len() as u32;
        let positions = reader.read_positions().ok_or_else(|| missing("a primitive without positions"))?;
        vertices.extend(positions.map(|p| Vector3::from(p).map(f64::from)));
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..vertices.len() as u32 - first).collect(),
        };
        triangles.extend(indices.chunks_exact(3).map(|t| [first + t[0], first + t[1], first + t[2]]));
        let rigged = reader.read_joints(0).zip(reader.read_weights(0));
        let (joints, amounts) = rigged.ok_or_else(|| missing("a primitive without joints and weights"))?;
        for (joints, amounts) in joints.into_u16().zip(amounts.into_f32()) {
            let row = joints.iter().zip(amounts).filter(|(_, amount)| *amount > 0.0);
            let out_of_range = usize::MAX;
            weights.push(
                row.map(|(&j, amount)| (order.get(usize::from(j)).copied().unwrap_or(out_of_range), f64::from(amount)))
                    .collect(),
            );
        }
    }
    SkinnedBody::new(Mesh::new(vertices, triangles), bones, weights)
        .map_err(|source| GltfError::Body { path: path.to_owned(), source })
}

/// Returns the bones, parents first, and the bone of each joint of the skin.
fn bones<'a>(
    skin: &gltf::Skin<'_>,
    data: impl Clone + Fn(gltf::Buffer<'_>) -> Option<&'a [u8]>,
) -> Option<(Vec<Bone>, Vec<usize>)> {
    let joints: Vec<_> = skin.joints().collect();
    let binds: Vec<Matrix4<f64>> = skin
        .reader(data)
        .read_inverse_bind_matrices()?
        .map(|columns| Matrix4::from_fn(|row, column| f64::from(columns[column][row])))
        .collect();
    let at = |node: usize| joints.iter().position(|joint| joint.index() == node);
    let parents: Vec<Option<usize>> = (0..joints.len())
        .map(|i| joints.iter().position(|j| j.children().any(|child| at(child.index()) == Some(i))))
        .collect();
    let head = |joint: usize| -> Option<Vector3<f64>> {
        Some(binds.get(joint)?.try_inverse()?.transform_point(&Point3::origin()).coords)
    };
    let mut order = vec![usize::MAX; joints.len()];
    let mut bones: Vec<Bone> = Vec::new();
    while bones.len() < joints.len() {
        let before = bones.len();
        for joint in 0..joints.len() {
            let parent = parents[joint];
            if order[joint] != usize::MAX || parent.is_some_and(|parent| order[parent] == usize::MAX) {
                continue;
            }
            let children: Vec<usize> = (0..joints.len()).filter(|&i| parents[i] == Some(joint)).collect();
            let ends: Option<Vec<_>> = children.iter().map(|&child| head(child)).collect();
            let ends = ends?;
            let own = head(joint)?;
            let tail = if ends.is_empty() { own } else { ends.iter().sum::<Vector3<f64>>() / ends.len() as f64 };
            order[joint] = bones.len();
            bones.push(Bone {
                name: joints[joint].name().map_or_else(|| format!("joint {joint}"), str::to_owned),
                parent: parent.map(|parent| order[parent]),
                head: own.into(),
                tail: tail.into(),
            });
        }
        if bones.len() == before {
            return None;
        }
    }
    Some((bones, order))
}
