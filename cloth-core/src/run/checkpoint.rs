use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::simulation::{RestoreError, SavedState};

/// The version of checkpoints that this program writes and reads.
const VERSION: u32 = 3;
/// How a checkpoint starts; then follow its version, the length and the CRC-32 of the rest.
const KEYWORD: &str = "cloth-checkpoint";

/// A checkpoint of a run: the scene, the state, and how far its output has got.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The text of the scene file.
    pub scene: String,
    /// Its path.
    pub path: PathBuf,
    /// Steps from one checkpoint to the next.
    pub every: u64,
    /// Frames kept so far in the file beside it, and the CRC-32 of them.
    pub frames: usize,
    /// See `frames`.
    pub frames_checksum: u32,
    /// The state.
    pub state: SavedState,
}

/// A checkpoint that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be read.
    #[error("cannot read the checkpoint {}; was the run started with --checkpoint?", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no checkpoint.
    #[error("{} is no checkpoint of a run", .path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// It was changed or cut short.
    #[error("the checkpoint {} is damaged: {reason}. Start the run again", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// It was written by a newer program.
    #[error("the checkpoint {} has version {version}, but this program reads version {VERSION}; use the newer program", .path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its version.
        version: u32,
    },
    /// It was written by an older program.
    #[error("the checkpoint {} has version {version}, but this program reads version {VERSION}; start the run again", .path.display())]
    Older {
        /// The file.
        path: PathBuf,
        /// Its version.
        version: u32,
    },
    /// The saved state does not fit the scene.
    #[error(transparent)]
    State(#[from] RestoreError),
}

impl Checkpoint {
    /// As the contents of a file: a line of text with version, length and checksum, then JSON, whose numbers are exact.
    ///
    /// # Errors
    /// When a number is not finite.
    pub fn to_bytes(&self) -> Result<Vec<u8>, serde_json::Error> {
        let body = serde_json::to_vec(self)?;
        let mut file = format!("{KEYWORD} {VERSION} {} {:08x}\n", body.len(), crc32fast::hash(&body)).into_bytes();
        file.extend(body);
        Ok(file)
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// When it cannot be read, is damaged, or was written by another version of this program.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let file =
            std::fs::read(path).map_err(|source| CheckpointError::Unreadable { path: path.to_owned(), source })?;
        Self::from_bytes(&file, path)
    }

    /// Reads a checkpoint from the contents of a file; the path is for messages.
    ///
    /// # Errors
    /// When it is damaged, or was written by another version of this program.
    pub fn from_bytes(file: &[u8], path: &Path) -> Result<Self, CheckpointError> {
        let path = path.to_owned();
        let end = file.iter().position(|&byte| byte == b'\n').unwrap_or(file.len());
        let head = String::from_utf8_lossy(&file[..end]);
        let mut words = head.split(' ');
        if words.next() != Some(KEYWORD) {
            return Err(CheckpointError::Foreign { path });
        }
        let damaged = |reason: &str| CheckpointError::Damaged { path: path.clone(), reason: reason.to_owned() };
        let version: u32 =
            words.next().and_then(|word| word.parse().ok()).ok_or_else(|| damaged("its first line is broken"))?;
        if version > VERSION {
            return Err(CheckpointError::Newer { path, version });
        }
        if version < VERSION {
            return Err(CheckpointError::Older { path, version });
        }
        let (length, checksum) = (words.next(), words.next());
        let body = file.get(end + 1..).unwrap_or_default();
        if length.and_then(|word| word.parse().ok()) != Some(body.len()) {
            return Err(damaged("it is cut short"));
        }
        if checksum.and_then(|word| u32::from_str_radix(word, 16).ok()) != Some(crc32fast::hash(body)) {
            return Err(damaged("its checksum does not match"));
        }
        serde_json::from_slice(body).map_err(|error| damaged(&error.to_string()))
    }
}
