//! File formats of meshes. Readers return the contents of a file with checked references; writers take plain arrays.
//!
//! | module | format | |
//! |---|---|---|
//! | [`obj`] | Wavefront OBJ | reads vertices, faces and groups with their lines; writes meshes and polylines |
//! | [`gltf`] | binary glTF 2.0 | reads the description and the numbers of accessors |
//! | [`animation`] | binary glTF 2.0 | writes meshes whose vertices move |
//! | [`usd`] | USD text | writes prims, attributes and time samples as they come |
//!
//! Callers decide which parts of a file they need, and whether a surface or body is valid.
//!
//! Files may come from strangers. The peak of memory of a reader, with its result, is at most 20 times the file and
//! 300 MB; a file that would need more is refused. The test `memory` of `fuzz-targets` measures it.
#![forbid(unsafe_code)]

pub mod animation;
pub mod gltf;
pub mod obj;
pub mod usd;
