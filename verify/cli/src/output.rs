use std::io::{ErrorKind, Write};

use anyhow::{Context, Result};
use energy_files::printable;

/// Prints a text to standard output, without control characters. A closed pipe (`| head`) is not an error.
///
/// # Errors
/// If the text cannot be written, as to a full disk.
pub fn print(text: &str) -> Result<()> {
    let mut output = std::io::stdout().lock();
    match output.write_all(printable(text).as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("cannot print"),
        _ => Ok(()),
    }
}

/// Prints a line to standard error, without control characters. Nobody is left to be told if that fails.
pub fn tell(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", printable(line));
}
