//! Writes files completely or not at all.

use std::collections::hash_map::RandomState;
use std::ffi::OsStr;
use std::fs::{File, OpenOptions};
use std::hash::{BuildHasher, Hasher};
use std::io::{ErrorKind, Result, Write};
use std::path::{Path, PathBuf};

use crate::fault;
use crate::folder::remove_file;

/// Writes a file completely or not at all: writes a new file in the same folder, then renames it. The file and its name
/// are on the disk when the function returns.
///
/// # Errors
/// If the folder or the file cannot be written.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("report.json");
/// energy_files::write_whole(&path, b"{}")?;
/// assert_eq!(std::fs::read(&path)?, b"{}");
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<()> {
    let mut part = PartFile::create(path)?;
    part.write_all(contents)?;
    part.finish()
}

/// A file that appears under its name when it is complete. Until then it has a random name in the same folder; it is
/// removed if it is not finished.
///
/// It is written to as any [`Write`]. No other file is overwritten and no symbolic link is followed: the new file is
/// created exclusively, and renaming replaces a link instead of following it.
#[derive(Debug)]
pub struct PartFile {
    file: File,
    part: PathBuf,
    target: PathBuf,
    is_finished: bool,
}

impl PartFile {
    /// Begins a file.
    ///
    /// # Errors
    /// If the folder cannot be written to.
    pub fn create(path: &Path) -> Result<Self> {
        let (part, file) = loop {
            let part = path.with_file_name(random_name(path.extension()));
            fault::operation()?;
            match OpenOptions::new().write(true).create_new(true).open(&part) {
                Ok(file) => break (part, file),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        };
        Ok(Self { file, part, target: path.to_owned(), is_finished: false })
    }

    /// Path of the unfinished file, for programs that write it. It has the extension of the finished one.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.part
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<()> {
        fault::operation()?;
        self.file.sync_all()?;
        rename(&self.part, &self.target)?;
        self.is_finished = true;
        sync_folder(&self.target)
    }
}

impl Write for PartFile {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        fault::write(&mut self.file, bytes)
    }

    fn flush(&mut self) -> Result<()> {
        self.file.flush()
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if !self.is_finished {
            // If the folder is gone, so is the file.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

/// Removes the unfinished files that killed programs left in a folder. Only the holder of the folder's lock may do so.
///
/// # Errors
/// If the folder cannot be read, or a file cannot be removed.
pub fn remove_parts(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_str().is_some_and(is_part) && entry.file_type()?.is_file() {
            remove_file(entry.path())?;
        }
    }
    Ok(())
}

const PREFIX: &str = ".part-";
/// Hexadecimal digits of a random name.
const DIGITS: usize = 16;

/// Returns a name that nobody can guess. The keys of hash maps come from the operating system's random numbers.
fn random_name(extension: Option<&OsStr>) -> PathBuf {
    let number = RandomState::new().build_hasher().finish();
    let name = PathBuf::from(format!("{PREFIX}{number:0DIGITS$x}"));
    extension.map_or_else(|| name.clone(), |extension| name.with_extension(extension))
}

fn is_part(name: &str) -> bool {
    name.strip_prefix(PREFIX).is_some_and(|rest| {
        let (digits, extension) = rest.split_at_checked(DIGITS).unwrap_or(("", rest));
        let is_hexadecimal = |digit: u8| digit.is_ascii_digit() || (b'a'..=b'f').contains(&digit);
        !digits.is_empty() && digits.bytes().all(is_hexadecimal) && (extension.is_empty() || extension.starts_with('.'))
    })
}

/// Gives a file another name in its folder.
pub(crate) fn rename(from: &Path, to: &Path) -> Result<()> {
    fault::operation()?;
    std::fs::rename(from, to)
}

/// Makes the names in a file's folder durable.
#[cfg(unix)]
pub(crate) fn sync_folder(file: &Path) -> Result<()> {
    fault::operation()?;
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match File::open(folder)?.sync_all() {
        // Some file systems cannot sync folders.
        Err(error) if error.kind() == ErrorKind::InvalidInput => Ok(()),
        synced => synced,
    }
}

#[cfg(not(unix))]
pub(crate) fn sync_folder(_: &Path) -> Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names.into_iter().map(|name| name.into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_appears_when_it_is_complete_and_unfinished_ones_vanish() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.mp4");
        let mut part = PartFile::create(&path).unwrap();
        part.write_all(b"x").unwrap();
        assert!(!path.exists() && part.path().extension() == path.extension());
        part.finish().unwrap();
        drop(PartFile::create(&path).unwrap());
        assert_eq!(names(folder.path()), ["film.mp4"]);
        assert!(write_whole(&folder.path().join("no/folder.json"), b"x").is_err());
    }

    #[test]
    fn parts_of_killed_programs_are_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::mem::forget(PartFile::create(&path).unwrap());
        std::mem::forget(PartFile::create(&folder.path().join("checkpoint")).unwrap());
        for name in [".part-1.txt", ".part-0123456789abcdeg.txt", "a.txt.part"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        remove_parts(folder.path()).unwrap();
        assert_eq!(names(folder.path()), [".part-0123456789abcdeg.txt", ".part-1.txt", "a.txt.part"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_replaced_and_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [precious, link] = ["precious", "run.json"].map(|name| folder.path().join(name));
        std::fs::write(&precious, "precious").unwrap();
        for name in ["run.json", "run.json.part"] {
            std::os::unix::fs::symlink(&precious, folder.path().join(name)).unwrap();
        }
        write_whole(&link, b"new").unwrap();
        assert_eq!(std::fs::read_to_string(&precious).unwrap(), "precious");
        assert!(link.symlink_metadata().unwrap().is_file());
    }
}
