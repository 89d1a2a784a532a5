use std::path::Path;

use anyhow::Context;
use energy_files::write_whole;

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
