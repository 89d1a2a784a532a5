//! Scene files: what to simulate, in TOML. Every key is a field below, with its unit; unknown keys are refused.

mod error;
pub(crate) mod numbers;
mod pins;

use std::path::{Path, PathBuf};

use serde::Deserialize;

pub use error::SceneError;
pub use pins::{Pin, PinError, pinned_vertices};

use crate::fabric::Fabric;
use crate::integrator::{Adaptive, Integrator, Scheme};
use crate::mesh::{MeshError, ObjError, PleatsError, Sheet, SpringNetwork, Topology, TriangleMesh, read_obj};
use numbers::{finite_triple, non_negative, positive};

/// A scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// The cloth's shape: the table `sheet` or `obj`.
    pub mesh: Mesh,
    /// What it is made of.
    pub fabric: Fabric,
    /// Vertices that never move. Default none.
    #[serde(default)]
    pub pins: Vec<Pin>,
    /// Acceleration of gravity, in m/s². Default [0, 0, −9.81].
    #[serde(default = "standard_gravity", deserialize_with = "finite_triple")]
    pub gravity: [f64; 3],
    /// Drag per mass, in 1/s: the force −drag m v on every vertex. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    pub drag: f64,
    /// `implicit-euler` (the default), `newton`, `bdf2`, `implicit-midpoint`, `trapezoid`, `symplectic-euler`, `verlet`, `explicit-euler` or
    /// `explicit-euler-as-printed`.
    #[serde(default)]
    pub integrator: Scheme,
    /// Whether a step that fails is tried again with half its size, and so on; see [`Adaptive`]. Default false.
    #[serde(default)]
    pub adaptive: bool,
    /// Time step h, in s.
    #[serde(deserialize_with = "positive")]
    pub dt: f64,
    /// Time to simulate, in s; rounded to whole steps.
    #[serde(deserialize_with = "non_negative")]
    pub duration: f64,
    /// Frames written per simulated second, rounded to whole steps per frame. Default 25.
    #[serde(default = "frame_rate", deserialize_with = "positive")]
    pub frames_per_second: f64,
    /// The folder that relative paths start from: that of the scene file.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// The cloth's shape at rest and at the start.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Mesh {
    /// The built-in sheet.
    Sheet(Sheet),
    /// An OBJ file, with lengths in m.
    Obj {
        /// Its path, from the scene file's folder.
        path: PathBuf,
    },
}

/// A mesh that cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum MeshSourceError {
    /// The OBJ file.
    #[error(transparent)]
    Obj(#[from] ObjError),
    /// The sheet.
    #[error("mesh.sheet: {0}")]
    Sheet(#[from] MeshError),
    /// Its folds.
    #[error("mesh.sheet.pleats: {0}")]
    Pleats(#[from] PleatsError),
}

/// The shape of a cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// At rest.
    pub mesh: TriangleMesh,
    /// The vertices at the start, in m.
    pub start: Vec<[f64; 3]>,
    /// The pairs of vertices that springs would join.
    pub springs: SpringNetwork,
}

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// When the file cannot be read or a key is unknown, missing or has an impossible value.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| SceneError::Unreadable { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Reads a scene from text. The path is for messages, and its folder is where relative paths start.
    ///
    /// # Errors
    /// When a key is unknown, missing or has an impossible value.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SceneError> {
        let mut scene: Self = toml::from_str(text).map_err(|error| SceneError::invalid(path, text, &error))?;
        scene.folder = path.parent().map(Path::to_owned).unwrap_or_default();
        Ok(scene)
    }

    /// The cloth's shape.
    ///
    /// # Errors
    /// When the file cannot be read or the mesh is unfit.
    pub fn shape(&self) -> Result<Shape, MeshSourceError> {
        match &self.mesh {
            Mesh::Sheet(sheet) => {
                Ok(Shape { mesh: sheet.mesh()?, start: sheet.start()?, springs: SpringNetwork::of_sheet(sheet) })
            }
            Mesh::Obj { path } => {
                let mesh = read_obj(&self.folder.join(path))?;
                let springs = SpringNetwork::of_mesh(&Topology::of(&mesh));
                Ok(Shape { start: mesh.vertices().to_vec(), mesh, springs })
            }
        }
    }

    /// The integrator.
    #[must_use]
    pub fn stepper(&self) -> Box<dyn Integrator> {
        let scheme = self.integrator.integrator();
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

fn standard_gravity() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

fn frame_rate() -> f64 {
    25.0
}
