//! JSON files, read and written as a whole.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A JSON file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JsonFileError {
    /// The file cannot be read or written.
    #[error("{}", .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is malformed.
    #[error("{}", .path.display())]
    Json {
        /// Path of the file.
        path: PathBuf,
        /// Error of the parser, with its position.
        source: serde_json::Error,
    },
}

/// The largest file of a body, a skeleton or joints, in bytes.
const LARGEST_FILE: u64 = 256 << 20;

/// Reads a regular file.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, JsonFileError> {
    let text = energy_files::read_text(path, LARGEST_FILE)
        .map_err(|source| JsonFileError::File { path: path.into(), source })?;
    serde_json::from_str(&text).map_err(|source| JsonFileError::Json { path: path.into(), source })
}

/// Writes a file completely or not at all.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), JsonFileError> {
    let text = serde_json::to_vec(value).map_err(|source| JsonFileError::Json { path: path.into(), source })?;
    energy_files::write_whole(path, &text).map_err(|source| JsonFileError::File { path: path.into(), source })
}
