//! Arrays in and out: conversions, and messages that say what was expected.

use std::ops::Deref;

use numpy::{
    PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt, PyTuple};

/// A precision that elements are evaluated in.
pub trait Precision: crate::compiled::Scalar + numpy::Element + PartialOrd {
    /// Name of the dtype.
    const DTYPE: &'static str;
}

impl Precision for f64 {
    const DTYPE: &'static str = "float64";
}

impl Precision for f32 {
    const DTYPE: &'static str = "float32";
}

/// Returns a contiguous array of a precision. Other arrays, numbers and lists are converted.
pub fn array<'py, S: Precision>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, S>> {
    if let Ok(array) = value.cast::<PyArrayDyn<S>>()
        && array.is_c_contiguous()
    {
        return array.try_readonly().map_err(|_| PyValueError::new_err(format!("{name} is being written to")));
    }
    let refused = |found: String| PyTypeError::new_err(format!("{name}: expected an array of numbers, got {found}"));
    let other = || value.get_type().name().map_or_else(|_| "another type".to_owned(), |name| name.to_string());
    let given = value.py().import("numpy")?.call_method1("asarray", (value,)).map_err(|_| refused(other()))?;
    let dtype = given.cast::<PyUntypedArray>()?.dtype();
    // Booleans, integers, floating-point numbers.
    if !b"biuf".contains(&dtype.kind()) {
        return Err(refused(format!("dtype {dtype}")));
    }
    let order = PyDict::new(value.py());
    order.set_item("order", "C")?;
    let array = given.call_method("astype", (S::DTYPE,), Some(&order))?;
    Ok(array.cast_into::<PyArrayDyn<S>>()?.readonly())
}

/// Returns the numbers of an array; refuses NaN.
pub fn numbers<'a, S: Precision>(name: &str, array: &'a PyReadonlyArrayDyn<'_, S>) -> PyResult<&'a [S]> {
    without_nan(name, array.as_slice().expect("contiguous arrays only"))
}

fn without_nan<'a, S: Precision>(name: &str, numbers: &'a [S]) -> PyResult<&'a [S]> {
    match first_nan(numbers) {
        Some(index) => Err(PyValueError::new_err(format!("{name}: entry {index} (flattened) is NaN"))),
        None => Ok(numbers),
    }
}

/// The numbers that an input is bound to.
pub enum Given<'py, S: Precision> {
    /// A number of Python. As an array it would take longer than an evaluation.
    Number([S; 1]),
    Array(PyReadonlyArrayDyn<'py, S>),
}

impl<'py, S: Precision> Given<'py, S> {
    pub fn new(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        if value.cast::<PyFloat>().is_ok() || value.cast::<PyInt>().is_ok() {
            return Ok(Self::Number([S::from_f64(value.extract()?)]));
        }
        array(name, value).map(Self::Array)
    }

    /// Returns the numbers; refuses NaN.
    pub fn numbers(&self, name: &str) -> PyResult<&[S]> {
        match self {
            Self::Number(number) => without_nan(name, number),
            Self::Array(array) => numbers(name, array),
        }
    }

    pub fn shape(&self) -> &[usize] {
        match self {
            Self::Number(_) => &[],
            Self::Array(array) => array.shape(),
        }
    }
}

/// Returns the index of the first NaN. Whole chunks are tested without branches, which compilers turn into SIMD code.
fn first_nan<S: Precision>(numbers: &[S]) -> Option<usize> {
    let is_nan = |number: &S| number.partial_cmp(number).is_none();
    let chunk = numbers.chunks(64).position(|chunk| chunk.iter().fold(false, |found, x| found | is_nan(x)))?;
    numbers[64 * chunk..].iter().position(is_nan).map(|index| 64 * chunk + index)
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

/// A shape of at most three dimensions, without an allocation.
#[derive(Clone, Copy)]
pub struct Shape {
    lengths: [usize; 3],
    rank: usize,
}

impl<const N: usize> From<[usize; N]> for Shape {
    fn from(lengths: [usize; N]) -> Self {
        Self { lengths: std::array::from_fn(|i| lengths.get(i).copied().unwrap_or(0)), rank: N }
    }
}

impl Deref for Shape {
    type Target = [usize];

    fn deref(&self) -> &[usize] {
        &self.lengths[..self.rank]
    }
}

/// A result: its name for messages, and its shape.
#[derive(Clone, Copy)]
pub struct Slot {
    pub name: &'static str,
    pub shape: Shape,
}

/// Returns the arrays to write to: those of `out`, or new ones.
pub fn outputs<'py, S: Precision>(
    py: Python<'py>,
    slots: &[Slot],
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Bound<'py, PyArrayDyn<S>>>> {
    let Some(out) = out else {
        return Ok(slots.iter().map(|slot| PyArrayDyn::zeros(py, &slot.shape[..], false)).collect());
    };
    let wrong_count = |given: usize| {
        let names = slots.iter().map(|slot| slot.name).collect::<Vec<_>>().join(", ");
        PyValueError::new_err(format!("out: expected {} arrays ({names}), got {given}", slots.len()))
    };
    match out.cast::<PyTuple>() {
        Ok(tuple) if tuple.len() == slots.len() => {
            tuple.iter().zip(slots).map(|(array, slot)| output(array, slot)).collect()
        }
        Ok(tuple) => Err(wrong_count(tuple.len())),
        Err(_) if slots.len() == 1 => Ok(vec![output(out.clone(), &slots[0])?]),
        Err(_) => Err(wrong_count(1)),
    }
}

fn output<'py, S: Precision>(array: Bound<'py, PyAny>, slot: &Slot) -> PyResult<Bound<'py, PyArrayDyn<S>>> {
    let name = slot.name;
    let array = array.cast_into::<PyArrayDyn<S>>().map_err(|error| {
        let found = match error.into_inner().cast::<PyUntypedArray>() {
            Ok(array) => format!("dtype {}", array.dtype()),
            Err(_) => "another type".to_owned(),
        };
        PyTypeError::new_err(format!("out, {name}: expected an array of dtype {}, got {found}", S::DTYPE))
    })?;
    if array.shape() != &slot.shape[..] {
        return Err(wrong_shape(&format!("out, {name}"), &tuple(&slot.shape), array.shape()));
    }
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(format!("out, {name}: expected a C-contiguous array")));
    }
    Ok(array)
}

/// Borrows arrays for writing.
pub fn writable<'py, S: Precision>(arrays: &[Bound<'py, PyArrayDyn<S>>]) -> PyResult<Vec<PyReadwriteArrayDyn<'py, S>>> {
    let borrow = |array: &Bound<'py, PyArrayDyn<S>>| {
        array.try_readwrite().map_err(|_| PyValueError::new_err("out: an array is read-only, or used twice"))
    };
    arrays.iter().map(borrow).collect()
}
