//! Runs a scene from start to end, and writes frames, checkpoints and results.

mod available_memory;
mod checkpoint;
mod film;
mod forecast;
mod frame_files;
mod frame_pictures;
mod frame_store;
mod memory_need;
mod progress;
mod progress_lines;
mod record;
mod recorded_frame;
mod report;
mod results;
pub mod stats;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use energy_solve::EvaluationError;

pub use checkpoint::{Checkpoint, CheckpointError};
pub use energy_files::InputFile;
pub use film::FilmError;
pub use forecast::Forecast;
pub use memory_need::MemoryNeed;
pub use progress::{Log, Progress};
pub use record::{Record, RecordError};
pub use recorded_frame::{FrameError, read_frame};
pub use report::{ReportError, write_report};
pub use results::Ending;

use crate::integrator::StepReport;
use crate::measure::{Measurements, Reading};
use crate::output::{AnimationError, OutputError, OutputFolder, PictureError, Scenery};
use crate::scene::{Scene, SceneError};
use crate::simulation::{Simulation, SimulationError};
use available_memory::available_memory;
use frame_pictures::FramePictures;
use frame_store::{Frame, FrameStore, Vectors};
use memory_need::Gigabytes;

/// A run that cannot be started or completed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The simulation cannot be set up, or a step failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The run would not fit into memory.
    #[error(
        "the run needs {need}, but only {} of memory are available. Use fewer cells or frames, write fewer files, or \
         pass --ignore-memory", Gigabytes(*.available as f64)
    )]
    Memory {
        /// The memory that the run needs.
        need: MemoryNeed,
        /// The memory that is available, in bytes.
        available: u64,
    },
    /// The checkpoint cannot be used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The animation cannot be encoded.
    #[error(transparent)]
    Animation(#[from] AnimationError),
    /// A picture cannot be drawn.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A film cannot be written.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// The ledger cannot be drawn.
    #[error("cannot draw the ledger: {0}")]
    Plot(String),
    /// The final state cannot be evaluated.
    #[error("after the last step: {0}")]
    Evaluation(#[from] EvaluationError),
    /// The state contains numbers that JSON cannot represent.
    #[error("cannot save the state: {0}")]
    Json(#[from] serde_json::Error),
    /// A step failed, and then a file with the results so far could not be written.
    #[error("{failure}; and the results of the steps before it are incomplete: {error}")]
    AlsoUnwritten {
        /// The failed step.
        failure: Box<SimulationError>,
        /// The file that could not be written.
        error: Box<RunError>,
    },
}

/// How to start a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RunOptions {
    /// Whether to replace the files of an earlier run.
    pub overwrite: bool,
    /// Number of steps between checkpoints; `None` for no checkpoints.
    pub checkpoint_interval: Option<u64>,
    /// Whether to start even if the run seems not to fit into memory.
    pub ignore_memory: bool,
    /// Whether to check every frame for crossings, by the exact test.
    pub check_crossings: bool,
}

/// A simulation with its output.
#[derive(Debug)]
pub struct Run {
    scene: Scene,
    text: String,
    path: PathBuf,
    folder: OutputFolder,
    simulation: Simulation,
    frames: FrameStore,
    measurements: Measurements,
    /// Pictures of the frames; `None` before the first step, or if the scene does not want them.
    pictures: Option<FramePictures>,
    /// The largest number of threads.
    threads: usize,
    /// Steps between checkpoints; `None` for no checkpoints.
    checkpoint_interval: Option<u64>,
    /// Whether frames are checked for crossings.
    check_crossings: bool,
    /// The scene file and the files that it names, as they were when the run began.
    scene_file: Option<InputFile>,
    inputs: Vec<InputFile>,
    /// Warnings about the resumption.
    notes: Vec<String>,
}

/// Progress of a run.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// A step was completed.
    Step(&'a Simulation, &'a StepReport),
    /// No step follows; the files that cover the whole run are written.
    LastStep,
}

impl Run {
    /// Creates a run from the text of a scene file. `path` is used in messages and as the base of relative paths. The
    /// output folder is touched only after the scene has been validated.
    ///
    /// # Errors
    /// Returns an error if the scene is invalid, does not fit into memory, or the folder cannot be written to.
    pub fn new(text: String, path: &Path, output: &Path, options: RunOptions) -> Result<Self, RunError> {
        let RunOptions { overwrite, checkpoint_interval, ignore_memory, check_crossings } = options;
        let scene = Scene::parse(&text, path)?;
        if !ignore_memory {
            check_memory(&scene)?;
        }
        let mut simulation = Simulation::new(&scene)?;
        if scene.output.ledger {
            simulation.keep_ledger()?;
        }
        let folder = OutputFolder::open(output, overwrite)?;
        let saved = checkpoint_interval.map(|_| folder.path().join(OutputFolder::SAVED_FRAMES));
        let mut run = Self {
            text,
            path: path.to_owned(),
            folder,
            measurements: simulation.measurements(),
            simulation,
            frames: FrameStore::new(saved, &scene.output)?,
            pictures: None,
            threads: available_threads(),
            checkpoint_interval,
            check_crossings,
            scene_file: InputFile::of(path),
            inputs: inputs_of(&scene),
            notes: Vec::new(),
            scene,
        };
        run.note_missing_ffmpeg();
        run.add_frame()?;
        Ok(run)
    }

