use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use energy_cli::write_file;
use fusion_core::body::{Bone, SkinnedBody, obj_text};
use fusion_core::depth::DepthSequence;
use fusion_core::energy::BoneMode;
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::skeleton::Skeleton;
use fusion_core::tracker::{FrameReport, Tracker, TrackerOptions};
use fusion_core::twist::Twist;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::folder::{FRAMES, MODEL, NODES, SKELETON, mesh_file, prepare};
use super::posed::read_any_body;
use super::{print, progress_bar};

/// Options of `fusion track`.
#[derive(Debug, Args)]
pub struct Track {
    /// Folder of depth images with `intrinsics.json`, and `depth.txt` or `depth/*.png`. The first image shows the model
    /// at rest.
    recording: PathBuf,
    /// Model in the camera's coordinates: `.json`, `.glb`, `.obj` without bones, or a folder [default: the recording's
    /// `model.json`].
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
    /// Print the times of frames.
    #[arg(long)]
    stats: bool,
    /// Replace an earlier track.
    #[arg(long)]
    overwrite: bool,
}

/// Options in a file.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
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
    /// Empty if the image was used.
    reason: String,
    visible: f64,
    inliers: f64,
    residual_mm: f64,
    /// Time of the frame without reading and writing files.
    time_ms: f64,
}

