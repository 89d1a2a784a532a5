//! States of programs with a version and a checksum.
//!
//! A sealed file is a line of text, `keyword version length checksum`, and then the contents. The checksum is a CRC-32:
//! it finds damage, not forgery. Two generations are kept: if the newer one is damaged or missing, the older one is
//! still whole.

use std::ffi::OsString;
use std::fmt;
use std::io::{ErrorKind, Result};
use std::path::{Path, PathBuf};

use crate::write::{rename, sync_folder, write_whole};

/// Kind and version of sealed files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// The first word of a file.
    pub keyword: &'static str,
    /// The version that the program reads and writes.
    pub version: u32,
}

/// Contents that cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SealError {
    /// The file is of another kind.
    Foreign,
    /// The file has another version, which is part of the error.
    OtherVersion(u32),
    /// The file is damaged.
    Damaged(&'static str),
}

impl fmt::Display for SealError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Foreign => f.write_str("it is another kind of file"),
            Self::OtherVersion(version) => write!(f, "it has version {version}, which this program cannot read"),
            Self::Damaged(reason) => f.write_str(reason),
        }
    }
}

impl std::error::Error for SealError {}

impl Seal {
    /// Returns sealed contents.
    ///
    /// ```
    /// use energy_files::sealed::{Seal, SealError};
    /// let seal = Seal { keyword: "state", version: 1 };
    /// let file = seal.close(b"42");
    /// assert_eq!(seal.open(&file), Ok(&b"42"[..]));
    /// assert_eq!(seal.open(&file[..file.len() - 1]), Err(SealError::Damaged("it is cut short")));
    /// ```
    #[must_use]
    pub fn close(self, contents: &[u8]) -> Vec<u8> {
        let Self { keyword, version } = self;
        let checksum = crc32fast::hash(contents);
        let mut file = format!("{keyword} {version} {} {checksum:08x}\n", contents.len()).into_bytes();
        file.extend(contents);
        file
    }

    /// Returns the contents of a sealed file.
    ///
    /// # Errors
    /// If the file is of another kind or version, or is damaged.
    pub fn open(self, file: &[u8]) -> std::result::Result<&[u8], SealError> {
        let end = file.iter().position(|&byte| byte == b'\n').unwrap_or(file.len());
        let head = std::str::from_utf8(&file[..end]).map_err(|_| SealError::Foreign)?;
        let mut words = head.split(' ');
        if words.next() != Some(self.keyword) {
            return Err(SealError::Foreign);
        }
        let version = words.next().and_then(|word| word.parse().ok());
        let version: u32 = version.ok_or(SealError::Damaged("its first line is broken"))?;
        if version != self.version {
            return Err(SealError::OtherVersion(version));
        }
        let (length, checksum) = (words.next(), words.next());
        let contents = file.get(end + 1..).unwrap_or_default();
        if length.and_then(|word| word.parse().ok()) != Some(contents.len()) {
            return Err(SealError::Damaged("it is cut short"));
        }
        if checksum.and_then(|word| u32::from_str_radix(word, 16).ok()) != Some(crc32fast::hash(contents)) {
            return Err(SealError::Damaged("its checksum does not match"));
        }
        Ok(contents)
    }
}

/// Path of the older generation of a file.
#[must_use]
pub fn previous(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(OsString::from(".previous"));
    name.into()
}

/// Writes a file, and keeps the one that it replaces as the older generation.
///
/// # Errors
/// If a file cannot be written.
pub fn write_generation(path: &Path, file: &[u8]) -> Result<()> {
    match rename(path, &previous(path)) {
        Ok(()) => sync_folder(path)?,
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    write_whole(path, file)
}

/// Puts the older generation in the place of the newer one, which is damaged: the next write then keeps it.
///
/// # Errors
/// If a file cannot be renamed.
pub fn restore_generation(path: &Path) -> Result<()> {
    rename(&previous(path), path)?;
    sync_folder(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cut_and_every_changed_byte_is_found() {
        let seal = Seal { keyword: "state", version: 3 };
        let file = seal.close(b"{\"numbers\": [1, 2, 3]}");
        assert_eq!(seal.open(&file).unwrap(), b"{\"numbers\": [1, 2, 3]}");
        for at in 0..file.len() {
            assert!(seal.open(&file[..at]).is_err(), "cut at {at}");
            for bit in 0..8 {
                let mut changed = file.clone();
                changed[at] ^= 1 << bit;
                // Upper-case digits of the checksum are the same number.
                let same_number = changed.eq_ignore_ascii_case(&file);
                assert!(same_number || seal.open(&changed).is_err(), "bit {bit} of byte {at}");
            }
        }
        let newer = Seal { version: 4, ..seal };
        assert_eq!(newer.open(&file), Err(SealError::OtherVersion(3)));
    }

    #[test]
    fn a_write_keeps_the_generation_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        for text in ["first", "second", "third"] {
            write_generation(&path, text.as_bytes()).unwrap();
        }
        assert_eq!(std::fs::read(&path).unwrap(), b"third");
        assert_eq!(std::fs::read(previous(&path)).unwrap(), b"second");
        restore_generation(&path).unwrap();
        write_generation(&path, b"fourth").unwrap();
        assert_eq!(std::fs::read(previous(&path)).unwrap(), b"second");
    }
}
