use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use energy_cli::write_file;
use fusion_core::body::{
    SkinnedBody, figure, figure_motion, obj_text, read_body, read_gltf, read_makehuman, read_obj, write_body,
};
use fusion_core::depth::{Camera, DepthSequence, SensorNoise, SequenceInfo, write_depth};
use fusion_core::protocol::{Recording, reported_bones};
use fusion_core::skeleton::{BoneNoise, Bvh, Retarget, Skeleton};
use nalgebra::Isometry3;

use super::folder::{MODEL, SKELETON, mesh_file, prepare};
use super::{print, progress_bar};

/// Steps per metre of the depth images.
const PER_METRE: f64 = 1000.0;

/// Options of `fusion render`.
#[derive(Debug, Args)]
pub struct Render {
    /// Body: `figure` (built-in, made of tubes, with its own motion), a folder with `base.obj`, `rig.*.json` and
    /// `weights.*.json`, a skinned mesh (`.glb`), or a stored model (`.json`).
    #[arg(long, default_value = "figure")]
    body: String,
    /// Motion of the body (`.bvh`), with a T pose in the first frame and joints named like the bones.
    #[arg(long)]
    motion: Option<PathBuf>,
    /// First frame of the motion; it becomes the model's rest.
    #[arg(long, default_value_t = 0)]
    from: usize,
    /// Last frame of the motion.
    #[arg(long)]
    to: Option<usize>,
    /// Step between frames.
    #[arg(long, default_value_t = 1)]
    step: usize,
    /// Distance of the camera in front of the body, in m.
    #[arg(long, default_value_t = 2.6)]
    distance: f64,
    /// Factor k of the sensor noise k (0.0012 + 0.0019 (z − 0.4)²) m.
    #[arg(long, default_value_t = 0.3)]
    noise: f64,
    /// Standard deviation of the rotations of bones, in degrees.
    #[arg(long, default_value_t = 0.0)]
    bone_turn: f64,
    /// Standard deviation of the translations of bones along each axis, in mm.
    #[arg(long, default_value_t = 0.0)]
    bone_shift: f64,
    /// Output folder.
    #[arg(short, long)]
    output: PathBuf,
    /// Replace an earlier recording.
    #[arg(long)]
    overwrite: bool,
}

impl Render {
    /// Options for the figure of tubes, with `frames` frames at 30 Hz.
    pub fn figure(frames: usize, noise: BoneNoise, output: &Path) -> Self {
        Self {
            body: "figure".into(),
            motion: None,
            from: 0,
            to: Some(frames),
            step: 1,
            distance: 2.6,
            noise: SensorNoise::default().factor,
            bone_turn: noise.turn.to_degrees(),
            bone_shift: 1e3 * noise.shift,
            output: output.to_owned(),
            overwrite: true,
        }
    }

    pub fn run(&self) -> Result<()> {
        ensure!(self.step > 0, "--step: expected at least 1, got {}", self.step);
        ensure!(
            self.distance > 0.0 && self.distance.is_finite(),
            "--distance: expected more than 0 m, got {} m",
            self.distance
        );
        for (name, value) in
            [("--noise", self.noise), ("--bone-turn", self.bone_turn), ("--bone-shift", self.bone_shift)]
        {
            ensure!(value >= 0.0 && value.is_finite(), "{name}: expected a finite number of at least 0, got {value}");
        }
        let (body, motions) = self.posed()?;
        ensure!(motions.len() > 1, "expected at least two frames between --from and --to");
        let recording = Recording::new(&body, &motions, Camera::VGA, self.distance);
        let files = [MODEL, SKELETON, DepthSequence::INTRINSICS, DepthSequence::LIST];
        prepare(&self.output, &["depth", "truth"], &files, self.overwrite)?;
        self.write(&recording)?;
        print(&format!(
            "wrote {} frames of {} vertices and {} bones to {}\n",
            recording.motions.len(),
            recording.body.mesh.vertices.len(),
            recording.body.bones.len(),
            self.output.display()
        ))
    }

