//! The lock of an output folder: two runs must not write to one folder at once.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use super::OutputError;

/// A file that the operating system locks for this process. It releases the lock when the process ends, however it
/// ends, so the file of a killed run does not lock anything.
#[derive(Debug)]
pub(super) struct FolderLock {
    path: PathBuf,
    /// The open file, which holds the lock.
    _file: File,
}

/// File name of the lock.
const NAME: &str = "cloth.lock";

impl FolderLock {
    /// Locks a folder. `None` if its file system has no locks.
    pub(super) fn take(folder: &Path) -> Result<Option<Self>, OutputError> {
        let path = folder.join(NAME);
        let failed = |source| OutputError::File { path: path.clone(), source };
        loop {
            let mut options = OpenOptions::new();
            let mut file = options.read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(in_use(folder, file)),
                Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => return Ok(None),
                Err(TryLockError::Error(error)) => return Err(failed(error)),
            }
            // Between opening and locking, another run may have ended and removed the file: then lock the new one.
            if is_at(&file, &path) {
                file.set_len(0).and_then(|()| write!(file, "{}", std::process::id())).map_err(failed)?;
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

fn in_use(folder: &Path, mut file: File) -> OutputError {
    let mut process = String::new();
    // A message without the process is good enough.
    let _ = file.read_to_string(&mut process);
    OutputError::InUse { path: folder.to_owned(), process }
}

/// Whether a path names an open file.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: &std::fs::Metadata, b: &std::fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    matches!((file.metadata(), std::fs::metadata(path)), (Ok(open), Ok(named)) if same(&open, &named))
}

/// Whether a path names an open file. A file cannot be removed while it is open.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_excludes_others_until_it_is_dropped_and_a_stale_file_excludes_nobody() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(NAME), "99999999").unwrap();
        let lock = FolderLock::take(folder.path()).unwrap();
        let message = FolderLock::take(folder.path()).unwrap_err().to_string();
        assert!(message.contains(&format!("in use by process {}", std::process::id())), "{message}");
        drop(lock);
        assert!(!folder.path().join(NAME).exists());
        assert!(FolderLock::take(folder.path()).is_ok());
    }
}
