//! Signals that end a program early: Ctrl-C, a request to terminate, a closed terminal.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::{Context, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

#[cfg(unix)]
const ENDING: [i32; 3] = [SIGINT, SIGTERM, signal_hook::consts::SIGHUP];
#[cfg(not(unix))]
const ENDING: [i32; 2] = [SIGINT, SIGTERM];

/// Signals within this time of the first one repeat it: `timeout` sends one to the program and one to its group.
const REPEAT: Duration = Duration::from_secs(1);
/// The time between two looks at the flag of the first signal.
const LOOK: Duration = Duration::from_millis(50);

/// The signals that arrived so far.
#[derive(Debug, Default)]
pub struct Interrupts {
    stop: Arc<AtomicBool>,
    /// Whether the next signal exits at once.
    insists: Arc<AtomicBool>,
    last: Arc<AtomicUsize>,
}

impl Interrupts {
    /// Listens for signals. The first one sets the flag. One that comes later than a second after it exits at once.
    /// Signals that were ignored when the program started stay ignored, so that a program under `nohup` outlives its
    /// terminal.
    ///
    /// # Errors
    /// If the operating system does not let the program listen.
    pub fn listen() -> Result<Self> {
        let interrupts = Self::default();
        let ignored = ignored_at_start();
        for signal in ENDING.into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0) {
            interrupts.listen_for(signal).context("cannot listen for signals")?;
        }
        interrupts.await_repeats();
        Ok(interrupts)
    }

    fn listen_for(&self, signal: i32) -> std::io::Result<()> {
        flag::register_conditional_shutdown(signal, exit_status(signal).into(), Arc::clone(&self.insists))?;
        flag::register_usize(signal, Arc::clone(&self.last), signal as usize)?;
        flag::register(signal, Arc::clone(&self.stop)).map(|_| ())
    }

    /// Waits in the background for the first signal, and for its repeats to be over.
    fn await_repeats(&self) {
        let (stop, insists) = (Arc::clone(&self.stop), Arc::clone(&self.insists));
        std::thread::spawn(move || {
            while !stop.load(Ordering::Relaxed) {
                std::thread::sleep(LOOK);
            }
            std::thread::sleep(REPEAT);
            insists.store(true, Ordering::Relaxed);
        });
    }

    /// Whether a signal has arrived.
    #[must_use]
    pub fn flag(&self) -> &AtomicBool {
        &self.stop
    }

    /// The exit code of a program that a signal ended: 128 and the number of the signal, as shells report it.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(exit_status(self.last.load(Ordering::Relaxed) as i32))
    }
}

/// Turns a file that exceeds the limit of the process (`ulimit -f`) from a signal that ends the program into an error
/// of the write, which names the file.
///
/// # Errors
/// If the operating system does not let the program listen.
pub fn report_file_limits() -> Result<()> {
    #[cfg(unix)]
    flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).context("cannot listen for signals")?;
    Ok(())
}

fn exit_status(signal: i32) -> u8 {
    128 + signal as u8
}

/// Returns the set of ignored signals; bit n − 1 stands for signal n. Empty where the system has no `/proc`.
fn ignored_at_start() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
