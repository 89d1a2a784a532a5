//! Objects that one thread at a time may use.

use std::sync::{Mutex, MutexGuard, TryLockError};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// A value that belongs to the call that uses it. Long calls release the interpreter's lock, so another thread may
/// call in between; it gets an exception instead of waiting.
pub struct Exclusive<T> {
    name: &'static str,
    value: Mutex<T>,
}

impl<T> Exclusive<T> {
    /// Guards a value; `name` is the class, for messages.
    pub fn new(name: &'static str, value: T) -> Self {
        Self { name, value: Mutex::new(value) }
    }

    /// Returns the value, unless another call uses it.
    pub fn get(&self) -> PyResult<MutexGuard<'_, T>> {
        let name = self.name;
        self.value.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => {
                let help = "expected one thread at a time; make one for each thread, or share a lock";
                PyRuntimeError::new_err(format!("this {name} is in use by another thread: {help}"))
            }
            TryLockError::Poisoned(_) => {
                PyRuntimeError::new_err(format!("an earlier call broke this {name}; make a new one"))
            }
        })
    }
}
