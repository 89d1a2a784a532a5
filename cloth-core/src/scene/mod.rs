//! Scene files: what to simulate, in TOML. Every key is a field below, with its unit; unknown keys are refused.

mod error;
mod fabric_choice;
mod file;
mod garment;
mod obstacle;
mod output;
mod own_material;
mod pins;
mod schema;
mod seam;
mod sleep;

use std::path::{Path, PathBuf};

use serde::Deserialize;

pub use crate::fabric::Hair;
pub use error::SceneError;
pub use garment::{Garment, Mesh, MeshSourceError, Placement, Shape, Turn};
pub use obstacle::{ObstacleDescription, ObstacleError};
pub use output::OutputChoice;
pub use own_material::with_material;
pub use pins::{Pin, PinBox, PinChoice};
pub use schema::schema;
pub use seam::Seam;
pub use sleep::Sleep;

use crate::fabric::Material;
use crate::integrator::{Adaptive, Integrator, LinearSolverChoice, Scheme, Tolerances};
use crate::wind::Wind;

/// A scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "file::File")]
pub struct Scene {
    /// Pieces of cloth.
    pub garments: Vec<Garment>,
    /// Strands of hair.
    pub hair: Vec<Hair>,
    /// Stitches between garments.
    pub seams: Vec<Seam>,
    /// Vertices that do not move, or move as they are told.
    pub pins: Vec<Pin>,
    /// Solids that keep cloth out.
    pub obstacles: Vec<ObstacleDescription>,
    /// Wind.
    pub wind: Option<Wind>,
    /// Acceleration of gravity, in m/s².
    pub gravity: [f64; 3],
    /// Drag per mass, in 1/s: the force −drag m v on every vertex.
    pub drag: f64,
    /// How time advances.
    pub integrator: Scheme,
    /// How exactly Newton's method solves a step.
    pub tolerances: Tolerances,
    /// What solves its linear systems.
    pub linear_solver: LinearSolverChoice,
    /// Whether a step that fails is tried again with half its size, and so on; see [`Adaptive`].
    pub adaptive: bool,
    /// When what is still falls asleep; `None` for never.
    pub sleep: Option<Sleep>,
    /// Time step h, in s.
    pub dt: f64,
    /// Time to simulate, in s; rounded to whole steps.
    pub duration: f64,
    /// Frames written per simulated second, rounded to whole steps per frame.
    pub frames_per_second: f64,
    /// Which files are written.
    pub output: OutputChoice,
    /// The folder that relative paths start from: that of the scene file.
    pub folder: PathBuf,
}

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// When the file cannot be read or a key is unknown, missing or has an impossible value.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        Self::parse(&Self::text(path)?, path)
    }

    /// The text of a scene file.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn text(path: &Path) -> Result<String, SceneError> {
        std::fs::read_to_string(path).map_err(|source| SceneError::Unreadable { path: path.to_owned(), source })
    }

    /// Reads a scene from text. The path is for messages, and its folder is where relative paths start.
    ///
    /// # Errors
    /// When a key is unknown, missing or has an impossible value.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SceneError> {
        let mut scene: Self = toml::from_str(text).map_err(|error| SceneError::invalid(path, text, &error))?;
        scene.folder = path.parent().map(Path::to_owned).unwrap_or_default();
        for garment in &mut scene.garments {
            if let Material::File(declared) = &mut garment.fabric.material {
                declared.seek_in(&scene.folder);
            }
        }
        Ok(scene)
    }

    /// The integrator.
    #[must_use]
    pub fn stepper(&self) -> Box<dyn Integrator> {
        let scheme = self.integrator.with_options(self.tolerances, self.linear_solver);
        if self.adaptive { Box::new(Adaptive::new(scheme)) } else { scheme }
    }

    /// The number of steps.
    #[must_use]
    pub fn steps(&self) -> u64 {
        (self.duration / self.dt).round() as u64
    }

    /// Steps from one frame to the next.
    #[must_use]
    pub fn steps_per_frame(&self) -> u64 {
        ((1.0 / (self.frames_per_second * self.dt)).round() as u64).max(1)
    }
}
