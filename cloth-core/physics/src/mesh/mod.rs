//! Triangle meshes: reading, building, validation, topology, rest geometry.

mod corners;
mod disc;
mod obj;
mod patterns;
mod pieces;
mod rest;
mod sheet;
mod strip;
mod topology;
mod triangle_mesh;
mod warp;

pub use corners::{CornerAttributes, SplitMesh};
pub use disc::Disc;
pub use obj::{ObjError, ObjOptions, ObjSurface, read_obj, read_obj_surface};
pub use patterns::ScaleError;
pub use pieces::DisjointSets;
pub use rest::{MaterialTriangle, lumped_masses, material_triangle, rest_angle, thread_triangle, vertex_angles};
pub(crate) use rest::{area, dihedral_angle};
pub use sheet::{Diagonals, Plane, Pleats, PleatsError, Sheet};
pub use strip::Strip;
pub use topology::{Hinge, SpringNetwork, Topology};
pub use triangle_mesh::{MeshError, TriangleMesh};
pub use warp::Warp;
