use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Result, ensure};
use clap::Args;
use energy_cli::write_file;
use fusion_core::body::{obj_text, write_body};
use fusion_core::depth::{Camera, DepthSequence, SensorNoise, SequenceInfo, write_depth};
use fusion_core::protocol::{Recording, reported_bones};
use fusion_core::skeleton::{BoneNoise, Skeleton};

use super::folder::{MODEL, SKELETON, mesh_file, prepare};
use super::posed::Source;
use super::{print, progress_bar};

/// Steps per metre of the depth images.
const PER_METRE: f64 = 1000.0;

/// Options of `fusion render`.
#[derive(Debug, Args)]
pub struct Render {
    #[command(flatten)]
    source: Source,
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
    /// Begin with the first frame of the motion, a T pose, at the place of the frame --from. It becomes the model's
    /// rest.
    #[arg(long)]
    t_pose: bool,
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
            source: Source::figure(frames),
            distance: 2.6,
            noise: SensorNoise::default().factor,
            bone_turn: noise.turn.to_degrees(),
            bone_shift: 1e3 * noise.shift,
            t_pose: false,
            output: output.to_owned(),
            overwrite: true,
        }
    }

    /// Renders all frames.
    pub fn run(&self) -> Result<()> {
        self.run_until(&AtomicBool::new(false))
    }

    /// Renders all frames, or until `stop` is set.
    pub fn run_until(&self, stop: &AtomicBool) -> Result<()> {
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
        let (body, motions) = if self.t_pose { self.source.posed_after_t_pose() } else { self.source.posed() }?;
        ensure!(motions.len() > 1, "expected at least two frames between --from and --to");
        let recording = Recording::new(&body, &motions, Camera::VGA, self.distance);
        let files = [MODEL, SKELETON, DepthSequence::INTRINSICS, DepthSequence::LIST];
        let _lock = prepare(&self.output, &["depth", "truth"], &files, self.overwrite)?;
        self.write(&recording, stop)?;
        print(&format!(
            "wrote {} frames of {} vertices and {} bones to {}\n",
            recording.motions.len(),
            recording.body.mesh.vertices.len(),
            recording.body.bones.len(),
            self.output.display()
        ))
    }

    fn write(&self, recording: &Recording, stop: &AtomicBool) -> Result<()> {
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
            ensure!(!stop.load(Ordering::Relaxed), "stopped after frame {frame}");
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