    /// Returns the body and the motions of its bones from its own rest.
    fn posed(&self) -> Result<(SkinnedBody, Vec<Vec<Isometry3<f64>>>)> {
        if self.body == "figure" {
            ensure!(self.motion.is_none(), "the figure has its own motion; remove --motion");
            let last = self.to.unwrap_or(self.from + 120);
            let motions =
                (self.from..=last).step_by(self.step).map(|frame| figure_motion(frame as f64 / 30.0)).collect();
            return Ok((figure(), motions));
        }
        let body = read_any_body(Path::new(&self.body))?;
        let path = self.motion.as_deref().context("a body from files needs a motion: --motion FILE.bvh")?;
        let motion = Bvh::read(path)?;
        let retarget = Retarget::new(&body.bones, &motion)?;
        let missing: Vec<&str> = retarget.missing().collect();
        if !missing.is_empty() {
            eprintln!(
                "warning: {} has no joint for {}: they move with their parents",
                path.display(),
                missing.join(", ")
            );
        }
        let last = self.to.unwrap_or(motion.frames() - 1);
        ensure!(last < motion.frames(), "--to {last}: {} has {} frames", path.display(), motion.frames());
        let motions: Result<_, _> =
            (self.from..=last).step_by(self.step).map(|frame| retarget.motions(frame)).collect();
        let motions = motions?;
        Ok((body, motions))
    }

    fn write(&self, recording: &Recording) -> Result<()> {
        let folder = &self.output;
        let info = SequenceInfo { camera: recording.camera, depth_scale: PER_METRE };
        write_file(&folder.join(DepthSequence::INTRINSICS), &serde_json::to_vec_pretty(&info)?)?;
        write_body(&folder.join(MODEL), &recording.body)?;
        let sensor = SensorNoise { factor: self.noise, step: 1.0 / PER_METRE };
        let bones = BoneNoise { turn: self.bone_turn.to_radians(), shift: 1e-3 * self.bone_shift };
        let mut skeleton = Skeleton::of(&recording.body.bones);
        let mut list = String::from("# timestamp filename\n");
        let progress = progress_bar(recording.motions.len(), "rendering");
        for frame in 0..recording.motions.len() {
            let name = format!("depth/{frame:06}.png");
            write_depth(&folder.join(&name), &recording.image(frame, sensor), PER_METRE)?;
            writeln!(list, "{:.6} {name}", frame as f64 / 30.0)?;
            let truth = recording.truth(frame);
            write_file(&mesh_file(folder, "truth", frame), obj_text(&truth.vertices, &truth.triangles).as_bytes())?;
            // The first frame is the rest of the model.
            let noise = if frame == 0 { BoneNoise::default() } else { bones };
            skeleton.push(&reported_bones(recording, frame, noise));
            progress.inc(1);
        }
        progress.finish_and_clear();
        skeleton.write(&folder.join(SKELETON))?;
        write_file(&folder.join(DepthSequence::LIST), list.as_bytes())
    }
}

/// Reads a body in any of the formats.
pub fn read_any_body(path: &Path) -> Result<SkinnedBody> {
    if path.is_dir() {
        let file = |start: &str, end: &str| -> Result<PathBuf> {
            let entries = std::fs::read_dir(path).with_context(|| path.display().to_string())?;
            let name = |p: &PathBuf| p.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
            let mut found: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
            found.retain(|p| name(p).starts_with(start) && name(p).ends_with(end));
            match found.as_slice() {
                [one] => Ok(one.clone()),
                [] => bail!("{}: no file {start}…{end}", path.display()),
                _ => bail!("{}: several files {start}…{end}; keep one in the folder", path.display()),
            }
        };
        return Ok(read_makehuman(&file("base", ".obj")?, &file("rig", ".json")?, &file("weights", ".json")?)?);
    }
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("glb") => Ok(read_gltf(path)?),
        Some("json") => Ok(read_body(path)?),
        Some("obj") => Ok(read_obj(path)?),
        _ => bail!("{}: expected a folder, or a .glb, .json or .obj file", path.display()),
    }
}
