use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Args;
use energy_cli::write_file;
use fusion_core::body::{Bone, SkinnedBody, obj_text};
use fusion_core::depth::{DepthImage, DepthSequence, GivenCamera, SequenceError};
use fusion_core::energy::BoneMode;
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::skeleton::{JointTrack, Skeleton, half_interval};
use fusion_core::surface::SurfaceOptions;
use fusion_core::tracker::{FrameReport, Tracker, TrackerOptions};
use fusion_core::twist::Twist;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::first_image::compared;
use super::folder::{FILM, FRAMES, GLTF, MODEL, NODES, SKELETON, SURFACE, USD, mesh_file, prepare};
use super::posed::read_any_body;
use super::surface_output::SurfaceOutput;
use super::track_output::TrackOutput;
use super::{print, progress_bar};

/// Options of `fusion track`.
#[derive(Debug, Args)]
pub struct Track {
    /// Folder of depth images with `intrinsics.json`, and `depth.txt` or `depth/*.png`. The first image shows the model
    /// at rest.
    recording: PathBuf,
    /// Camera of a folder without `intrinsics.json`: fx,fy,cx,cy in pixels, or freiburg1, freiburg2 or freiburg3 for
    /// the calibrated cameras of the TUM's RGB-D sequences.
    #[arg(long)]
    camera: Option<GivenCamera>,
    /// Steps per metre of the images, with --camera [default: 5000, as in the TUM's sequences].
    #[arg(long, requires = "camera")]
    depth_scale: Option<f64>,
    /// Model in the camera's coordinates: `.json`, `.glb`, `.obj` without bones, or a folder [default: the recording's
    /// `model.json`].
    #[arg(long)]
    model: Option<PathBuf>,
    /// Bones of a body tracker [default: the recording's `skeleton.json`, if it exists].
    #[arg(long)]
    skeleton: Option<PathBuf>,
    /// Joints of a body tracker, in place of bones (`.json`): names, positions, and a mapping to bones.
    #[arg(long, conflicts_with = "skeleton")]
    joints: Option<PathBuf>,
    /// Track without bones: nodes start where they were.
    #[arg(long, conflicts_with_all = ["skeleton", "joints", "unknown_bones"])]
    no_bones: bool,
    /// Treat bones as unknowns near the reported motions.
    #[arg(long)]
    unknown_bones: bool,
    /// Options of model, tracker and surface (`.json`): `{"model": {…}, "tracker": {…}, "surface": {…}}`.
    #[arg(long)]
    options: Option<PathBuf>,
    /// Output folder.
    #[arg(short, long)]
    output: PathBuf,
    /// Write a picture of depth, model and error for each frame, and a film of them (`track.apng`).
    #[arg(long)]
    pictures: bool,
    /// Write the moved mesh as Universal Scene Description (`track.usda`), with a time sample per frame.
    #[arg(long)]
    usd: bool,
    /// Write the moved mesh as binary glTF (`track.glb`), with a morph target per frame. The frames stay in memory
    /// until the end: 72 bytes per vertex and frame.
    #[arg(long)]
    gltf: bool,
    /// Fuse the images into a surface (`surface/rest.obj`, and `surface/*.obj` for each frame). Nodes are stiffer then,
    /// so that details stay in the surface.
    #[arg(long)]
    surface: bool,
    /// Keep the model's size, even if another size agrees better with the first image.
    #[arg(long)]
    keep_size: bool,
    /// Print the times of frames.
    #[arg(long)]
    stats: bool,
    /// Replace an earlier track.
    #[arg(long)]
    overwrite: bool,
}

/// The largest file of options, in bytes.
const LARGEST_OPTIONS: u64 = 1 << 20;

