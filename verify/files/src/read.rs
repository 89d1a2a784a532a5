//! Reads files of limited size.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Opens a regular file of at most `limit` bytes. A pipe, a socket or a device might never end.
///
/// # Errors
/// If the file cannot be opened, is not a regular file, or is larger.
pub fn open(path: &Path, limit: u64) -> Result<File> {
    // Before it is opened: opening a pipe waits for its other end.
    check(&path.metadata()?, limit)?;
    let file = File::open(path)?;
    check(&file.metadata()?, limit)?;
    Ok(file)
}

/// Reads a regular file of at most `limit` bytes.
///
/// # Errors
/// Those of [`open`], and if the file cannot be read.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("mesh.obj");
/// std::fs::write(&path, "v 0 0 0")?;
/// assert_eq!(energy_files::read(&path, 1 << 20)?, b"v 0 0 0");
/// assert!(energy_files::read(&path, 6).unwrap_err().to_string().contains("larger than 6 bytes"));
/// assert!(energy_files::read(folder.path(), 6).unwrap_err().to_string().contains("expected a regular file"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>> {
    contents(open(path, limit)?, limit)
}

/// Reads a regular file of at most `limit` bytes, which must be UTF-8.
///
/// # Errors
/// Those of [`read`], and if the file is not UTF-8; then the message names the line.
pub fn read_text(path: &Path, limit: u64) -> Result<String> {
    utf8(read(path, limit)?)
}

/// Reads a file that a program has written into its own folder. Unlike [`read`], follows no symbolic link: the
/// folder may be a stranger's.
///
/// # Errors
/// Those of [`read`], and if the path is a symbolic link.
pub fn read_state(path: &Path, limit: u64) -> Result<Vec<u8>> {
    contents(open_state(path, limit, OpenOptions::new().read(true))?, limit)
}

/// Opens a file that a program has written into its own folder, as [`read_state`] does. The options must not
/// create or truncate it.
///
/// # Errors
/// If the file cannot be opened, is not a regular file, is larger than `limit` bytes, or the path is a symbolic link.
pub fn open_state(path: &Path, limit: u64, options: &OpenOptions) -> Result<File> {
    let named = path.symlink_metadata()?;
    check(&named, limit)?;
    let file = options.open(path)?;
    match is_same(&named, &file.metadata()?) {
        true => Ok(file),
        false => Err(Error::other("another file took its place")),
    }
}

/// Returns the text of a file, which must be UTF-8.
///
/// # Errors
/// If the contents are not UTF-8; the message names the line.
pub fn utf8(contents: Vec<u8>) -> Result<String> {
    String::from_utf8(contents).map_err(|error| {
        let line =
            error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&byte| byte == b'\n').count() + 1;
        Error::new(ErrorKind::InvalidData, format!("line {line} is not UTF-8"))
    })
}

fn check(file: &Metadata, limit: u64) -> Result<()> {
    if file.is_symlink() {
        return Err(Error::new(ErrorKind::InvalidInput, "expected a regular file, got a symbolic link"));
    }
    if !file.is_file() {
        let kind = if file.is_dir() { "a folder" } else { "a pipe, socket or device" };
        return Err(Error::new(ErrorKind::InvalidInput, format!("expected a regular file, got {kind}")));
    }
    if file.len() > limit { Err(too_large(limit)) } else { Ok(()) }
}

/// Reads an open file. Some files of the system have contents but no size.
fn contents(file: File, limit: u64) -> Result<Vec<u8>> {
    let mut contents = Vec::with_capacity(file.metadata()?.len().min(limit) as usize);
    file.take(limit.saturating_add(1)).read_to_end(&mut contents)?;
    if contents.len() as u64 > limit { Err(too_large(limit)) } else { Ok(contents) }
}

fn too_large(limit: u64) -> Error {
    let size = if limit >> 20 > 0 { format!("{} MiB", limit >> 20) } else { format!("{limit} bytes") };
    Error::new(ErrorKind::FileTooLarge, format!("it is larger than {size}"))
}

/// Whether two descriptions are of the same file.
#[cfg(unix)]
pub(crate) fn is_same(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Whether two descriptions may be of the same file. A file cannot be replaced while it is open.
#[cfg(not(unix))]
pub(crate) fn is_same(a: &Metadata, b: &Metadata) -> bool {
    a.file_type() == b.file_type()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_are_read_and_states_follow_no_link() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link, pipe] = ["file", "link", "pipe"].map(|name| folder.path().join(name));
        std::fs::write(&file, "x").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert_eq!(read(&link, 1).unwrap(), b"x");
        assert_eq!(read_state(&file, 1).unwrap(), b"x");
        assert!(read_state(&link, 1).unwrap_err().to_string().contains("symbolic link"));
        for path in [pipe.as_path(), Path::new("/dev/zero"), folder.path()] {
            for read in [read, read_state] {
                let error = read(path, 100).unwrap_err().to_string();
                assert!(error.starts_with("expected a regular file, got a "), "{error}");
            }
        }
        assert!(read(&file, 0).unwrap_err().to_string().contains("larger than 0 bytes"));
        assert_eq!(read(Path::new("/proc/self/stat"), 1).unwrap_err().kind(), ErrorKind::FileTooLarge);
    }

    #[test]
    fn a_text_that_is_not_utf8_is_refused_with_its_line() {
        let error = utf8(b"a\nb\n\xff".to_vec()).unwrap_err().to_string();
        assert_eq!(error, "line 3 is not UTF-8");
    }
}
