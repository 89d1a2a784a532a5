use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// Model in a recording.
pub const MODEL: &str = "model.json";
/// Bones of a body tracker, in a recording.
pub const SKELETON: &str = "skeleton.json";
/// Table of frames in a track.
pub const FRAMES: &str = "frames.csv";
/// Node motions in a track.
pub const NODES: &str = "nodes.json";

/// Film of the pictures of a track.
pub const FILM: &str = "track.apng";
/// Track as Universal Scene Description.
pub const USD: &str = "track.usda";
/// Track as binary glTF.
pub const GLTF: &str = "track.glb";

/// Folder of the fused surface, in a track.
pub const SURFACE: &str = "surface";
/// The fused surface at rest, in its folder.
pub const REST: &str = "rest.obj";

/// Path of a frame's picture in a track.
pub fn picture_file(folder: &Path, frame: usize) -> PathBuf {
    folder.join("pictures").join(format!("{frame:06}.png"))
}

/// Path of a frame's mesh in `truth`, `meshes` or `surface`.
pub fn mesh_file(folder: &Path, kind: &str, frame: usize) -> PathBuf {
    folder.join(kind).join(format!("{frame:06}.obj"))
}

/// Creates an output folder with its subfolders before anything is computed. With `overwrite`, removes the files of an
/// earlier run, so that no folder mixes two runs.
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
