//! The frames of a track, from the first or from a checkpoint to the last or to a signal.

use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use energy_cli::{Interrupts, print, tell, write_file};
use fusion_core::body::obj_text;
use fusion_core::twist::Twist;
use serde::Serialize;

use super::folder::{FRAMES, MESHES, NODES, SURFACE, mesh_file};
use super::frame::{Line, change, times, track_frame};
use super::journal::{Done, Journal};
use super::progress_bar;
use super::surface_output::SurfaceOutput;
use super::track::{Inputs, Track};
use super::track_output::TrackOutput;

/// The time between two checkpoints: at most so much work is lost if the program is killed.
const BETWEEN_CHECKPOINTS: Duration = Duration::from_secs(5);

/// Tracks all frames, or until a signal. Then the frames so far are written, and `fusion resume` continues.
///
/// # Errors
/// If an input cannot be used, or no image could be tracked. In the latter case the table of frames has the reasons.
pub fn begin(track: &Track, interrupts: &Interrupts) -> Result<Ended> {
    let inputs = track.inputs()?;
    let _lock = track.prepare()?;
    let journal = Journal::create(&track.absolute()?)?;
    Session::new(track, inputs, journal)?.go(interrupts)
}

/// A track with its output.
pub struct Session<'a> {
    track: &'a Track,
    inputs: Inputs,
    surface: Option<SurfaceOutput>,
    output: TrackOutput,
    journal: Journal,
    lines: Vec<Line>,
    /// Twists of the nodes by frame.
    motions: Vec<Vec<Twist>>,
}

/// How a track ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// All frames are done.
    Complete,
    /// A signal arrived.
    Stopped,
}

impl Ended {
    /// Returns the exit code of the program.
    pub fn exit_code(self, interrupts: &Interrupts) -> ExitCode {
        match self {
            Self::Complete => ExitCode::SUCCESS,
            Self::Stopped => interrupts.exit_code(),
        }
    }
}

/// Motions of the nodes.
#[derive(Serialize)]
struct NodeMotions<'a> {
    /// Origin of the twists' rotations, in the camera's coordinates, in m.
    origin: [f64; 3],
    angle: fusion_core::twist::AngleConvention,
    /// Positions at rest, relative to the origin.
    nodes: Vec<[f64; 3]>,
    /// Twists by frame, then node.
    frames: &'a [Vec<Twist>],
}

impl<'a> Session<'a> {
    /// Begins the output of a track without frames.
    pub fn new(track: &'a Track, inputs: Inputs, journal: Journal) -> Result<Self> {
        let (parameters, model) = (&inputs.parameters, inputs.tracker.model());
        let surface = || SurfaceOutput::new(model, parameters.surface, parameters.tracker);
        let surface = track.surface.then(surface).transpose()?;
        let output = track.track_output(&inputs.sequence, &inputs.body)?;
        Ok(Self { track, inputs, surface, output, journal, lines: Vec::new(), motions: Vec::new() })
    }

    /// Adds the frames of a journal to the output. Files of the frames that are missing or damaged are written again.
    pub fn replay(&mut self, done: Vec<Done>) -> Result<()> {
        let nodes = self.inputs.tracker.twists().len();
        for (frame, Done { line, twists }) in done.into_iter().enumerate() {
            if line.frame != frame || twists.len() != nodes || frame >= self.inputs.sequence.len() {
                bail!("{}: the frames do not fit the recording; start the track again", self.journal.path().display());
            }
            self.add_output(&line, &twists)?;
            self.lines.push(line);
            self.motions.push(twists);
        }
        Ok(())
    }

    /// Tracks the remaining frames, and writes the results, also if a signal arrives.
    pub fn go(mut self, interrupts: &Interrupts) -> Result<Ended> {
        let length = self.inputs.sequence.len();
        let progress = progress_bar(length, "tracking");
        progress.set_position(self.lines.len() as u64);
        let mut saved = Instant::now();
        while self.lines.len() < length && !interrupts.flag().load(Ordering::Relaxed) {
            let line = self.track_next();
            if let Some(warning) = change(self.lines.last(), &line) {
                progress.suspend(|| tell(&format!("warning: {warning}")));
            }
            let twists = self.inputs.tracker.twists().to_vec();
            self.add_output(&line, &twists)?;
            let done = Done { line, twists };
            self.journal.add(&done)?;
            self.lines.push(done.line);
            self.motions.push(done.twists);
            progress.inc(1);
            if saved.elapsed() >= BETWEEN_CHECKPOINTS {
                self.save()?;
                saved = Instant::now();
            }
        }
        progress.finish_and_clear();
        self.write_nodes()?;
        if self.lines.len() < length { self.stop() } else { self.complete() }
    }

