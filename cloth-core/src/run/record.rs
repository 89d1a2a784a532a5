//! The machine-readable record of a finished run.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::measure::Measurements;
use crate::output::OutputFolder;
use crate::simulation::Summary;

/// The largest file, in bytes.
const LARGEST_FILE: u64 = 256 << 20;

/// The record of a finished run, `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Version of the format.
    pub version: u32,
    /// The text of the scene file.
    pub scene: String,
    /// The path of the scene file.
    pub path: PathBuf,
    /// Whether all steps were completed.
    pub finished: bool,
    /// Number of frames written.
    pub frames: usize,
    /// Totals and final state.
    pub summary: Summary,
    /// The readings of pins and garments: one per frame, or fewer if they were too many; the first and the last always.
    /// No pins and no garments if an earlier version wrote the record.
    #[serde(default)]
    pub measurements: Measurements,
}

impl Record {
    /// The version that this program writes.
    pub const VERSION: u32 = 1;

    /// Reads the record in the folder of a run.
    ///
    /// # Errors
    /// Returns an error if the record is missing, damaged or newer than this program.
    pub fn read(folder: &Path) -> Result<Self, RecordError> {
        let path = folder.join(OutputFolder::RECORD);
        let bytes = energy_files::read_state(&path, LARGEST_FILE)
            .map_err(|source| RecordError::Unreadable { path: path.clone(), source })?;
        let damaged = |source| RecordError::Damaged { path: path.clone(), source };
        let version = serde_json::from_slice::<Version>(&bytes).map_err(damaged)?.version;
        if version > Self::VERSION {
            return Err(RecordError::Newer { path, version });
        }
        serde_json::from_slice(&bytes).map_err(damaged)
    }
}

/// The part of a record that tells how to read the rest.
#[derive(Deserialize)]
struct Version {
    version: u32,
}

/// A folder that does not hold a finished run.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum RecordError {
    /// The file cannot be read.
    #[error("cannot read {}; is this the folder of a finished run?", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// The file is not a valid record.
    #[error("{} is damaged: {source}", .path.display())]
    Damaged { path: PathBuf, source: serde_json::Error },
    /// The file was written by a newer program.
    #[error(
        "{} has version {version}, but this program reads version {}; use the newer program",
        .path.display(), Record::VERSION
    )]
    Newer { path: PathBuf, version: u32 },
}
