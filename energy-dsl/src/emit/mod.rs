//! Routines to Rust.

mod declaration;
mod items;
mod methods;
mod schedule;

pub use items::emit;
