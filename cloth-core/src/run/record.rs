//! What a finished run says of itself.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::output::OutputFolder;
use crate::simulation::Summary;

/// What a finished run says of itself, in `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The version of this record.
    pub version: u32,
    /// The text of the scene file.
    pub scene: String,
    /// Its path.
    pub path: PathBuf,
    /// Whether all steps were done.
    pub finished: bool,
    /// Frames written.
    pub frames: usize,
    /// What was done.
    pub summary: Summary,
}

impl Record {
    /// The version of records that this program writes.
    pub const VERSION: u32 = 1;

    /// The record in the folder of a run.
    ///
    /// # Errors
    /// When there is none, or it is damaged or newer than this program.
    pub fn read(folder: &Path) -> Result<Self, RecordError> {
        let path = folder.join(OutputFolder::RECORD);
        let bytes = std::fs::read(&path).map_err(|source| RecordError::Unreadable { path: path.clone(), source })?;
        let damaged = |source| RecordError::Damaged { path: path.clone(), source };
        let version = serde_json::from_slice::<Version>(&bytes).map_err(damaged)?.version;
        if version > Self::VERSION {
            return Err(RecordError::Newer { path, version });
        }
        serde_json::from_slice(&bytes).map_err(damaged)
    }
}

/// The part of a record that says how to read the rest.
#[derive(Deserialize)]
struct Version {
    version: u32,
}

/// A folder that is not that of a finished run.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// It is not there.
    #[error("cannot read {}; is this the folder of a finished run?", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It cannot be understood.
    #[error("{} is damaged: {source}", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// It was written by a newer program.
    #[error("{} has version {version}, but this program reads version {}; use the newer program", .path.display(), Record::VERSION)]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its version.
        version: u32,
    },
}
