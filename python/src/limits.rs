//! Limits of the compiler that a caller raises.

use energy_compiler::Limits;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyMapping};

/// The largest limit: integers up to here are exact as floats.
const LARGEST: f64 = 9_007_199_254_740_992.0;

/// Returns the limits of a mapping from `steps` and `bytes` to numbers. Those that it does not name are the defaults.
pub fn limits_of(given: Option<&Bound<'_, PyAny>>) -> PyResult<Limits> {
    let mut limits = Limits::default();
    let Some(given) = given else { return Ok(limits) };
    let Ok(mapping) = given.cast::<PyMapping>() else {
        let message =
            format!("limits: expected a mapping such as {{\"steps\": 1e9}}, got {}", given.get_type().name()?);
        return Err(PyTypeError::new_err(message));
    };
    for item in mapping.items()? {
        let (name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let limit = match name.extract::<&str>() {
            Ok("steps") => &mut limits.steps,
            Ok("bytes") => &mut limits.bytes,
            _ => {
                let message = format!("limits: no limit {}; expected \"steps\" or \"bytes\"", name.repr()?);
                return Err(PyValueError::new_err(message));
            }
        };
        *limit = number(&name.to_string(), &value)?;
    }
    Ok(limits)
}

fn number(name: &str, value: &Bound<'_, PyAny>) -> PyResult<u64> {
    let expected = |got: String| format!("limits: {name}: expected a number from 1 to 2**53, got {got}");
    // Integers without a float raise an OverflowError.
    let number = match value.extract::<f64>() {
        Ok(number) if !value.is_instance_of::<PyBool>() => number,
        Err(error) if !error.is_instance_of::<PyTypeError>(value.py()) => f64::INFINITY,
        _ => return Err(PyTypeError::new_err(expected(value.get_type().name()?.to_string()))),
    };
    if (1.0..=LARGEST).contains(&number) {
        return Ok(number as u64);
    }
    // Python refuses to write integers of more than 4,300 digits.
    let shown = value.str().map_or_else(|_| "a larger one".to_owned(), |shown| shown.to_string());
    Err(PyValueError::new_err(expected(shown.chars().take(30).collect())))
}
