//! Folders of results.

use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

use crate::fault;

/// Creates a folder in a folder of results, and returns its path. A symbolic link in its place is refused: what is
/// written would appear elsewhere.
///
/// # Errors
/// If the folder cannot be created, or something else has its name.
pub fn subfolder(folder: &Path, name: &str) -> Result<PathBuf> {
    let path = folder.join(name);
    match path.symlink_metadata() {
        Ok(found) if found.is_dir() => Ok(path),
        Ok(_) => Err(Error::new(ErrorKind::NotADirectory, format!("{} is not a folder", path.display()))),
        Err(error) if error.kind() == ErrorKind::NotFound => create_folder(&path).map(|()| path),
        Err(error) => Err(error),
    }
}

/// Creates a folder and those above it.
///
/// # Errors
/// If a folder cannot be created.
pub fn create_folder(path: &Path) -> Result<()> {
    fault::operation()?;
    std::fs::create_dir_all(path)
}

/// Removes a file of earlier results.
///
/// # Errors
/// If the file cannot be removed.
pub fn remove_file(path: impl AsRef<Path>) -> Result<()> {
    fault::operation()?;
    std::fs::remove_file(path)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_no_folder_of_results() {
        let folder = tempfile::tempdir().unwrap();
        let elsewhere = tempfile::tempdir().unwrap();
        assert!(subfolder(folder.path(), "frames").unwrap().is_dir());
        assert!(subfolder(folder.path(), "frames").is_ok());
        std::os::unix::fs::symlink(elsewhere.path(), folder.path().join("meshes")).unwrap();
        let error = subfolder(folder.path(), "meshes").unwrap_err().to_string();
        assert!(error.ends_with("meshes is not a folder"), "{error}");
    }
}
