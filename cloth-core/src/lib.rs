//! A cloth simulator on declared elements: meshes, fabrics, integrators, scenes and output. The binary `cloth` runs it.
//!
//! A [`scene::Scene`] describes meshes, fabrics, pins and an integrator. A [`Simulation`] steps it through time.
//!
//! Modules, from the bottom up; each uses only those above it:
//!
//! - [`physics`], a separate crate: meshes, fabrics, contact, integrators
//! - [`scene`], a separate crate: the file format
//! - [`mod@measure`]: forces of pins, strain of garments, drape
//! - [`ledger`], [`model`]: the energy balance, and the assembly of a scene into islands
//! - [`simulation`], [`output`]: stepping, sleep, saved states; frames, animations and pictures
//! - [`run`]: runs with checkpoints and reports
//! - [`sweep`]: the scenes of a sweep
//! - [`survey`]: what a finished run, a scene or a mesh measures
//! - [`tester`]: tests of a textile lab
//! - [`view`], [`demo`], [`materials`], [`mod@bench`], [`validate`]: what the binary offers on top
//!
//! ```
//! use cloth_core::{Simulation, scene::Scene};
//!
//! let scene: Scene = Scene::parse(
//!     r#"
//!     dt = 0.01
//!     duration = 0.05
//!     gravity = [0.0, 0.0, -9.81]
//!     [mesh.sheet]
//!     cells = [4, 4]
//!     size = [1.0, 1.0]
//!     [fabric]
//!     density = 0.15
//!     [fabric.material.stvk]
//!     stretch_stiffness = 50.0
//!     poisson_ratio = 0.3
//!     [[pins]]
//!     nearest = [-0.5, 0.5, 0.0]
//!     "#,
//!     "scene.toml".as_ref(),
//! )?;
//! let mut simulation = Simulation::new(&scene)?;
//! while !simulation.is_finished() {
//!     simulation.step()?;
//! }
//! assert!(simulation.positions()[0][2] < -0.001, "the free corner falls");
//! # Ok::<(), anyhow::Error>(())
//! ```

#![forbid(unsafe_code)]

#[cfg(doctest)]
mod book;

#[cfg(feature = "program")]
pub mod bench;
#[cfg(feature = "program")]
pub mod demo;
pub mod ledger;
pub mod materials;
pub mod measure;
pub mod model;
pub mod output;
pub mod run;
pub mod simulation;
#[cfg(feature = "program")]
pub mod survey;
pub mod sweep;
#[cfg(feature = "program")]
pub mod tester;
#[cfg(feature = "program")]
pub mod validate;
#[cfg(feature = "program")]
pub mod view;

pub use cloth_physics as physics;
pub use cloth_scene as scene;
pub use simulation::{Island, Simulation, SimulationError, Summary};

// Modules of this crate name those of `physics` as their own.
use cloth_physics::{Body, Coulomb, barrier, collision, contact, fabric, geometry, integrator, mesh, motion, wind};