    /// Limits the number of threads; see [`Simulation::with_threads`].
    #[must_use]
    pub fn with_threads(self, threads: usize) -> Self {
        Self { simulation: self.simulation.with_threads(threads), threads, ..self }
    }

    /// Resumes from the last checkpoint in a folder, or from the one before it if the last one is damaged. Frames that
    /// are missing or truncated are written again. With `accept_edited`, continues with meshes and materials that were
    /// edited since the run began.
    ///
    /// # Errors
    /// Returns an error if the checkpoint is missing, damaged, of another version, or does not fit the scene, or if
    /// files of the scene were edited.
    pub fn resume(output: &Path, accept_edited: bool) -> Result<Self, RunError> {
        Self::resume_checked(output, accept_edited, |_| Ok(()))
    }

    /// Resumes as [`Self::resume`] does, after a check of the scene in the checkpoint. The scene of a stranger's run
    /// should pass [`Scene::check_paths`] before its files are read.
    ///
    /// # Errors
    /// Returns an error as [`Self::resume`] does, or if the check fails.
    pub fn resume_checked(
        output: &Path,
        accept_edited: bool,
        check: impl Fn(&Scene) -> Result<(), SceneError>,
    ) -> Result<Self, RunError> {
        let [last, previous] =
            [OutputFolder::CHECKPOINT, OutputFolder::PREVIOUS_CHECKPOINT].map(|name| output.join(name));
        // Without a checkpoint, no folder is created.
        if !last.exists() && !previous.exists() {
            Checkpoint::read(&last)?;
        }
        let folder = OutputFolder::reopen(output)?;
        match Self::resume_from(&last, folder.clone(), accept_edited, &check) {
            Err(RunError::Checkpoint(error)) if error.is_of_the_file() && previous.symlink_metadata().is_ok() => {
                let mut run = Self::resume_from(&previous, folder, accept_edited, &check)?;
                run.folder.restore_checkpoint()?;
                run.notes.push(format!("{error}; the run continues from the checkpoint before it"));
                Ok(run)
            }
            resumed => resumed,
        }
    }

    /// Resumes from a checkpoint in an open folder.
    fn resume_from(
        checkpoint: &Path,
        folder: OutputFolder,
        accept_edited: bool,
        check: &impl Fn(&Scene) -> Result<(), SceneError>,
    ) -> Result<Self, RunError> {
        let saved = Checkpoint::read(checkpoint)?;
        let scene = Scene::parse(&saved.scene, &saved.path)?;
        check(&scene)?;
        let edited = saved.inputs.iter().find(|input| input.is_edited()).filter(|_| !accept_edited);
        if let Some(InputFile { path, .. }) = edited {
            return Err(CheckpointError::Edited { path: path.clone() }.into());
        }
        let mut simulation = Simulation::new(&scene)?;
        simulation.restore(saved.state).map_err(CheckpointError::State)?;
        let (path, vertices) = (folder.path().join(OutputFolder::SAVED_FRAMES), simulation.positions().len());
        let (frames, vectors) =
            FrameStore::reopen(&path, saved.frames, vertices, &scene.output, saved.frames_checksum)?;
        let mut run = Self {
            text: saved.scene,
            path: saved.path,
            folder,
            simulation,
            frames,
            measurements: saved.measurements,
            pictures: None,
            threads: available_threads(),
            checkpoint_interval: Some(saved.every),
            check_crossings: saved.check_crossings,
            scene_file: saved.scene_file,
            inputs: inputs_of(&scene),
            notes: Vec::new(),
            scene,
        };
        run.note_edited_scene();
        run.note_missing_ffmpeg();
        run.repair_frames(&vectors)?;
        Ok(run)
    }

    fn note_edited_scene(&mut self) {
        if let Some(file) = self.scene_file.as_ref().filter(|file| file.is_edited()) {
            self.notes.push(format!(
                "{} was edited since the run began; the run continues with the scene as it was then",
                file.path.display()
            ));
        }
    }

    fn note_missing_ffmpeg(&mut self) {
        if self.scene.output.mp4 && !film::has_ffmpeg() {
            self.notes.push(format!("{} will not be written: the program ffmpeg was not found", OutputFolder::FILM));
            self.scene.output.mp4 = false;
        }
    }

    /// Writes frames again that are missing or truncated.
    fn repair_frames(&mut self, vectors: &[Vectors]) -> Result<(), RunError> {
        let frames = self.frames.frames().iter().zip(vectors).enumerate();
        let written = frames.map(|(number, (x, vectors))| self.write_frame_files(number, x, vectors, true));
        let count: usize = written.sum::<Result<usize, RunError>>()?;
        if count > 0 {
            self.notes.push(format!("{count} files of frames were missing or truncated, and were written again"));
        }
        Ok(())
    }

