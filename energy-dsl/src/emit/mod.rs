//! Routines to Rust.

mod declaration;
mod items;
mod methods;
mod schedule;
mod traits;

pub use items::emit;
