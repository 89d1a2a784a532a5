//! Every reader of files of strangers as a function of bytes, with seeds and random edits.
//!
//! A [`Target`] passes if it returns a result or an error. It fails by a panic, by an allocation beyond the limit of
//! its program, by a long message, or if it takes more than [`PATIENCE`]. The tests of this crate replay seeds and
//! regressions and some [edited](edits::edited) inputs; `cargo fuzz` finds inputs by the coverage of code.
#![forbid(unsafe_code)]

mod cloth;
pub mod edits;
mod fusion;
mod language;
mod target;

pub use target::{PATIENCE, Target};

/// All targets, sorted by name.
pub const TARGETS: [Target; 20] = [
    cloth::ARCSIM,
    fusion::BODY,
    fusion::BVH,
    fusion::CAMERA,
    cloth::CHECKPOINT,
    language::DECLARATIONS,
    fusion::DEPTH_IMAGE,
    language::FORMULA,
    fusion::GLB,
    fusion::GLTF,
    fusion::IMAGE_LIST,
    fusion::JOINTS,
    cloth::MATERIAL,
    fusion::OBJ,
    fusion::RIG,
    cloth::RUN_FOLDER,
    cloth::SCENE,
    fusion::SKELETON,
    cloth::SWEEP,
    fusion::TRACK,
];

/// Returns the target of this name.
///
/// # Panics
/// If no target has this name.
#[must_use]
pub fn target(name: &str) -> &'static Target {
    TARGETS.iter().find(|target| target.name == name).unwrap_or_else(|| panic!("no target has the name {name}"))
}
