//! Ends compilations at Ctrl-C.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use energy_compiler::{Budget, Diagnostics, Limits};
use pyo3::prelude::*;

use crate::errors::wrong;

/// The time between two looks at signals.
const LOOK: Duration = Duration::from_millis(50);

/// Compiles a text within limits and without holding the interpreter, and asks Python for signals meanwhile.
pub fn compiled<T: Send>(
    py: Python<'_>,
    limits: Limits,
    compile: impl FnOnce(&Budget) -> Result<T, Diagnostics> + Send,
) -> PyResult<T> {
    let raised: Arc<Mutex<Option<PyErr>>> = Arc::default();
    let (seen, last) = (Arc::clone(&raised), Mutex::new(Instant::now()));
    let budget = Budget::new(limits).watched_by(move |_| {
        let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() < LOOK {
            return ControlFlow::Continue(());
        }
        *last = Instant::now();
        match Python::attach(|py| py.check_signals()) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                *seen.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                ControlFlow::Break(())
            }
        }
    });
    let compiled = py.detach(|| compile(&budget).map_err(|errors| errors.to_string()));
    let raised = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
    raised.map_or_else(|| compiled.map_err(wrong), Err)
}
