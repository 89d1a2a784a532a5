//! Checksums of the files that a run reads, which tell whether they were edited since it began.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::scene::Scene;

/// A file that a run read at its start.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// Absolute path of the file.
    pub path: PathBuf,
    /// Size in bytes.
    pub size: u64,
    /// CRC-32 of the contents.
    pub checksum: u32,
}

impl InputFile {
    /// Reads a file. `None` if it is not a regular file, such as a pipe, which cannot be read twice.
    fn of(path: &Path) -> Option<Self> {
        let path = std::path::absolute(path).ok()?;
        let contents = path.is_file().then(|| std::fs::read(&path).ok())??;
        Some(Self { size: contents.len() as u64, checksum: crc32fast::hash(&contents), path })
    }

    /// Returns the meshes and materials of a scene.
    pub(super) fn of_scene(scene: &Scene) -> Vec<Self> {
        scene.input_files().iter().filter_map(|path| Self::of(path)).collect()
    }

    /// Returns the scene file itself; `None` if there is none.
    pub(super) fn scene_itself(path: &Path) -> Option<Self> {
        Self::of(path)
    }

    /// Whether the file has other contents now. A file that cannot be read has not been edited.
    pub(super) fn is_edited(&self) -> bool {
        Self::of(&self.path).is_some_and(|now| now != *self)
    }
}
