//! Scene files in TOML. Each key is a field below, with its unit; unknown keys are errors.
//!
//! It is a separate crate because it runs once and need not be fast: it is built without optimisation.
//!
//! ```
//! use cloth_scene::Scene;
//!
//! let error = Scene::parse("dt = -0.01", "scene.toml".as_ref()).unwrap_err();
//! assert!(error.to_string().starts_with("scene.toml:1:6: expected a finite number greater than 0, got -0.01"));
//! ```

#![forbid(unsafe_code)]

pub mod arcsim;
mod changed_text;
mod contact_choice;
mod error;
mod exclusion;
mod fabric_choice;
mod file;
mod garment;
mod inputs;
mod numbered_files;
mod obstacle;
mod output;
mod pair_friction;
mod pins;
mod rest_shape;
mod scene;
mod schema;
mod seam;
mod shape;
mod sleep;
mod style;
mod time_grid;

pub use changed_text::{with_material, with_untangling};
pub use cloth_physics::fabric::Hair;
pub use contact_choice::ContactChoice;
pub use error::SceneError;
pub use exclusion::Exclusion;
pub use garment::{Garment, Inflation, Mesh, Placement, Turn};
pub use numbered_files::NumberingError;
pub use obstacle::{ObstacleDescription, ObstacleError};
pub use output::{CameraChoice, OutputChoice};
pub use pair_friction::PairFriction;
pub use pins::{Pin, PinBox, PinChoice, SoftPin};
pub use rest_shape::{RestFile, RestScale, RestShape, RestTexture};
pub use scene::Scene;
pub use schema::schema;
pub use seam::{Closing, Seam};
pub use shape::{MeshSourceError, Shape};
pub use sleep::Sleep;
pub use style::{Style, Viewpoint};
pub use time_grid::TimeGrid;
