//! Sequences of files, one for each frame.

use std::path::{Path, PathBuf};

/// Returns the files whose names match a pattern, with a number in the place of `*`, in the order of the numbers. Empty
/// if the pattern has no `*` or its folder cannot be read.
pub(super) fn numbered_files(pattern: &Path) -> Vec<PathBuf> {
    let name = pattern.file_name().unwrap_or_default().to_string_lossy();
    let (Some((before, after)), Some(folder)) = (name.split_once('*'), pattern.parent()) else { return Vec::new() };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let number = |path: &Path| -> Option<u64> {
        let name = path.file_name()?.to_string_lossy();
        name.strip_prefix(before)?.strip_suffix(after)?.parse().ok()
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<(u64, PathBuf)> = entries.filter_map(|path| Some((number(&path)?, path))).collect();
    found.sort();
    found.into_iter().map(|(_, path)| path).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_in_the_order_of_their_numbers() {
        let folder = tempfile::TempDir::new().unwrap();
        for name in ["body_2.obj", "body_10.obj", "body_1.obj", "body_x.obj", "body_3.mtl"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = numbered_files(&folder.path().join("body_*.obj"));
        let names: Vec<_> = found.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["body_1.obj", "body_2.obj", "body_10.obj"]);
        assert!(numbered_files(&folder.path().join("body.obj")).is_empty());
        assert!(numbered_files(Path::new("missing/body_*.obj")).is_empty());
    }
}
