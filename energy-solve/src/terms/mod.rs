//! Terms of a system: elements of one type, evaluated over lanes and added to forces and matrices.

mod active;
pub(crate) mod counts;
pub(crate) mod curvature;
mod element_list;
mod force_term;
mod places;
mod potential_term;
mod scatter;
pub(crate) mod stencils;
pub(crate) mod term;
mod triangle_places;

pub use counts::{Counts, Tally};
pub use curvature::{Curvature, change_dense};
pub use element_list::{ElementList, ListError};
pub use force_term::ForceTerm;
pub use potential_term::PotentialTerm;
pub use stencils::Stencils;
pub use term::{Character, Divisible, Linearisation, Quantity, Share, State, StepStart, Term, Weights};
pub use triangle_places::TrianglePlaces;
