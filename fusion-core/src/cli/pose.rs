use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::Args;
use energy_cli::write_file;
use fusion_core::body::obj_text;
use nalgebra::Vector3;

use super::folder::{mesh_file, prepare};
use super::posed::Source;
use super::{print, progress_bar};

/// The folder of the meshes within the output folder.
const MESHES: &str = "body";

/// Options of `fusion pose`.
#[derive(Debug, Args)]
pub struct Pose {
    #[command(flatten)]
    source: Source,
    /// Keep the body's axes: y up. Default: z up, as in scenes of cloth.
    #[arg(long)]
    keep_axes: bool,
    /// Output folder.
    #[arg(short, long)]
    output: PathBuf,
    /// Replace earlier meshes.
    #[arg(long)]
    overwrite: bool,
}

impl Pose {
    pub fn run(&self) -> Result<()> {
        let (body, motions) = self.source.posed()?;
        ensure!(!motions.is_empty(), "expected at least one frame between --from and --to");
        let _lock = prepare(&self.output, &[MESHES], &[], self.overwrite)?;
        let progress = progress_bar(motions.len(), "posing");
        for (frame, motions) in motions.iter().enumerate() {
            let mut posed = body.posed(motions);
            if !self.keep_axes {
                posed.vertices.iter_mut().for_each(|v| *v = Vector3::new(v.x, -v.z, v.y));
            }
            let text = obj_text(&posed.vertices, &posed.triangles);
            write_file(&mesh_file(&self.output, MESHES, frame), text.as_bytes())?;
            progress.inc(1);
        }
        progress.finish_and_clear();
        let folder = self.output.join(MESHES);
        print(&format!(
            "wrote {} meshes of {} vertices to {}; a scene of cloth reads them as mesh.path = \"{}/*.obj\"\n",
            motions.len(),
            body.mesh.vertices.len(),
            folder.display(),
            folder.display()
        ))
    }
}