/// Options in a file.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Parameters {
    model: ModelOptions,
    tracker: TrackerOptions,
    surface: SurfaceOptions,
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
            camera: None,
            depth_scale: None,
            model: None,
            skeleton: None,
            joints: None,
            no_bones: false,
            unknown_bones,
            options: None,
            output: output.to_owned(),
            pictures: false,
            usd: false,
            gltf: false,
            surface: false,
            keep_size: false,
            stats: false,
            overwrite: true,
        }
    }

    /// # Errors
    /// If an input cannot be used, or no image could be tracked. In the latter case the table of frames has the
    /// reasons.
    pub fn run(&self) -> Result<()> {
        let sequence = DepthSequence::open_with(&self.recording, self.given_camera())?;
        let model = self.model.clone().unwrap_or_else(|| self.recording.join(MODEL));
        let body = read_any_body(&model).context("the model")?;
        let camera = sequence.info.camera;
        // The first image shows the model at rest.
        let body = match sequence.image(0) {
            Ok(image) => compared(body, &camera, &image, self.keep_size),
            Err(_) => body,
        };
        let parameters = self.parameters(&body)?;
        parameters.surface.validate()?;
        let model = DeformationModel::new(&body, parameters.model)?;
        if !model.fill.left.is_empty() {
            eprintln!("warning: {} nodes follow no bone: no attached node can be reached", model.fill.left.len());
        }
        let skeleton = self.skeleton(&sequence, &body.bones)?;
        let mut tracker = Tracker::new(model, camera, parameters.tracker)
            .with_context(|| self.recording.join(DepthSequence::INTRINSICS).display().to_string())?;
        let mut surface = self
            .surface
            .then(|| SurfaceOutput::new(tracker.model(), parameters.surface, parameters.tracker))
            .transpose()?;
        let mut output = self.track_output(&sequence, &body)?;
        let mut lines: Vec<Line> = Vec::new();
        let mut motions = Vec::new();
        let progress = progress_bar(sequence.len(), "tracking");
        for frame in 0..sequence.len() {
            let image = sequence.image(frame);
            let kept = image.as_ref().ok().filter(|_| self.pictures || self.surface).cloned();
            let line = track_frame(frame, image, skeleton.as_ref(), &mut tracker);
            if let Some(warning) = change(lines.last(), &line) {
                progress.suspend(|| eprintln!("warning: {warning}"));
            }
            if let (Some(surface), Some(image)) = (&mut surface, kept.as_ref().filter(|_| line.is_tracked())) {
                surface.add(&tracker, image);
            }
            lines.push(line);
            let vertices = tracker.vertices();
            output.add(frame, kept.as_ref().filter(|_| self.pictures), &vertices)?;
            let mesh = obj_text(&vertices, &body.mesh.triangles);
            write_file(&mesh_file(&self.output, "meshes", frame), mesh.as_bytes())?;
            motions.push(tracker.twists().to_vec());
            progress.inc(1);
        }
        progress.finish_and_clear();
        self.write(&lines, &motions, &tracker, parameters.tracker)?;
        let fused = surface.map(|surface| surface.write(&self.output, tracker.model(), &motions)).transpose()?;
        // Last, because the size of a glTF file has a limit.
        output.finish()?;
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
        if let Some(vertices) = fused {
            print(&format!("fused a surface of {vertices} vertices: {}\n", self.output.join(SURFACE).display()))?;
        }
        if self.stats { print(&times(&lines)) } else { Ok(()) }
    }

    /// Prepares the output folder.
    fn track_output(&self, sequence: &DepthSequence, body: &SkinnedBody) -> Result<TrackOutput> {
        let optional = [(self.pictures, "pictures"), (self.surface, SURFACE)];
        let wanted = optional.iter().filter(|(wanted, _)| *wanted).map(|(_, folder)| *folder);
        let folders: Vec<&str> = std::iter::once("meshes").chain(wanted).collect();
        prepare(&self.output, &folders, &[FRAMES, NODES, FILM, USD, GLTF], self.overwrite)?;
        let mut output = TrackOutput::new(&self.output, sequence.info.camera, &body.mesh.triangles, sequence.times());
        if self.pictures {
            output = output.with_pictures();
        }
        if self.gltf {
            output = output.with_gltf();
        }
        if self.usd {
            output = output.with_usd(sequence.len())?;
        }
        Ok(output)
    }

    fn given_camera(&self) -> Option<GivenCamera> {
        let mut camera = self.camera?;
        camera.depth_scale = self.depth_scale.unwrap_or(camera.depth_scale);
        Some(camera)
    }

    /// Reads the bones of every image, and checks that they fit before anything is tracked.
    fn skeleton(&self, sequence: &DepthSequence, bones: &[Bone]) -> Result<Option<Skeleton>> {
        let (images, times) = (sequence.len(), sequence.times());
        let Some((path, skeleton)) = self.reported(times, bones)? else { return Ok(None) };
        let skeleton = skeleton.for_images(&path, images, times)?;
        let first = skeleton.frames.iter().position(|frame| !frame.is_empty()).unwrap_or(0);
        skeleton.motions(first, bones).with_context(|| path.display().to_string())?;
        let without: Vec<usize> = (0..images).filter(|&frame| skeleton.frames[frame].is_empty()).collect();
        if !without.is_empty() {
            let reach = times.map_or(0.0, half_interval);
            eprintln!(
                "warning: {} has no bones for frames {} (timestamps match within {:.1} ms); these are tracked without \
                 bones",
                path.display(),
                ranges(&without),
                1e3 * reach
            );
        }
        Ok(Some(skeleton))
    }

    /// Reads the file of bones or joints; `None` if the body is tracked without bones.
    fn reported(&self, times: Option<&[f64]>, bones: &[Bone]) -> Result<Option<(PathBuf, Skeleton)>> {
        let default = self.recording.join(SKELETON);
        let path = match (&self.skeleton, &self.joints) {
            _ if self.no_bones || bones.is_empty() => return Ok(None),
            (None, Some(path)) => {
                let skeleton = JointTrack::read(path)?.skeleton(path, bones, times)?;
                return Ok(Some((path.clone(), skeleton)));
            }
            (Some(path), _) => path.clone(),
            (None, None) if default.exists() => default,
            (None, None) if self.unknown_bones => {
                bail!(
                    "--unknown-bones needs reported bones, but {} does not exist; add it, or name one by --skeleton",
                    default.display()
                );
            }
            (None, None) => {
                eprintln!("warning: {} does not exist; tracking without bones", default.display());
                return Ok(None);
            }
        };
        let skeleton = Skeleton::read(&path)?;
        Ok(Some((path, skeleton)))
    }

    /// Reads the options. Those that the file lacks have the defaults for known, unknown or no bones.
    fn parameters(&self, body: &SkinnedBody) -> Result<Parameters> {
        let mut defaults = Parameters::default();
        defaults.tracker = match (self.unknown_bones, self.no_bones || body.bones.is_empty()) {
            (true, _) => TrackerOptions::with_unknown_bones(),
            (false, true) => TrackerOptions::without_bones(),
            (false, false) => defaults.tracker,
        };
        if self.surface {
            defaults.tracker = defaults.tracker.stiffened();
        }
        let Some(path) = &self.options else { return Ok(defaults) };
        let here = || path.display().to_string();
        let text = energy_files::read_text(path, LARGEST_OPTIONS).with_context(here)?;
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
            frames: &motions.iter().map(|frame| frame.iter().map(rounded).collect()).collect::<Vec<_>>(),
        };
        write_file(&self.output.join(NODES), &serde_json::to_vec(&nodes)?)
    }
}

