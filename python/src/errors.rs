use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

create_exception!(
    energy_dsl,
    EnergyError,
    PyValueError,
    "A text, a scene or a rest shape that is wrong, with its place."
);

create_exception!(
    energy_dsl,
    FolderInUseError,
    EnergyError,
    "The output folder belongs to another process that still runs."
);

create_exception!(
    energy_dsl,
    ResourceError,
    PyRuntimeError,
    "A run that the machine prevents, not its scene: a file cannot be written, or memory is short."
);

/// Turns any error into a `ValueError` of the package.
pub fn wrong(error: impl std::fmt::Display) -> PyErr {
    EnergyError::new_err(error.to_string())
}

/// Turns any error, with its causes, into a `RuntimeError`.
pub fn failed(error: impl std::error::Error) -> PyErr {
    PyRuntimeError::new_err(with_causes(&error))
}

/// Returns the message of an error, followed by those of its causes.
pub fn with_causes(error: &dyn std::error::Error) -> String {
    let mut message = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        let cause_text = cause.to_string();
        if !message.contains(&cause_text) {
            message = format!("{message}: {cause_text}");
        }
        source = cause.source();
    }
    message
}
