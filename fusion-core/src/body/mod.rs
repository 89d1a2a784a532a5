//! Skinned bodies: a mesh at rest, bones, and skinning weights.

mod figure;
mod gltf_file;
mod makehuman;
mod mesh;
mod skin;
mod skinned;
mod stored;

pub use figure::{figure, figure_motion};
pub use gltf_file::{GltfError, parse_gltf, read_gltf};
pub use makehuman::{MakeHumanError, read_makehuman};
pub use mesh::{Mesh, obj_text, vertex_normals};
pub use skinned::{BodyError, Bone, FARTHEST, SkinnedBody};
pub use stored::{BodyFileError, read_body, read_obj, read_vertices, write_body};
