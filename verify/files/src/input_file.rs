use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::read::read;

/// The largest input file, in bytes.
const LARGEST_FILE: u64 = 256 << 20;

/// A file as it was when a program read it. Tells later whether the file was edited.
///
/// ```
/// use energy_files::InputFile;
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("mesh.obj");
/// std::fs::write(&path, "v 0 0 0")?;
/// let file = InputFile::of(&path).unwrap();
/// assert!(!file.is_edited());
/// std::fs::write(&path, "v 0 0 1")?;
/// assert!(file.is_edited());
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// Absolute path of the file.
    pub path: PathBuf,
    /// Size in bytes.
    pub size: u64,
    /// CRC-32 of the contents.
    pub checksum: u32,
}

impl InputFile {
    /// Reads a file. `None` if it is not a regular file or cannot be read.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let path = std::path::absolute(path).ok()?;
        let contents = read(&path, LARGEST_FILE).ok()?;
        Some(Self { size: contents.len() as u64, checksum: crc32fast::hash(&contents), path })
    }

    /// Whether the file has other contents now. A file that cannot be read has not been edited.
    #[must_use]
    pub fn is_edited(&self) -> bool {
        Self::of(&self.path).is_some_and(|now| now != *self)
    }
}
