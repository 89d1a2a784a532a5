//! The frames of a run, in memory and in an append-only file next to the checkpoint.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use energy_dsl::Vector3;
use energy_files::AppendFile;

use super::checkpoint::CheckpointError;
use crate::output::OutputError;
use crate::scene::OutputChoice;

/// The positions of all vertices in one frame, in m. Pictures are drawn from them on another thread.
pub(super) type Frame = Arc<[Vector3<f64>]>;

/// Vectors at all vertices in one frame; empty if they are not stored.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Vectors {
    /// In m/s.
    pub velocities: Vec<Vector3<f64>>,
    /// Forces of contact, in N.
    pub forces: Vec<Vector3<f64>>,
}

/// The kinds of vectors that are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Wanted {
    velocities: bool,
    forces: bool,
}

impl Wanted {
    /// Bytes per vertex.
    fn size(self) -> usize {
        12 * (usize::from(self.velocities) + usize::from(self.forces))
    }

    /// Returns the wanted vectors, rounded to single precision.
    fn of(self, all: &Vectors) -> Vectors {
        let rounded = |wanted: bool, vectors: &[Vector3<f64>]| {
            if wanted { vectors.iter().map(|v| v.map(|number| f64::from(number as f32))).collect() } else { Vec::new() }
        };
        Vectors { velocities: rounded(self.velocities, &all.velocities), forces: rounded(self.forces, &all.forces) }
    }

    /// Reads the vectors of a frame.
    fn read(self, bytes: &[u8]) -> Vectors {
        let (first, second) = bytes.split_at(if self.velocities { bytes.len() * 12 / self.size() } else { 0 });
        let points = |bytes: &[u8]| bytes.chunks_exact(12).map(single_point).collect();
        Vectors { velocities: points(first), forces: points(second) }
    }
}

/// Frames, each with the positions of all vertices. The file holds them one after the other, in little-endian double
/// precision. Each is followed by the vectors that files need, in single precision.
#[derive(Debug)]
pub(crate) struct FrameStore {
    frames: Vec<Frame>,
    /// The vectors of each frame that a file of the whole run needs.
    vectors: Vec<Vectors>,
    stored: Wanted,
    kept: Wanted,
    file: Option<AppendFile>,
}

impl FrameStore {
    /// Creates an empty store, backed by a file if a path is given.
    pub(crate) fn new(path: Option<PathBuf>, wanted: &OutputChoice) -> Result<Self, OutputError> {
        let open = |path: PathBuf| AppendFile::create(&path).map_err(|source| OutputError::File { path, source });
        let (file, (stored, kept)) = (path.map(open).transpose()?, needs(wanted));
        let (frames, vectors) = (Vec::new(), Vec::new());
        Ok(Self { frames, vectors, stored, kept, file })
    }

    /// Reads the first frames of a file and truncates it after them: later frames were written after the checkpoint.
    /// Also returns the vectors of each frame that the file has.
    pub(crate) fn reopen(
        path: &Path,
        count: usize,
        vertices: usize,
        wanted: &OutputChoice,
        checksum: u32,
    ) -> Result<(Self, Vec<Vectors>), CheckpointError> {
        let (stored, kept) = needs(wanted);
        let of_positions = 24 * vertices;
        let size = of_positions + stored.size() * vertices;
        let length = (count as u64).saturating_mul(size as u64);
        let (file, whole) = AppendFile::reopen(path, length, checksum).map_err(|source| match source.kind() {
            ErrorKind::InvalidData => CheckpointError::Damaged { path: path.to_owned(), reason: source.to_string() },
            _ => CheckpointError::Unreadable { path: path.to_owned(), source },
        })?;
        let mut frames: Vec<Frame> = Vec::new();
        let mut vectors = Vec::new();
        for frame in 0..count {
            let (x, rest) = whole[frame * size..][..size].split_at(of_positions);
            frames.push(x.chunks_exact(24).map(double_point).collect());
            vectors.push(stored.read(rest));
        }
        let own = vectors.iter().map(|vectors| kept.of(vectors)).collect();
        Ok((Self { frames, vectors: own, stored, kept, file: Some(file) }, vectors))
    }

    pub(crate) fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// The vectors of each frame that a file of the whole run needs.
    pub(super) fn vectors(&self) -> &[Vectors] {
        &self.vectors
    }

    /// CRC-32 of all frames; 0 without a file.
    pub(crate) fn checksum(&self) -> u32 {
        self.file.as_ref().map_or(0, AppendFile::checksum)
    }

    pub(super) fn add(&mut self, frame: Frame, vectors: &Vectors) -> Result<(), OutputError> {
        if let Some(file) = &mut self.file {
            let mut bytes: Vec<u8> = frame.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect();
            let stored = self.stored.of(vectors);
            let numbers = stored.velocities.as_flattened().iter().chain(stored.forces.as_flattened());
            bytes.extend(numbers.flat_map(|&number| (number as f32).to_le_bytes()));
            file.append(&bytes).map_err(|source| OutputError::File { path: file.path().to_owned(), source })?;
        }
        self.frames.push(frame);
        // Rounded as in the file, so that a resumed run writes the same.
        self.vectors.push(self.kept.of(vectors));
        Ok(())
    }

    /// Flushes added frames to the disk.
    pub(crate) fn sync(&self) -> Result<(), OutputError> {
        let Some(file) = &self.file else { return Ok(()) };
        file.sync().map_err(|source| OutputError::File { path: file.path().to_owned(), source })
    }
}

/// Returns which vectors are stored, and which are kept in memory.
fn needs(wanted: &OutputChoice) -> (Wanted, Wanted) {
    let kept = Wanted { velocities: wanted.usd && wanted.velocities, forces: wanted.usd && wanted.contact_forces };
    let stored = Wanted {
        velocities: wanted.ply || kept.velocities,
        forces: wanted.ply && wanted.contact_forces || kept.forces,
    };
    (stored, kept)
}

fn double_point(bytes: &[u8]) -> Vector3<f64> {
    std::array::from_fn(|axis| f64::from_le_bytes(std::array::from_fn(|byte| bytes[8 * axis + byte])))
}

fn single_point(bytes: &[u8]) -> Vector3<f64> {
    std::array::from_fn(|axis| f64::from(f32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * axis + byte]))))
}
