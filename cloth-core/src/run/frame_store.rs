//! The frames of a run, in memory and in an append-only file next to the checkpoint.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use energy_dsl::Vector3;

use super::checkpoint::CheckpointError;
use crate::output::OutputError;

/// The positions of all vertices in one frame, in m. Pictures are drawn from them on another thread.
pub(super) type Frame = Arc<[Vector3<f64>]>;

/// Frames, each with the positions of all vertices. The file holds them one after the other, in little-endian double
/// precision.
#[derive(Debug)]
pub(crate) struct FrameStore {
    frames: Vec<Frame>,
    file: Option<(PathBuf, File)>,
    checksum: crc32fast::Hasher,
}

impl FrameStore {
    /// Creates an empty store, backed by a file if a path is given.
    pub(crate) fn new(path: Option<PathBuf>) -> Result<Self, OutputError> {
        let open = |path: PathBuf| match File::create(&path) {
            Ok(file) => Ok((path, file)),
            Err(source) => Err(OutputError::File { path, source }),
        };
        Ok(Self { frames: Vec::new(), file: path.map(open).transpose()?, checksum: crc32fast::Hasher::new() })
    }

    /// Reads the first frames of a file and truncates it after them: later frames were written after the checkpoint.
    pub(crate) fn reopen(path: &Path, count: usize, vertices: usize, checksum: u32) -> Result<Self, CheckpointError> {
        let unreadable = |source| CheckpointError::Unreadable { path: path.to_owned(), source };
        let bytes = std::fs::read(path).map_err(unreadable)?;
        let size = 24 * vertices;
        let damaged = |reason: &str| CheckpointError::Damaged { path: path.to_owned(), reason: reason.to_owned() };
        let kept = bytes.get(..count * size).ok_or_else(|| damaged("it is cut short"))?;
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(kept);
        if hasher.clone().finalize() != checksum {
            return Err(damaged("its checksum does not match"));
        }
        let number = |bytes: &[u8]| f64::from_le_bytes(std::array::from_fn(|byte| bytes[byte]));
        let point = |bytes: &[u8]| -> Vector3<f64> { std::array::from_fn(|axis| number(&bytes[8 * axis..])) };
        let frames = (0..count).map(|frame| kept[frame * size..][..size].chunks_exact(24).map(point).collect());
        let frames = frames.collect();
        let file = OpenOptions::new().append(true).open(path).map_err(unreadable)?;
        file.set_len((count * size) as u64).map_err(unreadable)?;
        Ok(Self { frames, file: Some((path.to_owned(), file)), checksum: hasher })
    }

    pub(crate) fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// CRC-32 of all frames.
    pub(crate) fn checksum(&self) -> u32 {
        self.checksum.clone().finalize()
    }

    pub(crate) fn add(&mut self, frame: Frame) -> Result<(), OutputError> {
        if let Some((path, file)) = &mut self.file {
            let bytes: Vec<u8> = frame.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect();
            file.write_all(&bytes).map_err(|source| OutputError::File { path: path.clone(), source })?;
            self.checksum.update(&bytes);
        }
        self.frames.push(frame);
        Ok(())
    }

    /// Flushes added frames to the disk.
    pub(crate) fn sync(&self) -> Result<(), OutputError> {
        let Some((path, file)) = &self.file else { return Ok(()) };
        file.sync_data().map_err(|source| OutputError::File { path: path.clone(), source })
    }
}
