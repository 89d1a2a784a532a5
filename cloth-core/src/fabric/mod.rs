//! What a cloth is made of: which declared elements act on which vertices, with what parameters.

mod description;
mod library;
pub mod plate;
mod terms;

pub use description::{
    Arap, BaraffWitkin, Bending, Fabric, MassSpring, Material, Membrane, Rayleigh, StrainLimit, Woven,
};
pub use library::{MEASURED, MeasuredFabric};
pub use plate::{PlateTerm, Rigidity};
pub use terms::{FabricError, Garment, Surroundings, terms};
