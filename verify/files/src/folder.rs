//! Folders of results.

use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

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
        Err(error) if error.kind() == ErrorKind::NotFound => std::fs::create_dir_all(&path).map(|()| path),
        Err(error) => Err(error),
    }
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