impl Line {
    /// Whether the image was used.
    fn is_tracked(&self) -> bool {
        self.reason.is_empty()
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
            stats: false,
            overwrite: true,
        }
    }

    /// # Errors
    /// If an input cannot be used, or no image could be tracked. In the latter case the table of frames has the
    /// reasons.
    pub fn run(&self) -> Result<()> {
        let sequence = DepthSequence::open(&self.recording)?;
        let model = self.model.clone().unwrap_or_else(|| self.recording.join(MODEL));
        let body = read_any_body(&model).context("the model")?;
        let parameters = self.parameters(&body)?;
        let model = DeformationModel::new(&body, parameters.model)?;
        if !model.fill.left.is_empty() {
            eprintln!("warning: {} nodes follow no bone: no attached node can be reached", model.fill.left.len());
        }
        let skeleton = self.skeleton(sequence.len(), &model.bones)?;
        let mut tracker = Tracker::new(model, sequence.info.camera, parameters.tracker)?;
        prepare(&self.output, &["meshes"], &[FRAMES, NODES], self.overwrite)?;
        let mut lines: Vec<Line> = Vec::new();
        let mut motions = Vec::new();
        let progress = progress_bar(sequence.len(), "tracking");
        for frame in 0..sequence.len() {
            let line = track_frame(frame, &sequence, skeleton.as_ref(), &mut tracker);
            if let Some(warning) = change(lines.last(), &line) {
                progress.suspend(|| eprintln!("warning: {warning}"));
            }
            lines.push(line);
            let mesh = obj_text(&tracker.vertices(), &tracker.model().mesh.triangles);
            write_file(&mesh_file(&self.output, "meshes", frame), mesh.as_bytes())?;
            motions.push(tracker.twists().to_vec());
            progress.inc(1);
        }
        progress.finish_and_clear();
        self.write(&lines, &motions, &tracker, parameters.tracker)?;
        let skipped = lines.iter().filter(|line| !line.is_tracked()).count();
        let tracked = lines.len() - skipped;
        if let (0, Some(first)) = (tracked, lines.first()) {
            let table = self.output.join(FRAMES);
            bail!("none of {skipped} frames could be tracked; see {}; the first: {}", table.display(), first.reason);
        }
        print(&format!(
            "tracked {tracked} frames with {} nodes, skipped {skipped}; wrote {}\n",
            tracker.model().nodes.len(),
            self.output.display()
        ))?;
        if self.stats { print(&times(&lines)) } else { Ok(()) }
    }

    /// Reads the skeleton, and checks that it fits before anything is tracked.
    fn skeleton(&self, images: usize, bones: &[Bone]) -> Result<Option<Skeleton>> {
        let default = self.recording.join(SKELETON);
        let path = match &self.skeleton {
            _ if self.no_bones || bones.is_empty() => return Ok(None),
            Some(path) => path.clone(),
            None if default.exists() => default,
            None if self.unknown_bones => {
                bail!(
                    "--unknown-bones needs reported bones, but {} does not exist; add it, or name one by --skeleton",
                    default.display()
                );
            }
            None => {
                eprintln!("warning: {} does not exist; tracking without bones", default.display());
                return Ok(None);
            }
        };
        let skeleton = Skeleton::read(&path)?;
        let frames = skeleton.frames.len();
        ensure!(
            frames >= images,
            "{}: expected bones for each of {images} images, got {frames} frames; \
             complete the skeleton, shorten depth.txt, or track with --no-bones",
            path.display()
        );
        skeleton.motions(0, bones).with_context(|| path.display().to_string())?;
        Ok(Some(skeleton))
    }

    /// Reads the options. Those that the file lacks have the defaults for known, unknown or no bones.
    fn parameters(&self, body: &SkinnedBody) -> Result<Parameters> {
        let mut defaults = Parameters::default();
        defaults.tracker = match (self.unknown_bones, self.no_bones || body.bones.is_empty()) {
            (true, _) => TrackerOptions::with_unknown_bones(),
            (false, true) => TrackerOptions::without_bones(),
            (false, false) => defaults.tracker,
        };
        let Some(path) = &self.options else { return Ok(defaults) };
        let here = || path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(here)?;
        // Reports an unknown key or a wrong type with its position.
        serde_json::from_str::<Parameters>(&text).with_context(here)?;
        let mut all = serde_json::to_value(defaults)?;
        replace(&mut all, serde_json::from_str(&text).with_context(here)?);
        let mut parameters: Parameters = serde_json::from_value(all).with_context(here)?;
        if self.unknown_bones {
            parameters.tracker.energy.bones = BoneMode::Unknown;
        }
        Ok(parameters)
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

/// Replaces the values that another object has, at any depth.
fn replace(value: &mut Value, by: Value) {
    match (value, by) {
        (Value::Object(own), Value::Object(other)) => {
            for (key, by) in other {
                replace(own.entry(key).or_insert(Value::Null), by);
            }
        }
        (value, by) => *value = by,
    }
}

/// Tracks one frame. If its image cannot be used, the body moves by its bones or its last motion, and the row has the
/// reason.
fn track_frame(frame: usize, sequence: &DepthSequence, skeleton: Option<&Skeleton>, tracker: &mut Tracker) -> Line {
    let skipped =
        |error: &anyhow::Error| Line { frame, status: "skipped", reason: format!("{error:#}"), ..Line::default() };
    let bones = skeleton.map_or(Ok(None), |skeleton| skeleton.motions(frame, &tracker.model().bones));
    let (bones, fault) = match bones {
        Ok(bones) => (bones, None),
        Err(error) => (None, Some(anyhow::Error::new(error))),
    };
    let image = match fault {
        None => sequence.image(frame).map_err(anyhow::Error::new),
        Some(fault) => Err(fault),
    };
    match image {
        Ok(image) => {
            let start = Instant::now();
            let result = tracker.track(&image, bones.as_deref());
            let time_ms = 1e3 * start.elapsed().as_secs_f64();
            match result {
                Ok(report) => Line { time_ms, ..line(frame, &report) },
                Err(error) => Line { time_ms, ..skipped(&error.into()) },
            }
        }
        Err(error) => {
            let moved = tracker.predict(bones.as_deref());
            skipped(&moved.err().map_or(error, anyhow::Error::new))
        }
    }
}

/// Summarises the times of the tracked frames.
fn times(lines: &[Line]) -> String {
    let mut times: Vec<f64> = lines.iter().filter(|line| line.is_tracked()).map(|line| line.time_ms).collect();
    times.sort_by(f64::total_cmp);
    let quantile = |q: f64| times.get((q * times.len().saturating_sub(1) as f64).round() as usize).unwrap_or(&0.0);
    let mean = times.iter().sum::<f64>() / times.len().max(1) as f64;
    format!(
        "time per frame: mean {mean:.1} ms ({:.0} Hz), median {:.1} ms, 95 % {:.1} ms, longest {:.1} ms\n",
        1e3 / mean,
        quantile(0.5),
        quantile(0.95),
        quantile(1.0)
    )
}

/// Describes the loss or the recovery of the track from one frame to the next; `None` without either.
fn change(before: Option<&Line>, now: &Line) -> Option<String> {
    match (before.is_none_or(Line::is_tracked), now.is_tracked()) {
        (true, false) => Some(format!(
            "track lost in frame {}: {}; following the bones, or the last motion without bones",
            now.frame, now.reason
        )),
        (false, true) => Some(format!(
            "track recovered in frame {}: {:.0} % of the visible vertices match, {:.1} mm from the surface",
            now.frame,
            100.0 * now.inliers,
            now.residual_mm
        )),
        _ => None,
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
        visible: report.quality.visible,
        inliers: report.quality.inliers,
        residual_mm: 1e3 * report.quality.residual,
        time_ms: 0.0,
    }
}
