use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use energy_cli::write_file;
use fusion_core::body::obj_text;
use fusion_core::depth::DepthSequence;
use fusion_core::energy::BoneMode;
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::skeleton::Skeleton;
use fusion_core::tracker::{FrameReport, Tracker, TrackerOptions};
use fusion_core::twist::Twist;
use serde::{Deserialize, Serialize};

use super::folder::{FRAMES, MODEL, NODES, SKELETON, mesh_file, prepare};
use super::render::read_any_body;
use super::{print, progress_bar};

/// Options of `fusion track`.
#[derive(Debug, Args)]
pub struct Track {
    /// Folder of depth images with `intrinsics.json`, and `depth.txt` or `depth/*.png`. The first image shows the model
    /// at rest.
    recording: PathBuf,
    /// Model in the camera's coordinates: `.json`, `.glb` or a folder [default: the recording's `model.json`].
    #[arg(long)]
    model: Option<PathBuf>,
    /// Bones of a body tracker [default: the recording's `skeleton.json`, if it exists].
    #[arg(long)]
    skeleton: Option<PathBuf>,
    /// Track without bones: nodes start where they were.
    #[arg(long, conflicts_with_all = ["skeleton", "unknown_bones"])]
    no_bones: bool,
    /// Treat bones as unknowns near the reported motions.
    #[arg(long)]
    unknown_bones: bool,
    /// Options of model and tracker (`.json`): `{"model": {…}, "tracker": {…}}`.
    #[arg(long)]
    options: Option<PathBuf>,
    /// Output folder.
    #[arg(short, long)]
    output: PathBuf,
    /// Replace an earlier track.
    #[arg(long)]
    overwrite: bool,
}

/// Options in a file.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Parameters {
    model: ModelOptions,
    tracker: TrackerOptions,
}

/// A row of the table of frames.
#[derive(Debug, Default, Serialize)]
struct Line {
    frame: usize,
    status: &'static str,
    matches: usize,
    iterations: usize,
    energy: f64,
    nonrigid: f64,
    graph: f64,
    binding: f64,
    skeleton: f64,
    prior: f64,
    joints: f64,
    reason: String,
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

/// Numbers of frames.
pub struct Tracked {
    /// Tracked frames.
    pub tracked: usize,
    /// Skipped frames; the table has the reasons.
    pub skipped: usize,
}

impl Track {
    /// Options for tracking a recording with the files in its folder.
    pub fn of(recording: &Path, unknown_bones: bool, output: &Path) -> Self {
        Self {
            recording: recording.to_owned(),
            model: None,
            skeleton: None,
            no_bones: false,
            unknown_bones,
            options: None,
            output: output.to_owned(),
            overwrite: true,
        }
    }

    pub fn run(&self) -> Result<Tracked> {
        let sequence = DepthSequence::open(&self.recording)?;
        let model = self.model.clone().unwrap_or_else(|| self.recording.join(MODEL));
        let body = read_any_body(&model).context("the model")?;
        let skeleton = self.skeleton()?;
        let parameters = self.parameters()?;
        let model = DeformationModel::new(&body, parameters.model)?;
        if !model.fill.left.is_empty() {
            eprintln!("warning: {} nodes follow no bone: no attached node can be reached", model.fill.left.len());
        }
        if let Some(skeleton) = &skeleton {
            // Report missing bones before tracking starts.
            skeleton.motions(0, &model.bones)?;
        }
        let mut tracker = Tracker::new(model, sequence.info.camera, parameters.tracker)?;
        prepare(&self.output, &["meshes"], &[FRAMES, NODES], self.overwrite)?;
        let mut lines = Vec::new();
        let mut motions = Vec::new();
        let progress = progress_bar(sequence.len(), "tracking");
        for frame in 0..sequence.len() {
            let line = self.frame(frame, &sequence, skeleton.as_ref(), &mut tracker);
            if !line.reason.is_empty() {
                progress.suspend(|| eprintln!("warning: frame {frame} skipped: {}", line.reason));
            }
            lines.push(line);
            let mesh = obj_text(&tracker.vertices(), &tracker.model().mesh.triangles);
            write_file(&mesh_file(&self.output, "meshes", frame), mesh.as_bytes())?;
            motions.push(tracker.twists().to_vec());
            progress.inc(1);
        }
        progress.finish_and_clear();
        self.write(&lines, &motions, &tracker, parameters.tracker)?;
        let skipped = lines.iter().filter(|line| !line.reason.is_empty()).count();
        let tracked = lines.len() - skipped;
        print(&format!(
            "tracked {tracked} frames with {} nodes, skipped {skipped}; wrote {}\n",
            tracker.model().nodes.len(),
            self.output.display()
        ))?;
        Ok(Tracked { tracked, skipped })
    }