/// Formats increasing numbers as a list of ranges: `3, 5-9`.
fn ranges(numbers: &[usize]) -> String {
    let runs: Vec<String> = numbers
        .chunk_by(|a, b| a + 1 == *b)
        .map(|run| match run {
            [first, .., last] => format!("{first}-{last}"),
            [one] => one.to_string(),
            [] => String::new(),
        })
        .collect();
    runs.join(", ")
}

/// Rounds a twist to nanometres and nanoradians, which halves the size of the file.
fn rounded(twist: &Twist) -> Twist {
    twist.map(|x| (1e9 * x).round() / 1e9)
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
fn track_frame(
    frame: usize,
    image: Result<DepthImage, SequenceError>,
    skeleton: Option<&Skeleton>,
    tracker: &mut Tracker,
) -> Line {
    let skipped =
        |error: &anyhow::Error| Line { frame, status: "skipped", reason: format!("{error:#}"), ..Line::default() };
    let bones = skeleton.map_or(Ok(None), |skeleton| skeleton.motions(frame, &tracker.model().bones));
    let (bones, fault) = match bones {
        Ok(bones) => (bones, None),
        Err(error) => (None, Some(anyhow::Error::new(error))),
    };
    let image = match fault {
        None => image.map_err(anyhow::Error::new),
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
