//! The book's chapters; their Rust blocks are run as tests.

#[doc = include_str!("../../docs/book/material.md")]
mod material {}
#[doc = include_str!("../../docs/book/potentials.md")]
mod potentials {}
#[doc = include_str!("../../docs/book/audit.md")]
mod audit {}
#[doc = include_str!("../../docs/book/integrators.md")]
mod integrators {}
#[doc = include_str!("../../docs/book/contact.md")]
mod contact {}
#[doc = include_str!("../../docs/book/lab.md")]
mod lab {}
#[doc = include_str!("../../docs/book/performance.md")]
mod performance {}
#[doc = include_str!("../../docs/book/first-hour.md")]
mod first_hour {}
#[doc = include_str!("../../docs/book/internals.md")]
mod internals {}
#[doc = include_str!("../../docs/book/glossary.md")]
mod glossary {}
#[doc = include_str!("../../docs/book/unknowns.md")]
mod unknowns {}
