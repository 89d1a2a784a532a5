//! Sequences of files, one for each frame.

use std::path::{Path, PathBuf};

/// File numbers that do not form a sequence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NumberingError {
    /// A number is missing.
    #[error(
        "no file has the number {missing}: {} follows {}. Number the frames without gaps", .after.display(),
        .before.display()
    )]
    Gap {
        /// The file before the gap.
        before: PathBuf,
        /// The first missing number.
        missing: u64,
        /// The file after the gap.
        after: PathBuf,
    },
    /// Two files have the same number, with other zeros before it.
    #[error("{} and {} have the same number; remove one of them", .one.display(), .other.display())]
    SameNumber {
        /// One of the files.
        one: PathBuf,
        /// The other file.
        other: PathBuf,
    },
}

/// Returns an error if the numbers of [`numbered_files`] have gaps or repeat. Equal steps, as in 10, 20, 30, are not
/// gaps.
pub(super) fn check_numbers(pattern: &Path) -> Result<(), NumberingError> {
    let files = numbered(pattern);
    let steps = files.iter().zip(files.iter().skip(1)).map(|((number, _), (next, _))| next - number);
    let step = steps.filter(|step| *step > 0).min().unwrap_or(1);
    for ((number, before), (next, after)) in files.iter().zip(files.iter().skip(1)) {
        if number == next {
            return Err(NumberingError::SameNumber { one: before.clone(), other: after.clone() });
        }
        if number + step < *next {
            return Err(NumberingError::Gap { before: before.clone(), missing: number + step, after: after.clone() });
        }
    }
    Ok(())
}

/// Returns the files whose names match a pattern, with a number in the place of `*`, in the order of the numbers. Empty
/// if the pattern has no `*` or its folder cannot be read.
pub(super) fn numbered_files(pattern: &Path) -> Vec<PathBuf> {
    numbered(pattern).into_iter().map(|(_, path)| path).collect()
}

/// Returns these files with their numbers.
fn numbered(pattern: &Path) -> Vec<(u64, PathBuf)> {
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
    found
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
        let error = check_numbers(&folder.path().join("body_*.obj")).unwrap_err();
        assert_eq!(
            error.to_string().replace(&format!("{}/", folder.path().display()), ""),
            "no file has the number 3: body_10.obj follows body_2.obj. Number the frames without gaps"
        );
        for name in ["arm_010.obj", "arm_020.obj", "arm_030.obj"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        assert_eq!(check_numbers(&folder.path().join("arm_*.obj")), Ok(()));
        std::fs::write(folder.path().join("body_01.obj"), "").unwrap();
        let error = check_numbers(&folder.path().join("body_*.obj")).unwrap_err();
        assert!(error.to_string().ends_with("body_1.obj have the same number; remove one of them"), "{error}");
        assert!(numbered_files(&folder.path().join("body.obj")).is_empty());
        assert!(numbered_files(Path::new("missing/body_*.obj")).is_empty());
    }
}
