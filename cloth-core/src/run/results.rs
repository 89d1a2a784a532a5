//! The files that cover a whole run, written at its end.

use std::path::PathBuf;

use super::{Record, Run, RunError, stats};
use crate::output::{OutputFolder, Show, animation_glb, usd_text};
use crate::simulation::{SimulationError, Summary};

/// The outcome of a run.
#[derive(Debug)]
pub struct Ending {
    /// Totals and final state.
    pub summary: Summary,
    /// The files written.
    pub files: Vec<PathBuf>,
    /// Number of frames written.
    pub frames: usize,
    /// Whether all steps were completed.
    pub finished: bool,
    /// The step that failed; `None` if none did. The results cover the steps before it.
    pub failure: Option<SimulationError>,
}

/// Files written so far, and the first error. A file that cannot be written does not keep the others from being
/// written.
#[derive(Debug, Default)]
struct Written {
    files: Vec<PathBuf>,
    error: Option<RunError>,
}

impl Written {
    fn add(&mut self, file: Result<PathBuf, RunError>) {
        match file {
            Ok(path) => self.files.push(path),
            Err(error) => self.error = self.error.take().or(Some(error)),
        }
    }
}

impl Run {
    /// Writes the files that cover the whole run. The summary and the record come first: they are small, and
    /// `cloth report` needs them.
    pub(super) fn finish(&mut self, failure: Option<SimulationError>) -> Result<Ending, RunError> {
        let summary = self.summary_of_good_steps(failure.as_ref())?;
        let mut written = Written::default();
        written.add(self.write_summary(&summary));
        written.add(self.write_record(&summary));
        self.write_ledger(&mut written);
        self.write_shows(&mut written);
        match (written.error, failure) {
            (None, failure) => {
                let (frames, finished) = (self.frames.frames().len(), self.simulation.is_finished());
                Ok(Ending { summary, files: written.files, frames, finished, failure })
            }
            (Some(error), None) => Err(error),
            (Some(error), Some(failure)) => Err(RunError::AlsoUnwritten { failure, error: Box::new(error) }),
        }
    }

    /// Returns the summary. After a failed step it may lack the energies, which may not be finite.
    fn summary_of_good_steps(&mut self, failure: Option<&SimulationError>) -> Result<Summary, RunError> {
        let Some(failure) = failure else { return Ok(self.simulation.summary()?) };
        let mut summary = self.simulation.summary().unwrap_or_else(|_| self.simulation.summary_without_energies());
        summary.warnings.push(format!("the run ended early: {failure}"));
        Ok(summary)
    }

    fn write(&self, name: &str, contents: &[u8]) -> Result<PathBuf, RunError> {
        Ok(self.folder.write(name, contents)?)
    }

    fn write_summary(&self, summary: &Summary) -> Result<PathBuf, RunError> {
        self.write(OutputFolder::SUMMARY, format!("{summary}\n\n{}", stats::tables(summary)).as_bytes())
    }

    fn write_record(&self, summary: &Summary) -> Result<PathBuf, RunError> {
        let (scene, path) = (self.text.clone(), self.absolute_path());
        let (version, frames) = (Record::VERSION, self.frames.frames().len());
        let finished = self.simulation.is_finished();
        let record = Record { version, scene, path, finished, frames, summary: summary.clone() };
        self.write(OutputFolder::RECORD, &serde_json::to_vec_pretty(&record)?)
    }

    fn write_ledger(&self, written: &mut Written) {
        let Some(ledger) = self.simulation.ledger() else { return };
        written.add(self.write(OutputFolder::LEDGER, ledger.csv().as_bytes()));
        let plot = ledger.svg().map_err(RunError::Plot);
        written.add(plot.and_then(|plot| self.write(OutputFolder::LEDGER_PLOT, plot.as_bytes())));
    }

    /// Writes the picture, the animations and the pictures of the frames.
    fn write_shows(&self, written: &mut Written) {
        let (wanted, frames) = (self.scene.output, self.frames.frames());
        let frame_time = self.scene.steps_per_frame() as f64 * self.scene.dt;
        let show = Show::new(&self.simulation, frames, frame_time);
        if wanted.picture {
            let (x, time) = (self.simulation.positions(), self.simulation.time());
            let picture = show.picture(x, time, false).map_err(RunError::from);
            written.add(picture.and_then(|picture| self.write(OutputFolder::PICTURE, &picture)));
        }
        if wanted.usd {
            written.add(self.write(OutputFolder::USD, usd_text(&show.tracks(), 1.0 / frame_time).as_bytes()));
        }
        if wanted.gltf {
            let animation = animation_glb(&show.tracks(), frame_time).map_err(RunError::from);
            written.add(animation.and_then(|animation| self.write(OutputFolder::ANIMATION, &animation)));
        }
        if wanted.png {
            for (number, frame) in frames.iter().enumerate() {
                let picture = show.picture(frame, number as f64 * frame_time, true).map_err(RunError::from);
                let file = picture.and_then(|picture| Ok(self.folder.write_frame(number, "png", &picture)?));
                if let Err(error) = file {
                    return written.add(Err(error));
                }
            }
        }
    }
}
