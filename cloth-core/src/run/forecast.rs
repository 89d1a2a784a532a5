//! Forecasts the size, memory and time of a run, for `cloth run --dry-run`.

use std::fmt;
use std::path::Path;
use std::time::{Duration, Instant};

use super::available_memory::available_memory;
use super::memory_need::{Gigabytes, MemoryNeed};
use super::progress_lines::Seconds;
use super::{RunError, available_threads};
use crate::fabric::Locking;
use crate::scene::Scene;
use crate::simulation::{Simulation, SimulationError};

/// A forecast of a run. It writes no file.
#[derive(Debug)]
pub struct Forecast {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of pinned vertices.
    pub pinned: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of steps.
    pub steps: u64,
    /// Number of frames.
    pub frames: u64,
    /// Estimated need of memory.
    pub memory: MemoryNeed,
    /// Available memory, in bytes; `None` if the system does not tell.
    pub available: Option<u64>,
    /// Warnings about the scene.
    pub warnings: Vec<String>,
    /// Estimates of locking, with the names of the garments.
    pub locking: Vec<(String, Locking)>,
    /// Steps that were taken to measure the time.
    pub measured_steps: u64,
    /// The mean time of these steps.
    pub step_time: Duration,
    /// Why the last of them failed; `None` if it did not.
    pub failure: Option<SimulationError>,
}

/// Largest number of steps to measure.
const MEASURED_STEPS: u64 = 20;
/// Time after which no further step is measured.
const MEASURED_TIME: Duration = Duration::from_secs(3);

impl Forecast {
    /// Sets a scene up and measures its first steps.
    ///
    /// # Errors
    /// Returns an error if the scene is invalid.
    pub fn of(text: &str, path: &Path, threads: Option<usize>) -> Result<Self, RunError> {
        let scene = Scene::parse(text, path)?;
        let (memory, available) = (MemoryNeed::of(&scene), available_memory(Path::new("/")));
        let mut simulation = Simulation::new(&scene)?.with_threads(threads.unwrap_or_else(available_threads));
        let (started, mut failure) = (Instant::now(), None);
        while !simulation.is_finished()
            && simulation.steps_done() < MEASURED_STEPS
            && started.elapsed() < MEASURED_TIME
            && failure.is_none()
        {
            failure = simulation.step().err();
        }
        let vertices = simulation.positions().len();
        let measured_steps = simulation.steps_done();
        Ok(Self {
            vertices,
            pinned: (0..vertices).filter(|&vertex| simulation.is_pinned(vertex)).count(),
            triangles: simulation.triangles().len(),
            steps: simulation.steps(),
            frames: simulation.steps() / scene.time_grid().steps_per_frame + 1,
            memory,
            available,
            warnings: simulation.warnings().to_vec(),
            locking: simulation.locking().to_vec(),
            measured_steps,
            step_time: started.elapsed() / u32::try_from(measured_steps.max(1)).unwrap_or(u32::MAX),
            failure,
        })
    }

    /// The estimated time of all steps, in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.step_time.as_secs_f64() * self.steps as f64
    }
}

impl fmt::Display for Forecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} vertices ({} pinned), {} triangles", self.vertices, self.pinned, self.triangles)?;
        writeln!(f, "{} steps, {} frames", self.steps, self.frames)?;
        let available = self.available.map(|bytes| format!(", {} are available", Gigabytes(bytes as f64)));
        writeln!(f, "memory: about {}{}", Gigabytes(self.memory.total()), available.unwrap_or_default())?;
        // Those that lock are among the warnings.
        for (garment, locking) in self.locking.iter().filter(|(_, locking)| !locking.locks()) {
            writeln!(f, "{garment}: {locking}")?;
        }
        match &self.failure {
            Some(failure) => write!(f, "it fails after {} steps: {failure}", self.measured_steps),
            None => write!(
                f,
                "time: about {}, from {} steps of {:.3} s; steps with more contact take longer",
                Seconds(self.time()),
                self.measured_steps,
                self.step_time.as_secs_f64()
            ),
        }
    }
}
