//! Routines to Rust.

mod declaration;
mod items;
mod schedule;

pub use items::emit;
