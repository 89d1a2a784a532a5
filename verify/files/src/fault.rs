//! Injected failures, for tests of whole programs.
//!
//! In builds with debug assertions, the environment variable `ENERGY_FAULT` names an operation on a file that is
//! written, counted from 1: `fail:12` makes it fail, `full:12` also makes all later ones fail, as a full disk does, and
//! `kill:12` ends the program there. An operation creates, extends, cuts, syncs, renames, locks or removes a file or
//! creates a folder. A write is done by half.

use std::fs::File;
use std::io::{ErrorKind, Result, Write};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    Fail,
    Full,
    Kill,
}

/// The fault and its operation; `None` in ordinary programs.
static PLANNED: LazyLock<Option<(Fault, u64)>> = LazyLock::new(|| {
    let text = std::env::var("ENERGY_FAULT").ok()?;
    let (fault, at) = text.split_once(':')?;
    let fault = match fault {
        "fail" => Fault::Fail,
        "full" => Fault::Full,
        "kill" => Fault::Kill,
        _ => return None,
    };
    Some((fault, at.parse().ok()?))
});

/// Counts an operation, and returns the fault that strikes it.
fn struck() -> Option<Fault> {
    static OPERATIONS: AtomicU64 = AtomicU64::new(0);
    if !cfg!(debug_assertions) {
        return None;
    }
    let (fault, at) = (*PLANNED)?;
    let now = OPERATIONS.fetch_add(1, Ordering::Relaxed) + 1;
    (now == at || fault == Fault::Full && now > at).then_some(fault)
}

/// Says so on standard error: a test must know that the operation was reached.
fn strike<T>(fault: Fault) -> Result<T> {
    eprintln!("fault at operation {}", PLANNED.map_or(0, |(_, at)| at));
    match fault {
        // Like a kill: no destructor runs.
        Fault::Kill => std::process::exit(137),
        Fault::Fail | Fault::Full => Err(ErrorKind::StorageFull.into()),
    }
}

/// Precedes each operation but writes.
pub(crate) fn operation() -> Result<()> {
    struck().map_or(Ok(()), strike)
}

/// Writes to a file.
pub(crate) fn write(file: &mut File, bytes: &[u8]) -> Result<usize> {
    match struck() {
        None => file.write(bytes),
        Some(fault) => file.write_all(&bytes[..bytes.len() / 2]).and_then(|()| strike(fault)),
    }
}
