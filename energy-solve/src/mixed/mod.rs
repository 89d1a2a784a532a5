//! Bodies whose unknowns are not only points: scalars such as twist angles, vectors of a plane, rotations, and unknowns
//! that all elements share.
//!
//! A [`MixedBody`] lists the unknowns. A [`MixedSystem`] sums the potentials of [`MixedTerm`]s over them, and
//! [`MixedNewton`] finds equilibria. A [`MixedIntegrator`] takes time steps.

mod body;
mod elements;
mod error;
mod inertia;
mod integrator;
mod newton;
mod problem;
mod rotation;
mod scatter;
mod states;
mod system;
mod term;

pub use body::{Extremum, MixedBody, UnknownKind};
pub use error::MixedError;
pub use inertia::Inertia;
pub use integrator::{MixedIntegrator, MixedScheme, MixedState};
pub use newton::{MixedNewton, MixedNewtonError, MixedNewtonOptions, MixedNewtonReport, MixedStop};
pub use states::ElementStates;
pub use system::{MixedEnergy, MixedSystem};
pub use term::MixedTerm;
