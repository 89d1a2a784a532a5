//! The frames of a run, in memory and in an append-only file next to the checkpoint.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use energy_dsl::Vector3;

use super::checkpoint::CheckpointError;
use crate::output::OutputError;
use crate::scene::OutputChoice;

/// The positions of all vertices in one frame, in m. Pictures are drawn from them on another thread.
pub(super) type Frame = Arc<[Vector3<f64>]>;

/// The velocities of all vertices in one frame, in m/s; empty if the file has none.
pub(super) type Velocities = Vec<Vector3<f64>>;

/// Frames, each with the positions of all vertices. The file holds them one after the other, in little-endian double
/// precision; if files need velocities, each is followed by the velocities in single precision.
#[derive(Debug)]
pub(crate) struct FrameStore {
    frames: Vec<Frame>,
    /// Velocities of each frame; empty unless a file of the whole run needs them.
    velocities: Vec<Velocities>,
    has_velocities: bool,
    keeps_velocities: bool,
    file: Option<(PathBuf, File)>,
    checksum: crc32fast::Hasher,
}

impl FrameStore {
    /// Creates an empty store, backed by a file if a path is given.
    pub(crate) fn new(path: Option<PathBuf>, wanted: &OutputChoice) -> Result<Self, OutputError> {
        let open = |path: PathBuf| match File::create(&path) {
            Ok(file) => Ok((path, file)),
            Err(source) => Err(OutputError::File { path, source }),
        };
        let (file, checksum) = (path.map(open).transpose()?, crc32fast::Hasher::new());
        let (frames, velocities) = (Vec::new(), Vec::new());
        let (has_velocities, keeps_velocities) = needs(wanted);
        Ok(Self { frames, velocities, has_velocities, keeps_velocities, file, checksum })
    }

    /// Reads the first frames of a file and truncates it after them: later frames were written after the checkpoint.
    /// Also returns the velocities of each frame; empty if the file has none.
    pub(crate) fn reopen(
        path: &Path,
        count: usize,
        vertices: usize,
        wanted: &OutputChoice,
        checksum: u32,
    ) -> Result<(Self, Vec<Velocities>), CheckpointError> {
        let unreadable = |source| CheckpointError::Unreadable { path: path.to_owned(), source };
        let bytes = std::fs::read(path).map_err(unreadable)?;
        let (has_velocities, keeps_velocities) = needs(wanted);
        let (of_positions, of_velocities) = (24 * vertices, if has_velocities { 12 * vertices } else { 0 });
        let size = of_positions + of_velocities;
        let damaged = |reason: &str| CheckpointError::Damaged { path: path.to_owned(), reason: reason.to_owned() };
        let kept = bytes.get(..count * size).ok_or_else(|| damaged("it is cut short"))?;
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(kept);
        if hasher.clone().finalize() != checksum {
            return Err(damaged("its checksum does not match"));
        }
        let mut frames: Vec<Frame> = Vec::new();
        let mut velocities = Vec::new();
        for frame in 0..count {
            let (x, v) = kept[frame * size..][..size].split_at(of_positions);
            frames.push(x.chunks_exact(24).map(double_point).collect());
            velocities.push(v.chunks_exact(12).map(single_point).collect());
        }
        let file = OpenOptions::new().append(true).open(path).map_err(unreadable)?;
        file.set_len((count * size) as u64).map_err(unreadable)?;
        let kept = if keeps_velocities { velocities.clone() } else { Vec::new() };
        let file = Some((path.to_owned(), file));
        let store = Self { frames, velocities: kept, has_velocities, keeps_velocities, file, checksum: hasher };
        Ok((store, velocities))
    }

    pub(crate) fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Velocities of each frame, in m/s; empty unless a file of the whole run needs them.
    pub(crate) fn velocities(&self) -> &[Velocities] {
        &self.velocities
    }

    /// CRC-32 of all frames.
    pub(crate) fn checksum(&self) -> u32 {
        self.checksum.clone().finalize()
    }

    pub(crate) fn add(&mut self, frame: Frame, velocities: &[Vector3<f64>]) -> Result<(), OutputError> {
        if let Some((path, file)) = &mut self.file {
            let mut bytes: Vec<u8> = frame.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect();
            if self.has_velocities {
                bytes.extend(velocities.as_flattened().iter().flat_map(|&number| (number as f32).to_le_bytes()));
            }
            file.write_all(&bytes).map_err(|source| OutputError::File { path: path.clone(), source })?;
            self.checksum.update(&bytes);
        }
        self.frames.push(frame);
        if self.keeps_velocities {
            // As the file holds them, so that a resumed run writes the same.
            self.velocities.push(velocities.iter().map(|v| v.map(|number| f64::from(number as f32))).collect());
        }
        Ok(())
    }

    /// Flushes added frames to the disk.
    pub(crate) fn sync(&self) -> Result<(), OutputError> {
        let Some((path, file)) = &self.file else { return Ok(()) };
        file.sync_data().map_err(|source| OutputError::File { path: path.clone(), source })
    }
}

/// Returns whether frames are stored with velocities, and whether these are kept in memory.
fn needs(wanted: &OutputChoice) -> (bool, bool) {
    let in_usd = wanted.usd && wanted.velocities;
    (wanted.ply || in_usd, in_usd)
}

fn double_point(bytes: &[u8]) -> Vector3<f64> {
    std::array::from_fn(|axis| f64::from_le_bytes(std::array::from_fn(|byte| bytes[8 * axis + byte])))
}

fn single_point(bytes: &[u8]) -> Vector3<f64> {
    std::array::from_fn(|axis| f64::from(f32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * axis + byte]))))
}
