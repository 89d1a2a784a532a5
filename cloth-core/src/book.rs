//! The book's chapters; their Rust blocks are run as tests.

/// Declaring a material.
#[doc = include_str!("../../docs/book/material.md")]
mod material {}
/// From formulas to cloth.
#[doc = include_str!("../../docs/book/potentials.md")]
mod potentials {}
/// Reading an audit.
#[doc = include_str!("../../docs/book/audit.md")]
mod audit {}
/// Choosing an integrator.
#[doc = include_str!("../../docs/book/integrators.md")]
mod integrators {}
/// Performance.
#[doc = include_str!("../../docs/book/performance.md")]
mod performance {}
/// From a clone to a material of one's own.
#[doc = include_str!("../../docs/book/first-hour.md")]
mod first_hour {}
