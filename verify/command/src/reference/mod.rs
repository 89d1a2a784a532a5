//! Generated code against multi-precision reference values (schema `potref-1`, see `data/potentials/README.md`), and
//! against the documented results at degenerate inputs (`potref-policy-1`).

mod eval;
mod exact;
mod file;
mod fusion;
mod fusion_system;
mod mapping;
mod policy;
mod report;
mod smoothing;

pub use eval::{Source, evaluate_file, evaluate_inputs};
pub use exact::Truth;
pub use file::{Record, RecordError};
pub use fusion::{FamilyLine, evaluate_fusion, fusion_reference};
pub use mapping::{Mapping, mapping};
pub use policy::{PolicyLine, policy};
pub use report::{BlockLine, ReferenceReport, reference};

/// Unit roundoff of doubles.
pub const ROUNDOFF: f64 = f64::EPSILON / 2.0;
