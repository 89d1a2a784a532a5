use std::path::Path;

use anyhow::Result;
use energy_cli::write_file;
use fusion_core::body::obj_text;
use fusion_core::depth::DepthImage;
use fusion_core::model::DeformationModel;
use fusion_core::surface::{SurfaceOptions, SurfaceVolume};
use fusion_core::tracker::{Tracker, TrackerOptions};
use fusion_core::twist::Twist;

use super::folder::{REST, SURFACE, mesh_file};

/// Fuses the images of a track into a surface, and writes it at rest and in each frame.
pub struct SurfaceOutput {
    volume: SurfaceVolume,
    options: TrackerOptions,
}

impl SurfaceOutput {
    pub fn new(model: &DeformationModel, surface: SurfaceOptions, options: TrackerOptions) -> Result<Self> {
        Ok(Self { volume: SurfaceVolume::new(model, surface)?, options })
    }

    /// Adds the image of a tracked frame, in which the nodes had these twists.
    pub fn add(&mut self, tracker: &Tracker, twists: &[Twist], image: &DepthImage) {
        let reach = self.options.gates.normal_reach;
        self.volume.integrate(tracker.model(), &tracker.vertex_motions_at(twists), image, tracker.rays(), reach);
    }

    /// Writes the surface, in the camera's coordinates. Returns the number of its vertices.
    pub fn write(&self, output: &Path, model: &DeformationModel, frames: &[Vec<Twist>]) -> Result<usize> {
        let mesh = self.volume.mesh();
        let rest: Vec<_> = mesh.vertices.iter().map(|vertex| vertex + model.origin).collect();
        write_file(&output.join(SURFACE).join(REST), obj_text(&rest, &mesh.triangles).as_bytes())?;
        for (frame, twists) in frames.iter().enumerate() {
            let motions = model.vertex_motions(twists, self.options.energy.angle);
            let posed = self.volume.posed(model, &motions, &mesh.vertices);
            write_file(&mesh_file(output, SURFACE, frame), obj_text(&posed, &mesh.triangles).as_bytes())?;
        }
        Ok(rest.len())
    }
}