    fn skeleton(&self) -> Result<Option<Skeleton>> {
        let default = self.recording.join(SKELETON);
        match &self.skeleton {
            _ if self.no_bones => Ok(None),
            Some(path) => Ok(Some(Skeleton::read(path)?)),
            None if default.exists() => Ok(Some(Skeleton::read(&default)?)),
            None => Ok(None),
        }
    }

    fn parameters(&self) -> Result<Parameters> {
        let mut parameters = match &self.options {
            Some(path) => {
                let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
                serde_json::from_str(&text).with_context(|| path.display().to_string())?
            }
            None => Parameters::default(),
        };
        match (self.unknown_bones, &self.options) {
            (true, None) => parameters.tracker = TrackerOptions::with_unknown_bones(),
            (true, Some(_)) => parameters.tracker.energy.bones = BoneMode::Unknown,
            (false, _) => {}
        }
        Ok(parameters)
    }

    /// Tracks one frame. An error is recorded in the row, and tracking continues.
    fn frame(
        &self,
        frame: usize,
        sequence: &DepthSequence,
        skeleton: Option<&Skeleton>,
        tracker: &mut Tracker,
    ) -> Line {
        let mut attempt = || -> Result<FrameReport> {
            let image = sequence.image(frame)?;
            let bones = match skeleton {
                Some(skeleton) => skeleton.motions(frame, &tracker.model().bones)?,
                None => None,
            };
            Ok(tracker.track(&image, bones.as_deref())?)
        };
        match attempt() {
            Ok(report) => line(frame, &report),
            Err(error) => Line { frame, status: "skipped", reason: format!("{error:#}"), ..Line::default() },
        }
    }

    fn write(&self, lines: &[Line], motions: &[Vec<Twist>], tracker: &Tracker, options: TrackerOptions) -> Result<()> {
        let mut table = csv::Writer::from_writer(Vec::new());
        lines.iter().try_for_each(|line| table.serialize(line))?;
        write_file(&self.output.join(FRAMES), &table.into_inner()?)?;
        let model = tracker.model();
        let nodes = NodeMotions {
            origin: model.origin.into(),
            angle: options.energy.angle,
            nodes: model.nodes.iter().map(|&node| node.into()).collect(),
            frames: motions,
        };
        write_file(&self.output.join(NODES), &serde_json::to_vec(&nodes)?)
    }
}

fn line(frame: usize, report: &FrameReport) -> Line {
    let last = report.iterations.last();
    let of = |name: &str| {
        last.and_then(|step| step.terms.iter().find(|term| term.name == name)).map_or(0.0, |term| term.energy)
    };
    Line {
        frame,
        status: "tracked",
        matches: report.counts.matched,
        iterations: report.iterations.len(),
        energy: last.map_or(0.0, |step| step.after),
        nonrigid: of("nonrigid"),
        graph: of("graph"),
        binding: of("binding"),
        skeleton: report.skeleton_energy.unwrap_or_else(|| of("skeleton")),
        prior: of("prior"),
        joints: of("joints"),
        reason: String::new(),
    }
}
