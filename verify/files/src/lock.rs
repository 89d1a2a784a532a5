//! The lock of a folder of results: two programs must not write to one folder at once.

use std::fmt;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

use crate::fault;
use crate::read::{is_same, open_state};

/// A folder that cannot be locked.
#[derive(Debug)]
#[non_exhaustive]
pub enum LockError {
    /// Another process writes to the folder.
    InUse {
        /// Path of the folder.
        folder: PathBuf,
        /// Identifier of the other process; `None` if it is not known yet.
        process: Option<u32>,
    },
    /// The file of the lock cannot be used.
    File {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's reason.
        source: std::io::Error,
    },
}

impl fmt::Display for LockError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InUse { folder, process } => {
                write!(f, "{} is in use by ", folder.display())?;
                match process {
                    Some(process) => write!(f, "process {process}")?,
                    None => f.write_str("another process")?,
                }
                f.write_str("; wait until it ends, or choose another folder with -o")
            }
            Self::File { path, .. } => write!(f, "cannot lock {}", path.display()),
        }
    }
}

impl std::error::Error for LockError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::InUse { .. } => None,
            Self::File { source, .. } => Some(source),
        }
    }
}

/// A file that the operating system locks for this process. It releases the lock when the process ends, however it
/// ends, so the file of a killed program does not lock anything.
#[derive(Debug)]
pub struct FolderLock {
    path: PathBuf,
    /// The open file, which holds the lock.
    _file: File,
}

/// The file holds an identifier of a process.
const LARGEST_FILE: u64 = 4096;

impl FolderLock {
    /// Locks a folder with a file of this name. `None` if its file system has no locks.
    ///
    /// # Errors
    /// If another process holds the lock, or the file is a symbolic link or cannot be written.
    ///
    /// ```
    /// use energy_files::{FolderLock, LockError};
    /// # let folder = tempfile::tempdir()?;
    /// let lock = FolderLock::take(folder.path(), "run.lock")?;
    /// let second = FolderLock::take(folder.path(), "run.lock");
    /// assert!(matches!(second, Err(LockError::InUse { .. })));
    /// drop(lock);
    /// assert!(FolderLock::take(folder.path(), "run.lock").is_ok());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn take(folder: &Path, name: &str) -> Result<Option<Self>, LockError> {
        let path = folder.join(name);
        let failed = |source| LockError::File { path: path.clone(), source };
        loop {
            let mut file = match open(&path) {
                Ok(file) => file,
                // Another program created or removed the file in the meantime.
                Err(error)
                    if matches!(error.kind(), ErrorKind::AlreadyExists | ErrorKind::NotFound) && folder.is_dir() =>
                {
                    continue;
                }
                Err(error) => return Err(failed(error)),
            };
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(LockError::InUse { folder: folder.to_owned(), process: process(file) });
                }
                Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => return Ok(None),
                Err(TryLockError::Error(error)) => return Err(failed(error)),
            }
            // Between opening and locking, another program may have ended and removed the file: then lock the new one.
            if is_at(&file, &path) {
                let written = fault::operation().and_then(|()| file.set_len(0)).and_then(|()| file.rewind());
                written.and_then(|()| write!(file, "{}", std::process::id())).map_err(failed)?;
                return Ok(Some(Self { path, _file: file }));
            }
        }
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // If the folder is gone, so is the lock.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Opens the file of a lock without following a symbolic link, or creates it.
fn open(path: &Path) -> std::io::Result<File> {
    fault::operation()?;
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    match path.symlink_metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound => options.create_new(true).open(path),
        Err(error) => Err(error),
        Ok(_) => open_state(path, LARGEST_FILE, &options),
    }
}

/// Returns the process that a lock names.
fn process(file: File) -> Option<u32> {
    let mut text = String::new();
    file.take(LARGEST_FILE).read_to_string(&mut text).ok()?;
    text.trim().parse().ok()
}

/// Whether a path names an open file itself, and not through a symbolic link.
fn is_at(file: &File, path: &Path) -> bool {
    matches!((file.metadata(), path.symlink_metadata()), (Ok(open), Ok(named)) if is_same(&open, &named))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAME: &str = "test.lock";

    #[test]
    fn a_lock_excludes_others_until_it_is_dropped_and_a_stale_file_excludes_nobody() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(NAME), "99999999").unwrap();
        let lock = FolderLock::take(folder.path(), NAME).unwrap();
        let message = FolderLock::take(folder.path(), NAME).unwrap_err().to_string();
        assert!(message.contains(&format!("in use by process {};", std::process::id())), "{message}");
        drop(lock);
        assert!(!folder.path().join(NAME).exists());
        assert!(FolderLock::take(folder.path(), NAME).is_ok());
        let missing = folder.path().join("missing");
        assert!(matches!(FolderLock::take(&missing, NAME), Err(LockError::File { .. })));
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_does_not_write_through_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let precious = folder.path().join("precious");
        std::fs::write(&precious, "precious").unwrap();
        for target in [precious.as_path(), Path::new("missing"), Path::new("/dev/null")] {
            std::os::unix::fs::symlink(target, folder.path().join(NAME)).unwrap();
            let error = FolderLock::take(folder.path(), NAME).unwrap_err();
            assert!(format!("{error:?}").contains("symbolic link"), "{error:?}");
            std::fs::remove_file(folder.path().join(NAME)).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&precious).unwrap(), "precious");
        assert!(!folder.path().join("missing").exists());
    }
}
