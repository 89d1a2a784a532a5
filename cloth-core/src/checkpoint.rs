//! States of a simulation, saved so that it can go on later as if it had not stopped.

use std::path::{Path, PathBuf};
use std::time::Duration;

use energy_dsl::Vector3;
use energy_solve::{Counts, EvaluationError, Tally};
use serde::{Deserialize, Serialize};

use crate::integrator::{Phases, SolvedBy};
use crate::island::SavedIsland;
use crate::ledger::Ledger;

/// The version of checkpoints that this program writes and reads.
const VERSION: u32 = 3;
/// How a checkpoint starts; then follow its version, the length and the CRC-32 of the rest.
const KEYWORD: &str = "cloth-checkpoint";

/// Everything that the motion from here depends on, and what was done so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    /// The CRC-32 of the masses of all vertices, which tells meshes apart.
    pub masses_checksum: u32,
    /// Steps done.
    pub steps: u64,
    /// Positions, in m.
    pub x: Vec<Vector3<f64>>,
    /// Velocities, in m/s.
    pub v: Vec<Vector3<f64>>,
    /// What integrators remember of earlier steps, and what sleeps.
    pub islands: Vec<SavedIsland>,
    /// The ledger, if one is kept.
    pub ledger: Option<Ledger>,
    /// Linear systems solved.
    pub solves: u64,
    /// And by what.
    #[serde(default)]
    pub solved_by: SolvedBy,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Steps solved again with projected curvature.
    pub projected: u64,
    /// Steps rejected and tried again with a smaller size.
    pub rejected: u64,
    /// Steps slept through, of all islands.
    pub slept: u64,
    /// Time spent in steps.
    pub stepping_time: Duration,
    /// The same by phase.
    pub phases: Phases,
    /// What each term evaluated.
    pub counts: Vec<SavedCounts>,
    /// What each term could use again; see [`Counts::reused`].
    pub reused: Vec<u64>,
}

/// What a term evaluated, without what it used again: for value, first and second derivatives the numbers evaluated, skipped, flagged and projected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedCounts([[u64; 4]; 3]);

impl From<Counts> for SavedCounts {
    fn from(counts: Counts) -> Self {
        let row = |tally: Tally| [tally.evaluated, tally.skipped, tally.flagged, tally.projected];
        Self([counts.value, counts.gradient, counts.hessian].map(row))
    }
}

impl From<SavedCounts> for Counts {
    fn from(SavedCounts(rows): SavedCounts) -> Self {
        let tally =
            |[evaluated, skipped, flagged, projected]: [u64; 4]| Tally { evaluated, skipped, flagged, projected };
        let [value, gradient, hessian] = rows.map(tally);
        Self { value, gradient, hessian, reused: 0 }
    }
}

/// How [`Counts`] are written with what holds them.
pub(crate) mod saved_counts {
    use super::{Counts, SavedCounts};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(counts: &Counts, serializer: S) -> Result<S::Ok, S::Error> {
        SavedCounts::from(*counts).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Counts, D::Error> {
        SavedCounts::deserialize(deserializer).map(Counts::from)
    }
}

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
    /// It does not fit the scene.
    #[error(
        "the checkpoint is of another scene: its {found} vertices are not the {expected} that the scene has now. Did a mesh or material file change?"
    )]
    OtherScene {
        /// Vertices of the scene.
        expected: usize,
        /// Vertices of the checkpoint.
        found: usize,
    },
    /// Its numbers make no state.
    #[error("the state of the checkpoint: {source}")]
    Unfit {
        /// What is wrong.
        source: EvaluationError,
    },
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
