//! The files that cover a whole run, written at its end.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{Record, Run, RunError, stats};
use crate::output::{OutputFolder, Show, animation_glb, mdd_bytes, pc2_bytes, usd_text};
use crate::simulation::{SimulationError, Summary};

/// The largest number of loads on pins in the record; the file of measurements has all.
const MOST_LOADS: usize = 100_000;

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
    /// Whether a signal after the last step kept files from being written.
    pub abandoned: bool,
    /// The step that failed; `None` if none did. The results cover the steps before it.
    pub failure: Option<SimulationError>,
}

/// Files written so far, and the first error. A file that cannot be written does not keep the others from being
/// written; a signal does.
#[derive(Debug)]
struct Written<'a> {
    files: Vec<PathBuf>,
    error: Option<RunError>,
    stop: &'a AtomicBool,
    /// Whether a signal had arrived before the first file. It ended the steps, and the files are written nevertheless.
    was_stopped: bool,
}

impl<'a> Written<'a> {
    fn new(stop: &'a AtomicBool) -> Self {
        Self { files: Vec::new(), error: None, stop, was_stopped: stop.load(Ordering::Relaxed) }
    }

    fn is_abandoned(&self) -> bool {
        !self.was_stopped && self.stop.load(Ordering::Relaxed)
    }

    /// Writes a file, if it is wanted.
    fn add(&mut self, is_wanted: bool, write: impl FnOnce() -> Result<PathBuf, RunError>) {
        if is_wanted && !self.is_abandoned() {
            match write() {
                Ok(path) => self.files.push(path),
                Err(error) => self.note(error),
            }
        }
    }

    fn note(&mut self, error: RunError) {
        self.error = self.error.take().or(Some(error));
    }
}

impl Run {
    /// Writes the files that cover the whole run. The summary and the record come first: they are small, and
    /// `cloth report` needs them.
    pub(super) fn finish(&mut self, failure: Option<SimulationError>, stop: &AtomicBool) -> Result<Ending, RunError> {
        let mut written = Written::new(stop);
        let summary = self.summary_of_good_steps(failure.as_ref())?;
        written.add(true, || self.write_summary(&summary));
        written.add(true, || self.write_record(&summary));
        written.add(self.scene.output.measurements, || {
            self.write(OutputFolder::MEASUREMENTS, self.measurements.csv().as_bytes())
        });
        self.write_ledger(&mut written);
        self.write_shows(&mut written);
        if let Some(mut pictures) = self.pictures.take() {
            pictures.finish(|| written.is_abandoned()).unwrap_or_else(|error| written.note(error));
        }
        let (wanted, rate) = (&self.scene.output, self.scene.time_grid().frames_per_second);
        written.add(wanted.apng, || self.write_apng(rate));
        written.add(wanted.mp4, || self.write_film(rate));
        let abandoned = written.is_abandoned();
        if abandoned && self.checkpoint_interval.is_some() {
            self.save()?;
        }
        match (written.error, failure) {
            (None, failure) => {
                let (frames, finished) = (self.frames.frames().len(), self.simulation.is_finished());
                Ok(Ending { summary, files: written.files, frames, finished, abandoned, failure })
            }
            (Some(error), None) => Err(error),
            (Some(error), Some(failure)) => {
                Err(RunError::AlsoUnwritten { failure: Box::new(failure), error: Box::new(error) })
            }
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
        let (summary, measurements) = (summary.clone(), self.measurements.thinned(MOST_LOADS));
        let record = Record { version, scene, path, finished, frames, summary, measurements };
        self.write(OutputFolder::RECORD, &serde_json::to_vec_pretty(&record)?)
    }

    fn write_ledger(&self, written: &mut Written<'_>) {
        let Some(ledger) = self.simulation.ledger() else { return };
        written.add(true, || self.write(OutputFolder::LEDGER, ledger.csv().as_bytes()));
        written.add(true, || self.write(OutputFolder::LEDGER_PLOT, ledger.svg().map_err(RunError::Plot)?.as_bytes()));
        if let Some(plot) = ledger.contact_svg() {
            written.add(true, || self.write(OutputFolder::CONTACT_PLOT, plot.map_err(RunError::Plot)?.as_bytes()));
        }
    }

    /// Writes the picture and the animations.
    fn write_shows(&self, written: &mut Written<'_>) {
        let (wanted, frames) = (&self.scene.output, self.frames.frames());
        let rate = self.scene.time_grid().frames_per_second;
        let show = Show::new(&self.simulation, frames, rate, wanted.style());
        let picture = || show.picture(self.simulation.positions(), self.simulation.time());
        written.add(wanted.picture, || self.write(OutputFolder::PICTURE, &picture()?));
        let show = show.with_vectors(self.frames.vectors().iter().map(|frame| [&frame.velocities[..], &frame.forces]));
        let usd = || usd_text(&show.tracks(), rate);
        written.add(wanted.usd, || self.write(OutputFolder::USD, usd().as_bytes()));
        let gltf = || animation_glb(&show.tracks(), rate);
        written.add(wanted.gltf, || self.write(OutputFolder::ANIMATION, &gltf()?));
        for (number, part) in self.simulation.parts().iter().enumerate() {
            let frames: Vec<_> = frames.iter().map(|frame| &frame[part.vertices.clone()]).collect();
            written.add(wanted.pc2, || self.write_cache(number, "pc2", &pc2_bytes(&frames)));
            written.add(wanted.mdd, || self.write_cache(number, "mdd", &mdd_bytes(&frames, rate)));
        }
    }

    /// Writes a point cache of a part, named after it.
    fn write_cache(&self, part: usize, extension: &str, contents: &[u8]) -> Result<PathBuf, RunError> {
        let parts = self.simulation.parts();
        // File systems allow names of 255 bytes.
        let start = |name: &str| name.chars().take(100).collect::<String>();
        let plain = |name: &str| start(name).replace(|c: char| !c.is_ascii_alphanumeric() && c != '-', "_");
        let name = plain(&parts[part].name);
        // Names that differ in other characters only get their number.
        let is_unique = parts.iter().filter(|other| plain(&other.name) == name).count() == 1;
        let name = if is_unique { name } else { format!("{name}_{part}") };
        Ok(self.folder.write_cache(&format!("{name}.{extension}"), contents)?)
    }
}
