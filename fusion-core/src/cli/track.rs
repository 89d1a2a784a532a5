use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use energy_cli::tell;
use energy_files::FolderLock;
use fusion_core::body::{Bone, SkinnedBody};
use fusion_core::depth::{DepthSequence, GivenCamera};
use fusion_core::energy::BoneMode;
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::skeleton::{JointTrack, Skeleton, half_interval};
use fusion_core::surface::SurfaceOptions;
use fusion_core::tracker::{Tracker, TrackerOptions};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::first_image::compared;
use super::folder::{
    CHECKPOINT, FILM, FRAMES, GLTF, JOURNAL, MESHES, MODEL, NODES, PICTURES, PREVIOUS_CHECKPOINT, SKELETON, SURFACE,
    USD, prepare,
};
use super::posed::read_any_body;
use super::track_output::TrackOutput;

/// Files of a track, besides those in its folders.
const FILES: [&str; 8] = [FRAMES, NODES, FILM, USD, GLTF, CHECKPOINT, PREVIOUS_CHECKPOINT, JOURNAL];

/// Options of `fusion track`.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
pub struct Track {
    /// Folder of depth images with `intrinsics.json`, and `depth.txt` or `depth/*.png`. The first image shows the model
    /// at rest.
    pub recording: PathBuf,
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
    pub output: PathBuf,
    /// Write a picture of depth, model and error for each frame, and a film of them (`track.apng`).
    #[arg(long)]
    pub pictures: bool,
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
    pub surface: bool,
    /// Keep the model's size, even if another size agrees better with the first image.
    #[arg(long)]
    keep_size: bool,
    /// Print the times of frames.
    #[arg(long)]
    pub stats: bool,
    /// Replace an earlier track.
    #[arg(long)]
    #[serde(skip)]
    overwrite: bool,
}

/// The largest file of options, in bytes.
const LARGEST_OPTIONS: u64 = 1 << 20;

/// Options in a file.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    model: ModelOptions,
    pub tracker: TrackerOptions,
    pub surface: SurfaceOptions,
}

/// Everything that a track needs before its first frame.
pub struct Inputs {
    pub sequence: DepthSequence,
    pub body: SkinnedBody,
    pub parameters: Parameters,
    /// Bones for each image; `None` without.
    pub skeleton: Option<Skeleton>,
    pub tracker: Tracker,
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

    /// Creates and locks the output folder, and removes the files of an earlier track if that is allowed.
    pub fn prepare(&self) -> Result<Option<FolderLock>> {
        prepare(&self.output, &self.subfolders(), &FILES, self.overwrite)
    }

    /// Reads and checks all inputs.
    pub fn inputs(&self) -> Result<Inputs> {
        let sequence = DepthSequence::open_with(&self.recording, self.given_camera())?;
        let body = read_any_body(&self.model_path()).context("the model")?;
        let camera = sequence.info.camera;
        // The first image shows the model at rest.
        let body = match sequence.image(0) {
            Ok(image) => compared(body, &camera, &image, self.keep_size),
            Err(_) => body,
        };
        let parameters = self.parameters(&body)?;
        let of_options = || self.options.as_ref().map_or("the options".into(), |path| path.display().to_string());
        parameters.surface.validate().with_context(of_options)?;
        parameters.tracker.validate().with_context(of_options)?;
        let model = DeformationModel::new(&body, parameters.model).with_context(of_options)?;
        if !model.fill.left.is_empty() {
            tell(&format!("warning: {} nodes follow no bone: no attached node can be reached", model.fill.left.len()));
        }
        let skeleton = self.skeleton(&sequence, &body.bones)?;
        let tracker = Tracker::new(model, camera, parameters.tracker)
            .with_context(|| self.recording.join(DepthSequence::INTRINSICS).display().to_string())?;
        Ok(Inputs { sequence, body, parameters, skeleton, tracker })
    }

    fn model_path(&self) -> PathBuf {
        self.model.clone().unwrap_or_else(|| self.recording.join(MODEL))
    }

    /// Returns the same options with absolute paths, so that the track can be resumed from elsewhere.
    pub fn absolute(&self) -> Result<Self> {
        let absolute = |path: &Path| std::path::absolute(path).with_context(|| path.display().to_string());
        let optional = |path: &Option<PathBuf>| path.as_deref().map(absolute).transpose();
        Ok(Self {
            recording: absolute(&self.recording)?,
            model: optional(&self.model)?,
            skeleton: optional(&self.skeleton)?,
            joints: optional(&self.joints)?,
            options: optional(&self.options)?,
            output: absolute(&self.output)?,
            ..self.clone()
        })
    }

    /// Returns the files that the track reads, without the images.
    pub fn input_files(&self) -> Vec<PathBuf> {
        let own = [DepthSequence::INTRINSICS, DepthSequence::LIST].map(|name| self.recording.join(name));
        let bones = match &self.joints {
            Some(joints) => joints.clone(),
            None => self.skeleton.clone().unwrap_or_else(|| self.recording.join(SKELETON)),
        };
        let model = self.model_path();
        // A model in several files.
        let parts = std::fs::read_dir(&model).into_iter().flatten().flatten().map(|entry| entry.path());
        let mut files: Vec<PathBuf> = own.into_iter().chain([bones]).chain(self.options.clone()).chain(parts).collect();
        files.push(model);
        files.sort();
        files
    }

    /// Returns the names of the folders in the output folder.
    fn subfolders(&self) -> Vec<&'static str> {
        let optional = [(self.pictures, PICTURES), (self.surface, SURFACE)];
        let wanted = optional.into_iter().filter(|(wanted, _)| *wanted).map(|(_, folder)| folder);
        std::iter::once(MESHES).chain(wanted).collect()
    }

    /// Begins the files that were asked for.
    pub fn track_output(&self, sequence: &DepthSequence, body: &SkinnedBody) -> Result<TrackOutput> {
        for folder in self.subfolders() {
            energy_files::subfolder(&self.output, folder).context("cannot prepare the output folder")?;
        }
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
            tell(&format!(
                "warning: {} has no bones for frames {} (timestamps match within {:.1} ms); these are tracked without \
                 bones",
                path.display(),
                ranges(&without),
                1e3 * reach
            ));
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
                tell(&format!("warning: {} does not exist; tracking without bones", default.display()));
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
