//! Binary glTF 2.0 (`.glb`) for reading: the description, and the numbers of its accessors.
//!
//! [`Container`] splits a file and checks the references of its description. [`Accessors`] checks types, counts and
//! places before it reads numbers. Readers of bodies and surfaces decide which parts they need.
//!
//! Only data within the file are read: a buffer with a `uri`, also one in base64, is refused.

mod accessor;
mod container;

pub use accessor::{Accessors, Usage, Values};
pub use container::{Container, Fault, LARGEST_DESCRIPTION, MOST_COMMAS, MOST_PARTS};
pub use gltf_json as json;
