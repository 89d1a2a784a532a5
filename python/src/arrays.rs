//! Arrays in and out: conversions, and messages that say what was expected.

use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// A contiguous array of doubles. Other arrays and lists are copied.
pub fn doubles<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    if let Ok(array) = value.cast::<PyArrayDyn<f64>>()
        && array.is_c_contiguous()
    {
        return array.try_readonly().map_err(|_| PyValueError::new_err(format!("{name} is being written to")));
    }
    let options = PyDict::new(value.py());
    options.set_item("dtype", "f8")?;
    options.set_item("order", "C")?;
    let array = value.py().import("numpy")?.call_method("asarray", (value,), Some(&options)).map_err(|_| {
        let found = value.get_type().name().map_or_else(|_| "another type".into(), |name| name.to_string());
        PyTypeError::new_err(format!("{name}: expected an array of numbers, got {found}"))
    })?;
    let array = array.cast_into::<PyArrayDyn<f64>>()?;
    Ok(array.readonly())
}

/// The numbers of an array, without NaN.
pub fn numbers<'a>(name: &str, array: &'a PyReadonlyArrayDyn<'_, f64>) -> PyResult<&'a [f64]> {
    let numbers = array.as_slice().expect("contiguous arrays only");
    match numbers.iter().position(|number| number.is_nan()) {
        Some(index) => Err(PyValueError::new_err(format!("{name}: entry {index} (flattened) is NaN"))),
        None => Ok(numbers),
    }
}

/// Returns the message for an array of the wrong shape.
pub fn wrong_shape(name: &str, expected: &str, found: &[usize]) -> PyErr {
    PyValueError::new_err(format!("{name}: expected shape {expected}, got {}", tuple(found)))
}

/// Writes a shape as Python does.
pub fn tuple(shape: &[usize]) -> String {
    match shape {
        [only] => format!("({only},)"),
        _ => format!("({})", shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// A result: its name for messages, and its shape.
pub struct Slot {
    pub name: &'static str,
    pub shape: Vec<usize>,
}

/// Returns the arrays to write to: those of `out`, or new ones.
pub fn outputs<'py>(
    py: Python<'py>,
    slots: &[Slot],
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Bound<'py, PyArrayDyn<f64>>>> {
    let Some(out) = out else {
        return Ok(slots.iter().map(|slot| PyArrayDyn::zeros(py, &slot.shape[..], false)).collect());
    };
    let given: Vec<Bound<'py, PyAny>> = match out.cast::<PyTuple>() {
        Ok(tuple) => tuple.iter().collect(),
        Err(_) => vec![out.clone()],
    };
    if given.len() != slots.len() {
        let names = slots.iter().map(|slot| slot.name).collect::<Vec<_>>().join(", ");
        return Err(PyValueError::new_err(format!(
            "out: expected {} arrays ({names}), got {}",
            slots.len(),
            given.len()
        )));
    }
    given.into_iter().zip(slots).map(|(array, slot)| output(array, slot)).collect()
}

fn output<'py>(array: Bound<'py, PyAny>, slot: &Slot) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let name = format!("out, {}", slot.name);
    let array = array
        .cast_into::<PyArrayDyn<f64>>()
        .map_err(|_| PyTypeError::new_err(format!("{name}: expected an array of dtype float64")))?;
    if array.shape() != slot.shape {
        return Err(wrong_shape(&name, &tuple(&slot.shape), array.shape()));
    }
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(format!("{name}: expected a C-contiguous array")));
    }
    Ok(array)
}

/// Borrows arrays for writing.
pub fn writable<'py>(arrays: &[Bound<'py, PyArrayDyn<f64>>]) -> PyResult<Vec<PyReadwriteArrayDyn<'py, f64>>> {
    let borrow = |array: &Bound<'py, PyArrayDyn<f64>>| {
        array.try_readwrite().map_err(|_| PyValueError::new_err("out: an array is read-only, or used twice"))
    };
    arrays.iter().map(borrow).collect()
}
