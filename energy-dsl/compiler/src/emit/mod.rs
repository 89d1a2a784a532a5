//! Emits routines as Rust.

mod declaration;
mod items;
mod methods;
mod repeated;
mod schedule;
mod traits;

pub(crate) use declaration::{Character, character};
pub use items::emit;
