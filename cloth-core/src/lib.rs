//! A cloth simulator on declared elements: meshes, fabrics, integrators, scenes and output. The binary `cloth` runs it.
//!
//! A [`scene::Scene`] describes meshes, fabrics, pins and an integrator. A [`Simulation`] steps it through time.
//!
//! Modules, from the bottom up; each uses only those above it:
//!
//! - [`geometry`], [`mesh`], [`motion`]: vectors, rigid motions, triangle meshes, keyframes
//! - [`collision`]: pairs of features, certificates of moves, the exact test for crossings
//! - [`fabric`], [`contact`], [`wind`]: the forces, as terms of declared elements
//! - [`barrier`]: contact of cloth with itself
//! - [`integrator`], [`ledger`]: time integration and the energy balance of a body
//! - [`scene`], [`model`]: the file format, and its assembly into islands
//! - [`simulation`], [`output`], [`run`]: stepping, output files, runs with checkpoints and reports
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

mod body;
#[cfg(doctest)]
mod book;
mod bounded;
mod input_text;

pub mod barrier;
pub mod bench;
pub mod collision;
pub mod contact;
pub mod demo;
pub mod fabric;
pub mod geometry;
pub mod integrator;
pub mod ledger;
pub mod mesh;
pub mod model;
pub mod motion;
pub mod output;
pub mod run;
pub mod scene;
pub mod simulation;
pub mod validate;
pub mod view;
pub mod wind;

pub use body::Body;
pub use cloth_materials as materials;
pub use simulation::{Island, Simulation, SimulationError, Summary};
