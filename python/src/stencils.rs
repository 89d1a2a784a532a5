//! The vertices of elements, from lists or arrays.

use numpy::{PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::wrong_shape;

/// Returns the vertices of one element after the other. Each row names `points` different ones of `vertices`.
pub fn stencils_of(stencils: &Bound<'_, PyAny>, points: usize, vertices: usize) -> PyResult<Vec<u32>> {
    let flat: Vec<i64> = match array_of(stencils, points)? {
        Some(flat) => flat,
        None => rows_of(stencils, points)?,
    };
    let py = stencils.py();
    py.detach(|| checked(&flat, points, vertices)).map_err(PyValueError::new_err)
}

/// Returns the numbers of a two-dimensional array of integers with `points` columns; `None` for anything that is not an
/// array.
fn array_of(stencils: &Bound<'_, PyAny>, points: usize) -> PyResult<Option<Vec<i64>>> {
    let Ok(array) = stencils.cast::<PyUntypedArray>() else { return Ok(None) };
    if !b"iu".contains(&array.dtype().kind()) {
        let message = format!("stencils: expected integers, got an array of dtype {}", array.dtype());
        return Err(PyTypeError::new_err(message));
    }
    match array.shape() {
        &[_, columns] if columns == points => {}
        &[rows, columns] if rows > 0 => {
            let message = format!("stencils: row 0 has {columns} vertices; expected {points}");
            return Err(PyValueError::new_err(message));
        }
        &[0, ..] => return Ok(Some(Vec::new())),
        shape => return Err(wrong_shape("stencils", &format!("(n, {points})"), shape)),
    }
    let numbers = array.call_method1("astype", ("int64", "C"))?.cast_into::<PyArrayDyn<i64>>()?;
    let numbers = numbers.readonly();
    Ok(Some(numbers.as_slice().expect("in C order").to_vec()))
}

/// Returns the numbers of lists of equal length.
fn rows_of(stencils: &Bound<'_, PyAny>, points: usize) -> PyResult<Vec<i64>> {
    let rows: Vec<Vec<i64>> = stencils.extract()?;
    for (row, stencil) in rows.iter().enumerate() {
        if stencil.len() != points {
            let message = format!("stencils: row {row} has {} vertices; expected {points}", stencil.len());
            return Err(PyValueError::new_err(message));
        }
    }
    Ok(rows.into_iter().flatten().collect())
}

fn checked(flat: &[i64], points: usize, vertices: usize) -> Result<Vec<u32>, String> {
    let mut checked = Vec::with_capacity(flat.len());
    for (row, stencil) in flat.chunks_exact(points.max(1)).enumerate() {
        for (place, &vertex) in stencil.iter().enumerate() {
            match u32::try_from(vertex) {
                Ok(index) if (index as usize) < vertices => checked.push(index),
                _ => {
                    let message = format!("names vertex {vertex}, but there are only {vertices} vertices");
                    return Err(format!("stencils: row {row} {message}"));
                }
            }
            if stencil[..place].contains(&vertex) {
                return Err(format!("stencils: row {row} names vertex {vertex} twice"));
            }
        }
    }
    Ok(checked)
}
