use std::path::{Path, PathBuf};

use energy_files::InputFile;
use energy_files::sealed::{Seal, SealError};
use serde::{Deserialize, Serialize};

use crate::measure::Measurements;
use crate::simulation::{RestoreError, SavedState};

const SEAL: Seal = Seal { keyword: "cloth-checkpoint", version: Checkpoint::VERSION };
/// The largest file, in bytes: the state of some ten million vertices.
const LARGEST_FILE: u64 = 4 << 30;

/// A checkpoint of a run: the scene, the state, and the progress of the output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The text of the scene file.
    pub scene: String,
    /// The path of the scene file.
    pub path: PathBuf,
    /// The scene file as it was when the run began; `None` if it was not a regular file.
    pub scene_file: Option<InputFile>,
    /// The meshes and materials of the scene as they were when the run began.
    pub inputs: Vec<InputFile>,
    /// Steps between checkpoints.
    pub every: u64,
    /// Number of frames in the frame file next to the checkpoint.
    pub frames: usize,
    /// CRC-32 of these frames.
    pub frames_checksum: u32,
    /// The readings of pins and garments so far.
    pub measurements: Measurements,
    /// Whether the run checks frames for crossings.
    #[serde(default)]
    pub check_crossings: bool,
    /// The state of the simulation.
    pub state: SavedState,
}

/// A checkpoint that cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file cannot be read.
    #[error("cannot read the checkpoint {}; was the run started with --checkpoint?", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// The file is not a checkpoint.
    #[error("{} is not a checkpoint of a run", .path.display())]
    Foreign { path: PathBuf },
    /// The file was modified or truncated.
    #[error("the checkpoint {} is damaged: {reason}. Start the run again", .path.display())]
    Damaged { path: PathBuf, reason: String },
    /// The file was written by a newer program.
    #[error(
        "the checkpoint {} has version {version}, but this program reads version {}; use the newer program",
        .path.display(), Checkpoint::VERSION
    )]
    Newer { path: PathBuf, version: u32 },
    /// The file was written by an older program.
    #[error(
        "the checkpoint {} has version {version}, but this program reads version {}; start the run again",
        .path.display(), Checkpoint::VERSION
    )]
    Older { path: PathBuf, version: u32 },
    /// A mesh or material is not the one that the run began with.
    #[error(
        "{} was edited since the run began, which could not be resumed as it was. Restore the file, start the run \
         again, or pass --accept-edited to continue with the new one", .path.display()
    )]
    Edited { path: PathBuf },
    /// The saved state does not fit the scene.
    #[error(transparent)]
    State(#[from] RestoreError),
}

impl CheckpointError {
    /// Whether the checkpoint before this one may be usable.
    pub(super) fn is_of_the_file(&self) -> bool {
        matches!(self, Self::Unreadable { .. } | Self::Foreign { .. } | Self::Damaged { .. })
    }
}

impl Checkpoint {
    /// The version that this program reads and writes.
    pub const VERSION: u32 = 5;

    /// Encodes the checkpoint as the contents of a file: a line of text with version, length and checksum, then JSON
    /// with exact numbers.
    ///
    /// # Errors
    /// Returns an error if a number is not finite.
    pub fn to_bytes(&self) -> Result<Vec<u8>, serde_json::Error> {
        Ok(SEAL.close(&serde_json::to_vec(self)?))
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, is damaged, or has another version.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let file = energy_files::read_state(path, LARGEST_FILE);
        let file = file.map_err(|source| CheckpointError::Unreadable { path: path.to_owned(), source })?;
        Self::from_bytes(&file, path)
    }

    /// Decodes a checkpoint from the contents of a file. The path is used in messages.
    ///
    /// # Errors
    /// Returns an error if the contents are damaged or have another version.
    pub fn from_bytes(file: &[u8], path: &Path) -> Result<Self, CheckpointError> {
        let path = path.to_owned();
        let damaged = |reason: &str| CheckpointError::Damaged { path: path.clone(), reason: reason.to_owned() };
        let body = SEAL.open(file).map_err(|error| match error {
            SealError::Foreign => CheckpointError::Foreign { path: path.clone() },
            SealError::OtherVersion(version) if version > Self::VERSION => {
                CheckpointError::Newer { path: path.clone(), version }
            }
            SealError::OtherVersion(version) => CheckpointError::Older { path: path.clone(), version },
            SealError::Damaged(reason) => damaged(reason),
            other => damaged(&other.to_string()),
        })?;
        serde_json::from_slice(body).map_err(|error| damaged(&error.to_string()))
    }
}
