//! Measures a finished run, a scene or a mesh: drape, strain, and extension against force.

mod pull;
mod table;

use std::path::{Path, PathBuf};

use energy_dsl::Vector3;
use serde::Serialize;

pub use pull::{Pull, PullPoint};

use crate::measure::{Drape, DrapeError, DrapeOptions, Measurements, Strain};
use crate::mesh::{ObjError, TriangleMesh, lumped_masses, read_obj};
use crate::run::{FrameError, Record, RecordError, read_frame};
use crate::scene::{Scene, SceneError};
use crate::simulation::{Simulation, SimulationError};

/// A run, scene or mesh that cannot be measured.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum SurveyError {
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The simulation cannot be set up, or a step failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The record of the run cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The last frame of the run cannot be read.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The run has no frame.
    #[error("{} has no frame: the run ended before the first one", .path.display())]
    NoFrame { path: PathBuf },
    /// The mesh cannot be read.
    #[error(transparent)]
    Mesh(#[from] ObjError),
    /// No garment has this name.
    #[error("there is no garment called `{name}`; there are {}", .known.join(", "))]
    NoSuchGarment { name: String, known: Vec<String> },
    /// No pin or group has this label.
    #[error(
        "there is no pin or group `{name}`; there are {}",
        if .known.is_empty() { "none".to_owned() } else { .known.join(", ") }
    )]
    NoSuchPin { name: String, known: Vec<String> },
    /// The drape of a garment cannot be measured.
    #[error("{garment}: {source}")]
    Drape { garment: String, source: DrapeError },
}

/// Selects the garments, pins and discs to measure.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SurveyOptions {
    /// How to measure drapes. The direction up is set by the gravity of a scene.
    pub drape: DrapeOptions,
    /// The garment to measure; `None` for all.
    pub garment: Option<String>,
    /// Labels of two pins or groups whose distance is the extension; `None` for the only two.
    pub between: Option<[String; 2]>,
}

/// The measurements of a run, a scene or a mesh. `Display` prints them as tables.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Survey {
    /// Time of the shapes that were measured, in s; `None` for a mesh.
    pub time: Option<f64>,
    /// The garments at that time.
    pub garments: Vec<GarmentSurvey>,
    /// Extension against force; `None` if there are not exactly two pins or groups, and none were named.
    pub pull: Option<Pull>,
    /// Loads and strains over time; no readings for a mesh, and for runs of earlier versions.
    pub measurements: Measurements,
}

/// The measurements of one garment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GarmentSurvey {
    /// Name of the garment, or of the file of a mesh.
    pub name: String,
    /// Strain; `None` for a mesh, whose rest shape is unknown, and for a garment without warp directions.
    pub strain: Option<Strain>,
    /// Drape on a disc.
    pub drape: Drape,
}

impl Survey {
    /// Measures the last frame of a finished run, and its record.
    ///
    /// # Errors
    /// Returns an error if the folder does not hold a finished run with OBJ or PLY frames, or the options do not fit.
    pub fn of_run(folder: &Path, options: &SurveyOptions) -> Result<Self, SurveyError> {
        let record = Record::read(folder)?;
        let scene = Scene::parse(&record.scene, &record.path)?;
        let simulation = Simulation::new(&scene)?;
        let last = record.frames.checked_sub(1).ok_or_else(|| SurveyError::NoFrame { path: folder.to_owned() })?;
        let x = read_frame(folder, last, simulation.positions().len())?;
        let time = scene.time_grid().frame_time(last);
        Self::of_shape(&scene, &simulation, &x, time, record.measurements, options)
    }

    /// Simulates a scene to its end, or until `on_step` returns `false`, and measures it. Writes nothing.
    ///
    /// # Errors
    /// Returns an error if the scene is invalid, a step fails, or the options do not fit.
    pub fn of_scene(
        scene: &Scene,
        options: &SurveyOptions,
        mut on_step: impl FnMut(&Simulation) -> bool,
    ) -> Result<Self, SurveyError> {
        let mut simulation = Simulation::new(scene)?;
        let mut measurements = simulation.measurements();
        measurements.readings.push(simulation.reading());
        let interval = scene.time_grid().steps_per_frame;
        while !simulation.is_finished() && on_step(&simulation) {
            simulation.step()?;
            if simulation.steps_done().is_multiple_of(interval) {
                measurements.readings.push(simulation.reading());
            }
        }
        let (x, time) = (simulation.positions(), simulation.time());
        Self::of_shape(scene, &simulation, x, time, measurements, options)
    }

    /// Measures a mesh: the drape of an OBJ file. Unless the options say otherwise, the flat specimen has its area.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or the options do not fit.
    pub fn of_mesh(path: &Path, options: &SurveyOptions) -> Result<Self, SurveyError> {
        let mesh = read_obj(path)?;
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let drape = drape(&name, &mesh, mesh.vertices(), &options.drape)?;
        let garments = vec![GarmentSurvey { name, strain: None, drape }];
        Ok(Self { time: None, garments, pull: None, measurements: Measurements::default() })
    }

    fn of_shape(
        scene: &Scene,
        simulation: &Simulation,
        x: &[Vector3<f64>],
        time: f64,
        measurements: Measurements,
        options: &SurveyOptions,
    ) -> Result<Self, SurveyError> {
        let up = scene.gravity.map(|part| -part);
        let on_floor = DrapeOptions { up, ..options.drape };
        let (mut garments, mut known) = (Vec::new(), Vec::new());
        for (number, strain) in simulation.strains_at(x).into_iter().enumerate() {
            let (Some(part), Some(mesh)) = (simulation.parts().get(number), simulation.mesh(number)) else { continue };
            let name = part.name.clone();
            known.push(name.clone());
            if options.garment.as_ref().is_none_or(|wanted| *wanted == name) {
                let drape = drape(&name, mesh, &x[part.vertices.clone()], &on_floor)?;
                garments.push(GarmentSurvey { name, strain, drape });
            }
        }
        if let Some(name) = options.garment.clone().filter(|_| garments.is_empty()) {
            return Err(SurveyError::NoSuchGarment { name, known });
        }
        let pull = Pull::of(&measurements, options.between.as_ref())?;
        Ok(Self { time: Some(time), garments, pull, measurements })
    }
}

/// Measures the drape of a garment.
fn drape(garment: &str, rest: &TriangleMesh, x: &[Vector3<f64>], options: &DrapeOptions) -> Result<Drape, SurveyError> {
    let area = lumped_masses(rest, 1.0).iter().sum();
    let measured = Drape::measure(x, rest.triangles(), area, options);
    measured.map_err(|source| SurveyError::Drape { garment: garment.to_owned(), source })
}
