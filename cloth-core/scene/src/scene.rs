use std::path::{Path, PathBuf};

use cloth_physics::bounded::Strict;
use cloth_physics::fabric::Material;
use cloth_physics::integrator::{Adaptive, Integrator, LinearSolverChoice, Scheme, Tolerances};
use cloth_physics::wind::Wind;
use serde::Deserialize;

use super::{
    ContactChoice, Exclusion, Garment, Hair, ObstacleDescription, OutputChoice, PairFriction, Pin, SceneError, Seam,
    Sleep, TimeGrid,
};

/// The largest size of a scene file, in bytes. Parsing takes up to 80 times as much memory.
const LARGEST_FILE: u64 = 4 << 20;

/// A scene: what to simulate, and which files to write.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "crate::file::File")]
pub struct Scene {
    /// Garments, each with its mesh and fabric.
    pub garments: Vec<Garment>,
    /// Strands of hair.
    pub hair: Vec<Hair>,
    /// Stitches between garments.
    pub seams: Vec<Seam>,
    /// Pinned vertices.
    pub pins: Vec<Pin>,
    /// Obstacles that the cloth cannot enter.
    pub obstacles: Vec<ObstacleDescription>,
    /// Wind; `None` for still air.
    pub wind: Option<Wind>,
    /// Acceleration of gravity, in m/s².
    pub gravity: [f64; 3],
    /// Drag per mass, in 1/s: the force −drag m v on every vertex.
    pub drag: f64,
    /// The time integrator.
    pub integrator: Scheme,
    /// Convergence criteria of Newton's method.
    pub tolerances: Tolerances,
    /// The parts that collide.
    pub contact: ContactChoice,
    /// Whether shallow crossings at the start are repaired.
    pub untangle: bool,
    /// Parts that do not collide with each other.
    pub exclusions: Vec<Exclusion>,
    /// Friction of pairs of parts.
    pub pair_friction: Vec<PairFriction>,
    /// The linear solver of implicit integrators.
    pub linear_solver: LinearSolverChoice,
    /// Whether a failed step is retried with smaller sizes; see [`Adaptive`].
    pub adaptive: bool,
    /// When islands fall asleep; `None` for never.
    pub sleep: Option<Sleep>,
    /// The largest time step h, in s; [`Scene::time_grid`] has the step that is taken.
    pub dt: f64,
    /// Simulated time, in s; rounded to whole steps.
    pub duration: f64,
    /// Frames written per simulated second; `None` for about 25, in whole steps of `dt`.
    pub frames_per_second: Option<f64>,
    /// The files to write.
    pub output: OutputChoice,
    /// The folder of the scene file, which relative paths refer to.
    pub folder: PathBuf,
}

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or a key is unknown, missing or invalid.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        Self::parse(&Self::text(path)?, path)
    }

    /// Returns the text of a scene file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read.
    pub fn text(path: &Path) -> Result<String, SceneError> {
        let text = energy_files::read_text(path, LARGEST_FILE);
        text.map_err(|source| SceneError::Unreadable { path: path.to_owned(), source })
    }

    /// Parses a scene. `path` is used in messages and as the base of relative paths.
    ///
    /// # Errors
    /// Returns an error if a key is unknown, missing or invalid.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SceneError> {
        let parsed = toml::Deserializer::parse(text).and_then(|toml| Self::deserialize(Strict(toml)));
        let mut scene = parsed.map_err(|error| SceneError::invalid(path, text, &error))?;
        scene.folder = path.parent().map(Path::to_owned).unwrap_or_default();
        for garment in &mut scene.garments {
            if let Material::File(declared) = &mut garment.fabric.material {
                declared.resolve_path(&scene.folder);
            }
        }
        Ok(scene)
    }

    /// Creates the integrator.
    #[must_use]
    pub fn stepper(&self) -> Box<dyn Integrator> {
        let scheme = self.integrator.with_options(self.tolerances, self.linear_solver);
        if self.adaptive { Box::new(Adaptive::new(scheme)) } else { scheme }
    }

    /// Whether every move is certified to cross nothing: only the integrator `newton` can do that.
    #[must_use]
    pub fn is_certified(&self) -> bool {
        self.integrator == Scheme::Newton && self.contact != ContactChoice::Off
    }

    /// Number of steps.
    #[must_use]
    pub fn steps(&self) -> u64 {
        (self.duration / self.time_grid().step).round() as u64
    }

    /// Returns the times of steps and frames.
    #[must_use]
    pub fn time_grid(&self) -> TimeGrid {
        TimeGrid::new(self.dt, self.frames_per_second)
    }
}
