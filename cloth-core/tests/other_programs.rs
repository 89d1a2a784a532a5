//! Programs of others that check files. Tests that need them are skipped where they are missing.

use std::path::Path;
use std::process::Command;

/// Runs a script of this folder, and returns what it prints; `None`, with the reason on standard error, if the program
/// or a package that the script needs is missing (exit status 77).
///
/// # Panics
/// If the script finds a fault.
pub fn ask(program: &str, script: &str, arguments: &[&Path]) -> Option<String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(script);
    let told = Command::new(program).arg(script).args(arguments).output();
    let told = told.map_err(|error| eprintln!("skipped: no {program} ({error})")).ok()?;
    let said = String::from_utf8_lossy(&told.stdout).into_owned();
    if told.status.code() == Some(77) {
        eprintln!("skipped: {said}");
        return None;
    }
    assert!(told.status.success(), "{said}{}", String::from_utf8_lossy(&told.stderr));
    Some(said)
}
