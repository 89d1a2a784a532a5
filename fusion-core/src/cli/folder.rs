use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// A recording's files.
pub const MODEL: &str = "model.json";
/// What a body tracker says.
pub const SKELETON: &str = "skeleton.json";
/// A track's table of frames.
pub const FRAMES: &str = "frames.csv";
/// A track's node motions.
pub const NODES: &str = "nodes.json";

/// The mesh of a frame in `truth` or `meshes`.
pub fn mesh_file(folder: &Path, kind: &str, frame: usize) -> PathBuf {
    folder.join(kind).join(format!("{frame:06}.obj"))
}

/// Makes an output folder with its parts, before anything is computed. Files of an earlier run are removed if they may be, so that no
/// folder mixes two runs.
pub fn prepare(folder: &Path, parts: &[&str], files: &[&str], overwrite: bool) -> Result<()> {
    let here = || format!("cannot prepare {}", folder.display());
    std::fs::create_dir_all(folder).with_context(here)?;
    let mut old: Vec<PathBuf> = files.iter().map(|file| folder.join(file)).filter(|path| path.exists()).collect();
    for part in parts {
        let path = folder.join(part);
        std::fs::create_dir_all(&path).with_context(here)?;
        for entry in std::fs::read_dir(&path).with_context(here)? {
            let path = entry.with_context(here)?.path();
            if path.extension().is_some_and(|extension| extension == "obj" || extension == "png") {
                old.push(path);
            }
        }
    }
    if let (false, Some(path)) = (overwrite, old.first()) {
        bail!("{} exists; choose another folder, or allow --overwrite", path.display());
    }
    old.iter().try_for_each(std::fs::remove_file).with_context(here)
}
