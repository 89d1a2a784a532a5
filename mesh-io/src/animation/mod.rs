//! Meshes whose vertices move over time, written as binary glTF 2.0 (`.glb`).
//!
//! [`animation_glb`] encodes any number of [`AnimatedMesh`]es. The vertices v⁰ of the first frame are a mesh. Each
//! later frame f is a morph target with the differences vᶠ − v⁰. An animation moves the weights w. At time t the mesh
//! is
//!
//! v(t) = v⁰ + Σ_f w_f(t) (vᶠ − v⁰),
//!
//! where w_f is 1 at the time of frame f, 0 at those of the other frames, and linear between. Positions are in metres,
//! times in seconds.
//!
//! ```
//! use mesh_io::animation::{AnimatedMesh, Axes, Elements, Shape, animation_glb};
//!
//! // A triangle of 1 m that rises by 10 mm per frame, at 0, 40 and 80 ms.
//! let shape = |frame: usize| {
//!     let height = 0.01 * frame as f64;
//!     Shape {
//!         positions: vec![[0.0, 0.0, height], [1.0, 0.0, height], [0.0, 1.0, height]],
//!         normals: vec![[0.0, 0.0, 1.0]; 3],
//!     }
//! };
//! let mesh = AnimatedMesh {
//!     name: "triangle",
//!     colour: [0.5, 0.5, 0.5],
//!     elements: Elements::Triangles(vec![[0, 1, 2]]),
//!     uvs: Vec::new(),
//!     frames: 3,
//!     shape: Box::new(shape),
//! };
//! let glb = animation_glb(&[mesh], &[0.0, 0.04, 0.08], Axes::ZUp)?;
//! assert!(glb.starts_with(b"glTF"));
//! # Ok::<(), mesh_io::animation::AnimationError>(())
//! ```

mod document;
mod encode;
mod error;
mod mesh;

pub use encode::animation_glb;
pub use error::AnimationError;
pub use mesh::{AnimatedMesh, Axes, Elements, Shape};
