//! The files that a scene reads.

use std::path::{Path, PathBuf};

use super::{Mesh, RestShape, Scene, SceneError};
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

    /// Checks that the scene reads files only from its folder and the `allowed` ones, also through `..` and symbolic
    /// links. The scene of a stranger should pass it before the files are read: messages quote lines of malformed ones.
    ///
    /// # Errors
    /// Returns an error for the first file that is elsewhere.
    ///
    /// ```
    /// # let folder = tempfile::tempdir()?;
    /// let text = "dt = 0.01\nduration = 1.0\nmesh.obj.path = \"/etc/hosts\"\n[fabric]\ndensity = 0.2\n\
    ///             material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3 }";
    /// let scene = cloth_scene::Scene::parse(text, &folder.path().join("scene.toml"))?;
    /// assert!(scene.check_paths(&["/etc".into()]).is_ok());
    /// let error = scene.check_paths(&[]).unwrap_err().to_string();
    /// assert!(error.ends_with("is outside the scene's folder; move it there, or allow its folder by --allow-path /etc"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check_paths(&self, allowed: &[PathBuf]) -> Result<(), SceneError> {
        let own = if self.folder.as_os_str().is_empty() { Path::new(".") } else { &self.folder };
        let folders = std::iter::once(own).chain(allowed.iter().map(PathBuf::as_path));
        let folders: Vec<PathBuf> = folders.filter_map(|folder| folder.canonicalize().ok()).collect();
        let is_outside = |file: &PathBuf| {
            // A file that does not exist cannot be read, either.
            file.canonicalize().is_ok_and(|file| !folders.iter().any(|folder| file.starts_with(folder)))
        };
        match self.input_files().into_iter().find(is_outside) {
            Some(file) => Err(SceneError::Outside { file }),
            None => Ok(()),
        }
    }
}
