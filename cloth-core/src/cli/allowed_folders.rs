use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use cloth_core::scene::Scene;

/// Folders that a scene may read. A scene may come from a stranger, and messages quote lines of malformed files.
#[derive(Debug, Args)]
pub struct AllowedFolders {
    /// Folder, besides its own, whose files the scene may read; may be repeated.
    #[arg(long = "allow-path", value_name = "FOLDER")]
    folders: Vec<PathBuf>,
}

impl AllowedFolders {
    /// The folders, and files that were named on the command line.
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// Allows a file that was named on the command line.
    pub fn allow(&mut self, file: PathBuf) {
        self.folders.push(file);
    }

    /// Checks the paths of a scene before its files are read.
    pub fn check(&self, text: &str, scene: &Path) -> Result<()> {
        let parsed = Scene::parse(text, scene)?;
        parsed.check_paths(&self.folders).with_context(|| scene.display().to_string())
    }
}
