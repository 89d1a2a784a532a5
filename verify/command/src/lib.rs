//! Measurements of the program `verify` beyond the audit of [`verify`].
//!
//! * [`reference`](mod@reference) compares the elements with recorded multi-precision values.
//! * [`stress`](mod@stress) sweeps towards every singularity.
//! * [`bench`](mod@bench) times every way to a Hessian and measures its error.
//! * [`fuzz_targets`] feeds the compiler with edited inputs.
#![forbid(unsafe_code)]

pub mod bench;
pub mod fuzz_targets;
mod listings;
pub mod reference;
pub mod stress;

pub use listings::listings;
