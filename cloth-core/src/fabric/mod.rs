//! What a cloth is made of: which declared elements act on which vertices, with what parameters.

mod description;
mod terms;

pub use description::{Bending, Fabric, MassSpring, Material, Membrane};
pub use terms::{FabricError, Garment, Surroundings, terms};
