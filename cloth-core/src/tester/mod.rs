//! A textile lab: the testers of KES-F and Cusick's drape, as scenes of the simulator.
//!
//! Each [`Trial`] is a scene that `cloth run` could run, too. Its curve is read off the loads on the clamps. It is
//! compared with the *input*: the curve of the declared material on the same mesh, deformed uniformly.
//!
//! Sources: Kawabata (1980), "The standardization and analysis of hand evaluation"; Cusick (1968), "The measurement of
//! fabric drape", J. Textile Institute 59, 253–260.

mod bending;
mod curve;
mod cusick;
mod fabric;
mod outcome;
mod results;
mod scene;
mod specimen;

use std::path::PathBuf;

use energy_solve::EvaluationError;
use serde::Serialize;

pub use curve::Curve;
pub use fabric::TestedFabric;
pub use outcome::{Number, Outcome};
pub use results::{RESULT_FILES, Results};

use crate::measure::DrapeError;
use crate::mesh::MeshError;
use crate::run::{FrameError, Record, RecordError};
use crate::scene::SceneError;
use crate::simulation::SimulationError;
use specimen::Uniform;

/// A test that cannot be prepared or evaluated.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum TesterError {
    /// The file of the fabric cannot be read.
    #[error("cannot read {}", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// The file of the fabric is not TOML.
    #[error("{}: {message}", .path.display())]
    Malformed { path: PathBuf, message: String },
    /// The file has no fabric.
    #[error("{} has no table `[fabric]`; `cloth fabrics` prints some", .path.display())]
    NoFabric { path: PathBuf },
    /// The fabric is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The fabric does not fit the specimen.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The declared material cannot be evaluated.
    #[error("the declared material cannot be evaluated: {0}")]
    Evaluation(#[from] EvaluationError),
    /// The mesh of the specimen is invalid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The scene cannot be written as TOML.
    #[error(transparent)]
    Unwritable(#[from] toml::ser::Error),
    /// The record of a test cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The last frame of a test cannot be read.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The record of a test has fewer readings or pins than the test.
    #[error("{} holds no readings of this test; remove the folder, and start the test again", .path.display())]
    NoReadings { path: PathBuf },
    /// The drape cannot be measured.
    #[error(transparent)]
    Drape(#[from] DrapeError),
    /// A plot cannot be drawn.
    #[error("cannot draw {name}: {message}")]
    Plot { name: String, message: String },
}

/// Threads that run between the clamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Threads {
    /// Warp threads.
    Warp,
    /// Weft threads.
    Weft,
}

impl Threads {
    /// Direction of the warp if these threads run along the first axis.
    fn across_clamps(self) -> [f64; 3] {
        match self {
            Self::Warp => [1.0, 0.0, 0.0],
            Self::Weft => [0.0, 1.0, 0.0],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Warp => "warp",
            Self::Weft => "weft",
        }
    }
}

/// A test of a fabric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Trial {
    /// Tension to 490.3 N/m (500 gf/cm) of a specimen 20 cm wide between clamps 5 cm apart.
    Tensile(Threads),
    /// Shear of the same specimen to ±8° under a tension of 9.8 N/m (10 gf/cm) along the warp.
    Shear,
    /// Pure bending of a strip of 1 cm to ±250/m.
    Bending(Threads),
    /// Drape of a disc of 30 cm between discs of 18 cm.
    Drape,
}

impl Trial {
    /// All tests, in the order in which they run.
    pub const ALL: [Self; 6] = [
        Self::Tensile(Threads::Warp),
        Self::Tensile(Threads::Weft),
        Self::Shear,
        Self::Bending(Threads::Warp),
        Self::Bending(Threads::Weft),
        Self::Drape,
    ];

    /// The kinds of tests, for choices.
    pub const KINDS: [&'static str; 4] = ["tensile", "shear", "bending", "drape"];

    /// The kind of the test, one of [`Self::KINDS`].
    #[must_use]
    pub fn kind(self) -> &'static str {
        match self {
            Self::Tensile(_) => "tensile",
            Self::Shear => "shear",
            Self::Bending(_) => "bending",
            Self::Drape => "drape",
        }
    }

    /// The name, such as `tensile-warp`: that of its scene file and of its folder.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Tensile(threads) | Self::Bending(threads) => format!("{}-{}", self.kind(), threads.name()),
            Self::Shear | Self::Drape => self.kind().to_owned(),
        }
    }

    /// Returns the scene file of the test for a fabric, and its mesh as an OBJ file, if it needs one.
    ///
    /// # Errors
    /// Returns an error if the fabric does not fit the specimen.
    pub fn scene(self, fabric: &TestedFabric) -> Result<(String, Option<String>), TesterError> {
        let text = match self {
            Self::Tensile(threads) => {
                let end = specimen::tensile_end(&mut Uniform::new(fabric, threads)?)?;
                specimen::tensile_scene(threads, end)
            }
            Self::Shear => specimen::shear_scene(specimen::shear_strain(&mut Uniform::new(fabric, Threads::Warp)?)?),
            Self::Bending(threads) => bending::scene(threads),
            Self::Drape => {
                let mesh = cusick::specimen()?;
                let obj = mesh_io::obj::obj_text(&mesh_io::obj::ObjMesh {
                    positions: mesh.vertices(),
                    digits: 17,
                    normals: None,
                    triangles: mesh.triangles(),
                    strands: &[],
                });
                return Ok((fabric.text(&cusick::scene("drape.obj"))?, Some(obj)));
            }
        };
        Ok((fabric.text(&text)?, None))
    }

    /// Evaluates the finished run of the test in a folder.
    ///
    /// # Errors
    /// Returns an error if the folder does not hold such a run.
    pub fn outcome(self, fabric: &TestedFabric, folder: &std::path::Path) -> Result<Outcome, TesterError> {
        let record = Record::read(folder)?;
        let (measured, pins) = (&record.measurements, if self == Self::Drape { 1 } else { 2 });
        let is_read = |reading: &crate::measure::Reading| reading.pins.len() == pins;
        if measured.readings.is_empty() || !measured.readings.iter().all(is_read) {
            return Err(TesterError::NoReadings { path: folder.to_owned() });
        }
        match self {
            Self::Tensile(threads) => {
                let mut uniform = Uniform::new(fabric, threads)?;
                let end = specimen::tensile_end(&mut uniform)?;
                Ok(Outcome::tensile(self, threads, specimen::tensile_curve(measured), uniform.tensile(end)?))
            }
            Self::Shear => {
                let mut uniform = Uniform::new(fabric, Threads::Warp)?;
                let strain = specimen::shear_strain(&mut uniform)?;
                Ok(Outcome::shear(specimen::shear_curve(measured), uniform.shear(strain)?))
            }
            Self::Bending(threads) => {
                Ok(Outcome::bending(self, threads, bending::curve(measured), bending::input(fabric, threads)?))
            }
            Self::Drape => {
                let mesh = cusick::specimen()?;
                let last = record.frames.saturating_sub(1);
                let x = crate::run::read_frame(folder, last, mesh.vertices().len())?;
                Ok(Outcome::drape(&cusick::measure(&x, &mesh)?, &x, &mesh))
            }
        }
    }
}
