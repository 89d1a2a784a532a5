//! The deformation model: nodes on a mesh, their graph, the nodes of each vertex, and the bones of each node.

mod attachments;
mod bridges;
mod deformation;
mod neighbours;
mod node_space;
mod nodes;
mod surface;

pub use attachments::{Attachments, FillReport, bone_distance};
pub use deformation::{DeformationModel, ModelError, ModelOptions};
pub use neighbours::nearest;
pub use node_space::NodeDistance;
pub use nodes::{sample_nodes, sample_on_surface};
pub use surface::{Surface, SurfaceSearch};
