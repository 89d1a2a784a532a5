use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;

/// Writes a file completely or not at all: writes to a temporary file in the same folder, then renames it.
///
/// # Errors
/// If the folder or the file cannot be written.
pub fn write_whole(path: &Path, contents: &[u8]) -> std::io::Result<()> {
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(".part");
    let temporary = PathBuf::from(temporary);
    let written = std::fs::File::create(&temporary)
        .and_then(|mut file| file.write_all(contents).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&temporary, path));
    if written.is_err() {
        let _ = std::fs::remove_file(&temporary);
    }
    written
}

/// Writes a file as [`write_whole`] does, with an error that names the file.
///
/// # Errors
/// If the folder or the file cannot be written.
pub fn write_file(path: &Path, contents: impl AsRef<[u8]>) -> anyhow::Result<()> {
    write_whole(path, contents.as_ref()).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        write_file(&path, "first").unwrap();
        write_file(&path, "second").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "second");

        let missing = folder.path().join("no/folder.json");
        let error = write_file(&missing, "third").unwrap_err();
        assert_eq!(error.to_string(), format!("cannot write {}", missing.display()));
        let names: Vec<_> = folder.path().read_dir().unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(names, ["report.json"]);
    }
}
