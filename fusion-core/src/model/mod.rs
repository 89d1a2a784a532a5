//! The model that deforms: nodes on a mesh, their graph, which nodes move which vertex, and which bones each node follows.

mod attachments;
mod deformation;
mod neighbours;
mod nodes;

pub use attachments::{Attachments, FillReport, bone_distance};
pub use deformation::{DeformationModel, ModelError, ModelOptions};
pub use neighbours::nearest;
pub use nodes::sample_nodes;