    fn track_next(&mut self) -> Line {
        let frame = self.lines.len();
        let Inputs { sequence, skeleton, tracker, .. } = &mut self.inputs;
        let mut line = track_frame(frame, sequence.image(frame), skeleton.as_ref(), tracker);
        // The same wherever the track is resumed.
        let recording = self.track.recording.join("").display().to_string();
        line.reason = line.reason.replace(&recording, "");
        line
    }

    /// Adds a frame to the files that were asked for.
    fn add_output(&mut self, line: &Line, twists: &[Twist]) -> Result<()> {
        let Inputs { sequence, body, tracker, .. } = &self.inputs;
        let wants_image = self.track.pictures || self.track.surface;
        let image = wants_image.then(|| sequence.image(line.frame).ok()).flatten();
        if let (Some(surface), Some(image)) = (&mut self.surface, image.as_ref().filter(|_| line.is_tracked())) {
            surface.add(tracker, twists, image);
        }
        let vertices = tracker.vertices_at(twists);
        self.output.add(line.frame, image.as_ref().filter(|_| self.track.pictures), &vertices)?;
        let mesh = obj_text(&vertices, &body.mesh.triangles).into_bytes();
        let path = mesh_file(&self.track.output, MESHES, line.frame);
        let is_there = energy_files::read_state(&path, mesh.len() as u64).is_ok_and(|found| found == mesh);
        if is_there { Ok(()) } else { write_file(&path, mesh) }
    }

    /// Writes the table of the frames so far, and a checkpoint.
    fn save(&mut self) -> Result<()> {
        self.write_table()?;
        self.journal.save(&self.inputs.tracker)
    }

    fn stop(mut self) -> Result<Ended> {
        self.save()?;
        let folder = self.track.output.display();
        let (done, all) = (self.lines.len(), self.inputs.sequence.len());
        tell(&format!("stopped after frame {done} of {all}; continue with `fusion resume {folder}`"));
        Ok(Ended::Stopped)
    }

    fn complete(self) -> Result<Ended> {
        self.write_table()?;
        let (tracker, folder) = (&self.inputs.tracker, &self.track.output);
        let fused = self.surface.as_ref().map(|surface| surface.write(folder, tracker.model(), &self.motions));
        let fused = fused.transpose()?;
        // Last, because the size of a glTF file has a limit.
        self.output.finish()?;
        self.journal.remove()?;
        let skipped = self.lines.iter().filter(|line| !line.is_tracked()).count();
        let tracked = self.lines.len() - skipped;
        if let (0, Some(first)) = (tracked, self.lines.first()) {
            let table = folder.join(FRAMES);
            bail!("none of {skipped} frames could be tracked; see {}; the first: {}", table.display(), first.reason);
        }
        print(&format!(
            "tracked {tracked} frames with {} nodes, skipped {skipped}; wrote {}\n",
            tracker.model().nodes.len(),
            folder.display()
        ))?;
        if let Some(vertices) = fused {
            print(&format!("fused a surface of {vertices} vertices: {}\n", folder.join(SURFACE).display()))?;
        }
        if self.track.stats {
            print(&times(&self.lines))?;
        }
        Ok(Ended::Complete)
    }

    fn write_table(&self) -> Result<()> {
        let mut table = csv::Writer::from_writer(Vec::new());
        self.lines.iter().try_for_each(|line| table.serialize(line))?;
        write_file(&self.track.output.join(FRAMES), &table.into_inner()?)
    }

    fn write_nodes(&self) -> Result<()> {
        let model = self.inputs.tracker.model();
        let nodes = NodeMotions {
            origin: model.origin.into(),
            angle: self.inputs.parameters.tracker.energy.angle,
            nodes: model.nodes.iter().map(|&node| node.into()).collect(),
            frames: &self.motions.iter().map(|frame| frame.iter().map(rounded).collect()).collect::<Vec<_>>(),
        };
        write_file(&self.track.output.join(NODES), &serde_json::to_vec(&nodes)?)
    }
}

/// Rounds a twist to nanometres and nanoradians, which halves the size of the file.
fn rounded(twist: &Twist) -> Twist {
    twist.map(|x| (1e9 * x).round() / 1e9)
}
