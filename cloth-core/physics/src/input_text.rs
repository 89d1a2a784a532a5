//! Reads input files of limited size.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Reads a whole file of at most `limit` bytes, which may be a pipe.
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let mut contents = Vec::new();
    File::open(path)?.take(limit + 1).read_to_end(&mut contents)?;
    match contents.len() as u64 > limit {
        true => Err(Error::new(ErrorKind::FileTooLarge, format!("it is larger than {} MiB", limit >> 20))),
        false => Ok(contents),
    }
}

/// Reads a regular file of at most `limit` bytes. A pipe or device might never end.
pub(crate) fn read_regular(path: &Path, limit: u64) -> Result<Vec<u8>> {
    if !path.metadata()?.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
    }
    read(path, limit)
}

/// Returns the text of a file, which must be UTF-8.
pub fn utf8(contents: Vec<u8>) -> Result<String> {
    String::from_utf8(contents).map_err(|error| {
        let line =
            error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&byte| byte == b'\n').count() + 1;
        Error::new(ErrorKind::InvalidData, format!("line {line} is not UTF-8"))
    })
}
