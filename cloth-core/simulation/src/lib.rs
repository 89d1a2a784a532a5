//! The simulation of cloth: assembles scenes, steps them through time, and draws and encodes their states.
//!
//! It is a separate crate so that it is built with full optimisation, and the commands of `cloth-core` with little.
//! Modules, from the bottom up; each uses only those above it:
//!
//! - [`ledger`]: the energy balance
//! - [`model`]: the assembly of a scene into islands
//! - [`simulation`]: stepping, sleep, saved states
//! - [`output`]: frames, animations and pictures
//!
//! ```
//! use cloth_scene::Scene;
//! use cloth_simulation::Simulation;
//!
//! let scene = Scene::parse(
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
//!     "#,
//!     "scene.toml".as_ref(),
//! )?;
//! let mut simulation = Simulation::new(&scene)?;
//! simulation.step()?;
//! assert!(simulation.velocities().iter().all(|v| (v[2] + 0.0981).abs() < 1e-9), "all vertices fall freely");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod ledger;
pub mod model;
pub mod output;
pub mod simulation;

use cloth_physics::{Body, barrier, collision, contact, fabric, geometry, integrator, mesh, motion, wind};
use cloth_scene as scene;
pub use simulation::{Island, Simulation, SimulationError, Summary};
