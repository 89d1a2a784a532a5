//! Fabrics: which declared elements act on which vertices of a mesh, and with what parameters.

mod curled_hair;
mod damping;
mod declared;
mod description;
mod error;
mod hair;
mod library;
mod lists;
mod locking;
mod membrane;
mod nodal;
mod patch_blocks;
mod plasticity;
pub mod plate;
mod terms;
mod warp_choice;
mod yarns;

pub use damping::StitchDamping;
pub use declared::{Declared, DeclaredError};
pub use description::{
    Arap, BaraffWitkin, Bending, Fabric, Hysteresis, MassSpring, Material, Membrane, Plasticity, Rayleigh, Strain,
    StrainLimit, Woven,
};
pub use error::FabricError;
pub use hair::{Curl, Hair, hair_terms};
pub use library::{LIBRARY, LibraryFabric, UnknownFabric, in_library};
pub use locking::Locking;
pub use plate::{PlateTerm, Rigidity};
pub use terms::{FabricTerms, Surroundings, SystemPart, terms, terms_at};
pub use warp_choice::MaybeWarpChoice;
pub use yarns::{Compression, Fast, Kes, Shear, StiffeningCurve, Tension, TensionLaw, YarnError, YarnLaw, Yarns};
