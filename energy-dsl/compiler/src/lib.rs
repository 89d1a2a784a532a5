//! The compiler of `energy-dsl`: turns declarations of energies, constraints, forces and residuals into Rust code for
//! their values and their exact first and second derivatives.
//!
//! ```text
//! text ─ syntax ─► tree ─ check ─► typed program ─ lower ─► graph ─ diff ─► routines ─ plan ─► ─ emit ─► Rust
//! ```
//!
//! Users declare elements with `energy!` of the crate `energy-dsl`. This crate is for tools: [`compile`] is all that
//! the macro does; [`Interpreted`], [`Textbook`] and [`Listing`] look at a declaration that is read at run time.
#![forbid(unsafe_code)]

mod budget;
mod check;
mod diagnostic;
mod diff;
mod emit;
mod emit_c;
mod functions;
mod graph;
mod inspect;
mod interpreted;
mod lower;
mod passes;
mod plan;
mod properties;
mod routines;
mod syntax;
mod tape;

pub use budget::{Budget, Limits, Phase, Progress};
pub use check::unit_exponents;
pub use diagnostic::{Diagnostic, Diagnostics};
pub use emit_c::{Origin, Precision, SourceError, SourceFile, Target, origin, sources};
pub use functions::{Function, all as functions, robust_spellings};
pub use inspect::{Fault, Listing, Mutation, Part, Parts, Path, Textbook, mathml};
pub use interpreted::{BindError, Elements, EvaluateError, InputKind, InputNumbers, Interpreted, Layouts};
pub use passes::{compile, compile_file};
pub use syntax::{AuditRange, AuditScope, canonical as canonical_name};
