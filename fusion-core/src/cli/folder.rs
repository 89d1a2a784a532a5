use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use energy_files::{FolderLock, create_folder, remove_file, remove_parts, subfolder};

/// Model in a recording.
pub const MODEL: &str = "model.json";
/// Bones of a body tracker, in a recording.
pub const SKELETON: &str = "skeleton.json";
/// Table of frames in a track.
pub const FRAMES: &str = "frames.csv";
/// Node motions in a track.
pub const NODES: &str = "nodes.json";

/// Last checkpoint of a track that is not complete.
pub const CHECKPOINT: &str = "checkpoint";
/// The checkpoint before it.
pub const PREVIOUS_CHECKPOINT: &str = "checkpoint.previous";
/// Frames of a track that is not complete.
pub const JOURNAL: &str = "checkpoint.frames";
/// Lock of an output folder.
const LOCK: &str = "fusion.lock";

/// Folder of the moved meshes, in a track.
pub const MESHES: &str = "meshes";
/// Folder of the pictures, in a track.
pub const PICTURES: &str = "pictures";
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
    folder.join(PICTURES).join(format!("{frame:06}.png"))
}

/// Path of a frame's mesh in `truth`, `meshes` or `surface`.
pub fn mesh_file(folder: &Path, kind: &str, frame: usize) -> PathBuf {
    folder.join(kind).join(format!("{frame:06}.obj"))
}

/// Locks an output folder until the lock is dropped; `None` if its file system has no locks. Removes the unfinished
/// files of killed programs.
pub fn lock(folder: &Path) -> Result<Option<FolderLock>> {
    let lock = FolderLock::take(folder, LOCK)?;
    let is_folder = |path: &PathBuf| path.symlink_metadata().is_ok_and(|it| it.is_dir());
    let parts = [MESHES, PICTURES, SURFACE].map(|part| folder.join(part)).into_iter().filter(is_folder);
    for path in parts.chain([folder.to_owned()]) {
        remove_parts(&path).with_context(|| format!("cannot prepare {}", path.display()))?;
    }
    Ok(lock)
}

/// Creates and locks an output folder with its subfolders before anything is computed. With `overwrite`, removes the
/// files of an earlier run, so that no folder mixes two runs.
pub fn prepare(folder: &Path, parts: &[&str], files: &[&str], overwrite: bool) -> Result<Option<FolderLock>> {
    let here = || format!("cannot prepare {}", folder.display());
    create_folder(folder).with_context(here)?;
    let lock = lock(folder)?;
    let is_there = |path: &PathBuf| path.symlink_metadata().is_ok();
    let mut old: Vec<PathBuf> = files.iter().map(|file| folder.join(file)).filter(is_there).collect();
    for part in parts {
        let path = subfolder(folder, part).with_context(here)?;
        remove_parts(&path).with_context(here)?;
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
    old.iter().try_for_each(remove_file).with_context(here)?;
    Ok(lock)
}
