use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::{Path, PathBuf};

use crate::fault;
use crate::read::open_state;

/// A file that only grows, next to a checkpoint that has its length and checksum. What was added after the checkpoint
/// is cut off when the file is opened again.
#[derive(Debug)]
pub struct AppendFile {
    file: File,
    path: PathBuf,
    length: u64,
    checksum: crc32fast::Hasher,
}

impl AppendFile {
    /// Creates an empty file. One that exists is not touched.
    ///
    /// # Errors
    /// If the file exists or cannot be created.
    pub fn create(path: &Path) -> Result<Self> {
        fault::operation()?;
        let file = File::create_new(path)?;
        Ok(Self { file, path: path.to_owned(), length: 0, checksum: crc32fast::Hasher::new() })
    }

    /// Opens a file with at least `length` bytes, cuts off the others, and returns its contents.
    ///
    /// # Errors
    /// If the file cannot be read or written, is not a regular file, or its contents are not those of the checkpoint:
    /// then the kind is [`ErrorKind::InvalidData`].
    ///
    /// ```
    /// use energy_files::AppendFile;
    /// # let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("frames");
    /// let mut file = AppendFile::create(&path)?;
    /// file.append(b"one")?;
    /// let (length, checksum) = (file.len(), file.checksum());
    /// file.append(b"two")?;
    /// let (file, contents) = AppendFile::reopen(&path, length, checksum)?;
    /// assert_eq!((file.len(), contents), (3, b"one".to_vec()));
    /// assert!(AppendFile::reopen(&path, 4, checksum).is_err());
    /// # Ok::<(), std::io::Error>(())
    /// ```
    pub fn reopen(path: &Path, length: u64, checksum: u32) -> Result<(Self, Vec<u8>)> {
        let damaged = |reason: &str| Error::new(ErrorKind::InvalidData, reason);
        let mut file = open_state(path, u64::MAX, OpenOptions::new().read(true).append(true))?;
        // Compared with the file before there is memory for it.
        let size = usize::try_from(length).ok().filter(|_| file.metadata().is_ok_and(|file| length <= file.len()));
        let mut contents = vec![0; size.ok_or_else(|| damaged("it is cut short"))?];
        file.read_exact(&mut contents)?;
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&contents);
        if hasher.clone().finalize() != checksum {
            return Err(damaged("its checksum does not match"));
        }
        fault::operation()?;
        file.set_len(length)?;
        Ok((Self { file, path: path.to_owned(), length, checksum: hasher }, contents))
    }

    /// Adds bytes at the end.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn append(&mut self, bytes: &[u8]) -> Result<()> {
        let mut rest = bytes;
        while !rest.is_empty() {
            rest = &rest[fault::write(&mut self.file, rest)?..];
        }
        self.checksum.update(bytes);
        self.length += bytes.len() as u64;
        Ok(())
    }

    /// Flushes added bytes to the disk.
    ///
    /// # Errors
    /// If the disk cannot be written.
    pub fn sync(&self) -> Result<()> {
        fault::operation()?;
        self.file.sync_data()
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of bytes.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.length
    }

    /// Whether the file is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// CRC-32 of the contents.
    #[must_use]
    pub fn checksum(&self) -> u32 {
        self.checksum.clone().finalize()
    }
}
