//! The fabric that is tested.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::TesterError;
use super::scene::SceneText;
use crate::scene::Scene;

/// The largest file of a fabric, in bytes.
const LARGEST_FILE: u64 = 1 << 20;

/// A fabric of the library, or of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct TestedFabric {
    /// The name in the library, or that of the file.
    name: String,
    /// The value of the key `fabric` of a garment.
    value: Value,
    /// Path of the file; the name of a fabric of the library.
    path: PathBuf,
}

impl TestedFabric {
    /// Finds a fabric by its name in the library, or reads the table `[fabric]` of a TOML file.
    ///
    /// ```
    /// use cloth_core::tester::TestedFabric;
    /// let error = TestedFabric::find("velvt").unwrap_err().to_string();
    /// assert!(error.contains("unknown fabric `velvt`"), "{error}");
    /// ```
    ///
    /// # Errors
    /// Returns an error if the library has no such fabric, or the file cannot be read or describes none.
    pub fn find(name_or_file: &str) -> Result<Self, TesterError> {
        let path = Path::new(name_or_file);
        let is_file = path.extension().is_some_and(|extension| extension == "toml") || path.is_file();
        let found = if is_file {
            Self::read(path)?
        } else {
            Self { name: name_or_file.to_owned(), value: Value::String(name_or_file.to_owned()), path: path.to_owned() }
        };
        found.sample()?;
        Ok(found)
    }

    /// Returns a small scene with this fabric.
    fn sample(&self) -> Result<Scene, TesterError> {
        let mesh = "mesh.sheet = { cells = [1, 1], size = [1.0, 1.0] }\n".to_owned();
        let (head, tail) = ("dt = 0.1\nduration = 0.1\n".to_owned(), String::new());
        self.scene(&SceneText { head, mesh, tail })
    }

    /// Checks that the fabric reads files only from its folder and the `allowed` ones; see [`Scene::check_paths`].
    ///
    /// # Errors
    /// Returns an error for the first file that is elsewhere.
    pub fn check_paths(&self, allowed: &[PathBuf]) -> Result<(), TesterError> {
        Ok(self.sample()?.check_paths(allowed)?)
    }

    fn read(path: &Path) -> Result<Self, TesterError> {
        let text = energy_files::read_text(path, LARGEST_FILE);
        let text = text.map_err(|source| TesterError::Unreadable { path: path.to_owned(), source })?;
        let malformed = |source: toml::de::Error| {
            let message = energy_files::excerpt(source.message()).into_owned();
            TesterError::Malformed { path: path.to_owned(), message }
        };
        let mut file: Table = text.parse().map_err(malformed)?;
        let mut value = file.remove("fabric").ok_or_else(|| TesterError::NoFabric { path: path.to_owned() })?;
        resolve(&mut value, path.parent().unwrap_or(Path::new("")));
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        Ok(Self { name, value, path: path.to_owned() })
    }

    /// The name in the library, or that of the file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns a scene with this fabric as TOML.
    pub(super) fn text(&self, scene: &SceneText) -> Result<String, TesterError> {
        let path = self.path.clone();
        let malformed = |source: toml::de::Error| TesterError::Malformed { path, message: source.to_string() };
        let mut table: Table = scene.toml().parse().map_err(malformed)?;
        let garments = table.get_mut("garment").and_then(Value::as_array_mut);
        let garment = garments.and_then(|garments| garments.first_mut()?.as_table_mut());
        garment.into_iter().for_each(|garment| {
            garment.insert("fabric".to_owned(), self.value.clone());
        });
        Ok(toml::to_string(&table)?)
    }

    /// Returns a scene with this fabric.
    pub(super) fn scene(&self, scene: &SceneText) -> Result<Scene, TesterError> {
        Ok(Scene::parse(&self.text(scene)?, &self.path)?)
    }
}

/// Makes the path of a fabric's own elements absolute: scenes of the test lie in another folder.
fn resolve(fabric: &mut Value, folder: &Path) {
    let path = fabric.get_mut("material").and_then(|material| material.get_mut("file")?.get_mut("path"));
    if let Some(Value::String(path)) = path {
        let whole = std::path::absolute(folder.join(&*path)).unwrap_or_else(|_| folder.join(&*path));
        *path = whole.to_string_lossy().into_owned();
    }
}
