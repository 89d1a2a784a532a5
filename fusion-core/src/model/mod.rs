//! The deformation model: nodes on a mesh, their graph, the nodes of each vertex, and the bones of each node.

mod attachments;
mod deformation;
mod neighbours;
mod nodes;

pub use attachments::{Attachments, FillReport, bone_distance};
pub use deformation::{DeformationModel, ModelError, ModelOptions};
pub use neighbours::nearest;
pub use nodes::sample_nodes;
