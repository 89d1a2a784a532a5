//! A word about work that takes longer than a moment.

use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::time::Duration;

use super::tell;

/// A time after which users wonder whether a program still works.
const PATIENCE: Duration = Duration::from_secs(1);

/// Tells on standard error what a program does, unless it is dropped within a second.
#[derive(Debug)]
#[must_use]
pub struct Notice {
    /// Dropped when the work is done.
    _done: Sender<()>,
}

impl Notice {
    /// Starts to wait.
    pub fn of(work: impl Into<String>) -> Self {
        let (done, ended) = mpsc::channel::<()>();
        let work = work.into();
        std::thread::spawn(move || {
            if ended.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                tell(&work);
            }
        });
        Self { _done: done }
    }
}
