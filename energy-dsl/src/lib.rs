//! placeholder
#![forbid(unsafe_code)]
extern crate self as energy_dsl;
mod runtime;
pub use runtime::*;
