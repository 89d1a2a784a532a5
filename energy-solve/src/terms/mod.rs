//! Terms of a system: elements of one type, evaluated in SIMD lanes and added to forces and matrices.

mod active;
pub(crate) mod counts;
pub(crate) mod curvature;
mod element_list;
mod force_term;
pub(crate) mod linearisation;
mod own_term;
mod potential;
pub(crate) mod restriction;
mod scatter;
mod scatter_map;
pub(crate) mod share;
pub(crate) mod state;
pub(crate) mod stencils;
pub(crate) mod term;

pub use counts::{Counts, Tally};
pub use curvature::{Curvature, change_dense};
pub use element_list::{ElementList, ListError};
pub use force_term::ForceTerm;
pub use linearisation::{Linearisation, Weights};
pub use own_term::{Order, OwnLaw, OwnResults, OwnTerm};
pub use potential::{
    DissipationLaw, DissipationTerm, DrivenLaw, DrivenTerm, PotentialTerm, StatefulLaw, SteeredTapeTerm, SteeredTapes,
    TapeTerm,
};
pub use restriction::Restriction;
pub use scatter::TriangleBuffer;
pub use scatter_map::ScatterMaps;
pub use share::{Divisible, Share};
pub use state::{State, StepStart};
pub use stencils::Stencils;
pub use term::{Character, PlacedTerm, Quantity, Term, TermDescription};
