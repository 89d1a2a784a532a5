//! The files that a scene reads.

use std::path::PathBuf;

use super::{Mesh, RestShape, Scene};
use cloth_physics::fabric::Material;

impl Scene {
    /// Returns the paths of the meshes and materials of the scene, in order and without duplicates.
    #[must_use]
    pub fn input_files(&self) -> Vec<PathBuf> {
        let meshes = self.garments.iter().filter_map(|garment| match &garment.mesh {
            Mesh::Obj { path, .. } => Some(self.folder.join(path)),
            _ => None,
        });
        let rests = self.garments.iter().filter_map(|garment| match &garment.rest {
            Some(RestShape::Obj(rest)) => Some(self.folder.join(&rest.path)),
            _ => None,
        });
        let materials = self.garments.iter().filter_map(|garment| match &garment.fabric.material {
            Material::File(declared) => Some(declared.path.clone()),
            _ => None,
        });
        let obstacles = self.obstacles.iter().flat_map(|one| one.mesh_paths(&self.folder));
        let mut paths: Vec<PathBuf> = meshes.chain(rests).chain(materials).chain(obstacles).collect();
        paths.sort();
        paths.dedup();
        paths
    }
}