    /// Warnings about the start of the run.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The simulation of the run.
    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Simulates to the end, or until `stop` is set; then the current step is completed. The results so far are written
    /// in any case, also after a failed step, which [`Ending::failure`] holds. If `stop` is set only after the last
    /// step, the remaining files are abandoned.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub fn go(&mut self, stop: &AtomicBool, mut on_event: impl FnMut(Event<'_>)) -> Result<Ending, RunError> {
        self.start_pictures()?;
        let failure = self.step_to_end(stop, &mut on_event)?;
        on_event(Event::LastStep);
        self.finish(failure, stop)
    }

    /// Takes the steps, and returns the failure of the last one.
    fn step_to_end(
        &mut self,
        stop: &AtomicBool,
        on_event: &mut impl FnMut(Event<'_>),
    ) -> Result<Option<SimulationError>, RunError> {
        while !self.simulation.is_finished() && !stop.load(Ordering::Relaxed) {
            let report = match self.simulation.step() {
                Ok(report) => report,
                Err(failure) => return Ok(Some(failure)),
            };
            on_event(Event::Step(&self.simulation, &report));
            let done = self.simulation.steps_done();
            if done.is_multiple_of(self.scene.time_grid().steps_per_frame) {
                self.add_frame()?;
            }
            if self.checkpoint_interval.is_some_and(|steps| done.is_multiple_of(steps)) {
                self.save()?;
            }
        }
        if self.checkpoint_interval.is_some() && !self.simulation.is_finished() {
            self.save()?;
        }
        Ok(None)
    }

    /// Starts to draw the pictures of frames, of which a resumed run has some. They take a thread of the simulation.
    fn start_pictures(&mut self) -> Result<(), RunError> {
        if !self.scene.output.has_frame_pictures() {
            return Ok(());
        }
        let rate = self.scene.time_grid().frames_per_second;
        let scenery = Scenery::of(&self.simulation, self.scene.output.style());
        let mut pictures = FramePictures::start(scenery, self.folder.clone(), rate, self.threads);
        self.simulation.set_threads(self.threads.saturating_sub(1).max(1));
        self.frames.frames().iter().try_for_each(|frame| pictures.add(Frame::clone(frame)))?;
        self.pictures = Some(pictures);
        Ok(())
    }

    fn add_frame(&mut self) -> Result<(), RunError> {
        if self.check_crossings {
            self.simulation.check_crossings();
        }
        let x = self.simulation.positions();
        let forces = if self.scene.output.contact_forces { self.simulation.contact_forces() } else { Vec::new() };
        let vectors = Vectors { velocities: self.simulation.velocities().to_vec(), forces };
        self.write_frame_files(self.frames.frames().len(), x, &vectors, false)?;
        let frame = Frame::from(x);
        if let Some(pictures) = &mut self.pictures {
            pictures.add(Frame::clone(&frame))?;
        }
        self.frames.add(frame, &vectors)?;
        // JSON has no infinite forces; such a run is about to fail.
        self.measurements.readings.extend(Some(self.simulation.reading()).filter(Reading::is_finite));
        Ok(())
    }

    fn save(&mut self) -> Result<(), RunError> {
        self.frames.sync()?;
        let checkpoint = Checkpoint {
            scene: self.text.clone(),
            path: self.absolute_path(),
            scene_file: self.scene_file.clone(),
            inputs: self.inputs.clone(),
            every: self.checkpoint_interval.unwrap_or(u64::MAX),
            frames: self.frames.frames().len(),
            frames_checksum: self.frames.checksum(),
            measurements: self.measurements.clone(),
            check_crossings: self.check_crossings,
            state: self.simulation.save(),
        };
        self.folder.write_checkpoint(&checkpoint.to_bytes()?)?;
        Ok(())
    }

    /// The absolute path of the scene file, so that its relative paths still resolve when the run is read from
    /// elsewhere.
    fn absolute_path(&self) -> PathBuf {
        std::path::absolute(&self.path).unwrap_or_else(|_| self.path.clone())
    }

    /// The output folder.
    #[must_use]
    pub fn folder(&self) -> &OutputFolder {
        &self.folder
    }

    /// Whether the run writes checkpoints.
    #[must_use]
    pub fn leaves_checkpoints(&self) -> bool {
        self.checkpoint_interval.is_some()
    }
}

/// The meshes and materials of a scene.
fn inputs_of(scene: &Scene) -> Vec<InputFile> {
    scene.input_files().iter().filter_map(|path| InputFile::of(path)).collect()
}

fn available_threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

fn check_memory(scene: &Scene) -> Result<(), RunError> {
    let need = MemoryNeed::of(scene);
    match available_memory(Path::new("/")) {
        Some(available) if need.total() > available as f64 => Err(RunError::Memory { need, available }),
        _ => Ok(()),
    }
}
