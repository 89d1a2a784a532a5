//! The physics of cloth: what `cloth-core` assembles into scenes and steps through time.
//!
//! It is a separate crate so that kernels and solvers are built with full optimisation, and scene files without.
//! Modules, from the bottom up; each uses only those above it:
//!
//! - [`geometry`]: vectors, rigid motions, boxes and hierarchies of boxes
//! - [`bounded`]: values with ranges
//! - [`motion`], [`mesh`]: keyframes, triangle meshes
//! - [`collision`]: pairs of features, certificates of moves, the exact test for crossings
//! - [`barrier`]: contact of cloth with itself and with obstacles, by potentials that keep gaps open
//! - [`fabric`], [`contact`], [`wind`]: the other forces, as terms of declared elements
//! - [`integrator`]: time integration of a [`Body`]
//!
//! ```
//! use cloth_physics::mesh::{Disc, lumped_masses};
//!
//! let disc = Disc { radius: 0.5, rings: 20 }.mesh()?;
//! let mass: f64 = lumped_masses(&disc, 0.15).iter().sum();
//! assert!((mass / 0.15 / (0.25 * std::f64::consts::PI) - 1.0).abs() < 0.02);
//! # Ok::<(), cloth_physics::mesh::MeshError>(())
//! ```

#![forbid(unsafe_code)]

mod body;
mod coulomb;

pub mod barrier;
pub mod bounded;
pub mod collision;
pub mod contact;
pub mod fabric;
pub mod geometry;
pub mod integrator;
pub mod mesh;
pub mod motion;
pub mod wind;

pub use body::Body;
pub use coulomb::Coulomb;
