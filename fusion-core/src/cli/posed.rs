//! A body and its motion, as the options of commands name them.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use energy_cli::tell;
use fusion_core::body::{SkinnedBody, figure, figure_motion, read_body, read_gltf, read_makehuman, read_obj};
use fusion_core::protocol::at_place_of;
use fusion_core::skeleton::{Bvh, Retarget};
use nalgebra::Isometry3;

/// The largest number of motions of bones in all frames, each of 56 bytes: 60 bones for half an hour at 30 Hz.
const MOST_MOTIONS: usize = 4_000_000;

/// Options that choose a body and the frames of its motion.
#[derive(Debug, Args)]
pub struct Source {
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
}

impl Source {
    /// The figure of tubes, with `frames` frames at 30 Hz after the first.
    pub fn figure(frames: usize) -> Self {
        Self { body: "figure".into(), motion: None, from: 0, to: Some(frames), step: 1 }
    }

    /// Returns the body and the motions of its bones from its own rest.
    pub fn posed(&self) -> Result<(SkinnedBody, Vec<Vec<Isometry3<f64>>>)> {
        self.motions(&[])
    }

    /// Returns the same after a T pose: the motion's first frame, at the place of the frame `from`.
    pub fn posed_after_t_pose(&self) -> Result<(SkinnedBody, Vec<Vec<Isometry3<f64>>>)> {
        let (body, mut motions) = self.motions(&[0])?;
        if let [t_pose, first, ..] = motions.as_slice() {
            motions[0] = at_place_of(&body.bones, t_pose, first);
        }
        Ok((body, motions))
    }

    /// Returns the body and the motions of its bones in some frames, then in those of the options.
    fn motions(&self, before: &[usize]) -> Result<(SkinnedBody, Vec<Vec<Isometry3<f64>>>)> {
        ensure!(self.step > 0, "--step: expected at least 1, got {}", self.step);
        if self.body == "figure" {
            ensure!(self.motion.is_none(), "the figure has its own motion; remove --motion");
            let last = self.to.unwrap_or(self.from.saturating_add(120));
            self.check_count(before, last, figure().bones.len())?;
            let motions = self.frames(before, last).map(|frame| figure_motion(frame as f64 / 30.0)).collect();
            return Ok((figure(), motions));
        }
        let body = read_any_body(Path::new(&self.body))?;
        let path = self.motion.as_deref().context("a body from files needs a motion: --motion FILE.bvh")?;
        let motion = Bvh::read(path)?;
        let retarget = Retarget::new(&body.bones, &motion)?;
        let missing: Vec<&str> = retarget.missing().collect();
        if !missing.is_empty() {
            tell(&format!(
                "warning: {} has no joint for {}: they move with their parents",
                path.display(),
                missing.join(", ")
            ));
        }
        let last = self.to.unwrap_or(motion.frames() - 1);
        ensure!(last < motion.frames(), "--to {last}: {} has {} frames", path.display(), motion.frames());
        self.check_count(before, last, body.bones.len())?;
        let motions: Result<_, _> = self.frames(before, last).map(|frame| retarget.motions(frame)).collect();
        let motions = motions?;
        Ok((body, motions))
    }

    /// Checks that the motions of all frames fit into memory.
    fn check_count(&self, before: &[usize], last: usize, bones: usize) -> Result<()> {
        let most = MOST_MOTIONS / bones.max(1);
        let count = last.checked_sub(self.from).map_or(0, |span| span / self.step).saturating_add(1 + before.len());
        ensure!(
            count <= most,
            "{count} frames of {bones} bones: expected at most {most}; choose fewer by --from, --to and --step"
        );
        Ok(())
    }

    fn frames(&self, before: &[usize], last: usize) -> impl Iterator<Item = usize> {
        before.iter().copied().chain((self.from..=last).step_by(self.step))
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
