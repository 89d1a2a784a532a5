//! Elements with bound inputs, evaluated in batches.

use energy_compiler::{Elements as Batch, InputKind};
use energy_dsl::Flagged;
use numpy::{PyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{Slot, doubles, numbers, outputs, tuple, writable, wrong_shape};
use crate::element::{Element, count};
use crate::errors::wrong;

/// Elements with bound rest shapes and parameters.
#[pyclass(frozen, module = "energy_dsl")]
pub struct Elements {
    pub inner: Batch<f64>,
    sizes: Sizes,
}

/// A routine of the elements.
#[derive(Clone, Copy)]
pub enum Call {
    Value,
    Gradient,
    Hessian,
    HessianVector,
    Force,
    ForceJacobians,
    Constraint,
    Residual,
    Jacobian,
}

#[pymethods]
impl Elements {
    fn __len__(&self) -> usize {
        self.inner.len()
    }

    /// The declaration.
    #[getter]
    fn element(&self) -> Element {
        Element { inner: self.inner.element().clone() }
    }

    fn __repr__(&self) -> String {
        format!("<{} elements of {}>", self.inner.len(), self.inner.element().declaration().name)
    }
}

impl Elements {
    pub fn new(inner: Batch<f64>) -> Self {
        let sizes = Sizes::of(&inner);
        Self { inner, sizes }
    }

    pub fn evaluate<'py>(
        &self,
        py: Python<'py>,
        call: Call,
        x: &PyReadonlyArrayDyn<'py, f64>,
        v: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        flags: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let sizes = &self.sizes;
        let name = if matches!(call, Call::Residual | Call::Jacobian) { "u" } else { "x" };
        let expected = sizes.input(call);
        if x.shape() != expected {
            return Err(wrong_shape(name, &tuple(&expected), x.shape()));
        }
        let v = v.map(|v| doubles("v", v)).transpose()?;
        if let Some(v) = v.as_ref().filter(|v| v.shape() != expected) {
            return Err(wrong_shape("v", &tuple(&expected), v.shape()));
        }
        let x = numbers(name, x)?;
        let v = v.as_ref().map(|v| numbers("v", v)).transpose()?.unwrap_or(&[]);
        let slots = sizes.slots(call);
        let arrays = outputs(py, &slots, out)?;
        let flagged = {
            let mut borrowed = writable(&arrays)?;
            let mut results: Vec<&mut [f64]> =
                borrowed.iter_mut().map(|array| array.as_slice_mut().expect("contiguous")).collect();
            py.detach(|| self.write(call, x, v, &mut results)).map_err(wrong)?
        };
        let mut list: Vec<Bound<'py, PyAny>> = arrays.into_iter().map(Bound::into_any).collect();
        if flags {
            let mut marks = vec![0_u8; self.inner.len()];
            for (index, flags) in flagged {
                marks[index] = u8::from(flags.degenerate) + 2 * u8::from(flags.kink);
            }
            list.push(PyArray1::from_vec(py, marks).into_any());
        }
        if list.len() == 1 { Ok(list.remove(0)) } else { Ok(PyTuple::new(py, list)?.into_any()) }
    }

    fn write(
        &self,
        call: Call,
        x: &[f64],
        v: &[f64],
        results: &mut [&mut [f64]],
    ) -> Result<Flagged, energy_compiler::EvaluateError> {
        let (all, elements) = (0..self.inner.len(), &self.inner);
        match (call, results) {
            (Call::Value, [u]) => elements.values(all, x, u),
            (Call::Gradient, [u, g]) => elements.gradients(all, x, u, g),
            (Call::Hessian, [u, g, h]) => elements.hessians(all, x, u, g, h),
            (Call::HessianVector, [product]) => elements.hessian_vectors(all, x, v, product),
            (Call::Force, [f]) => elements.forces(all, x, v, f),
            (Call::ForceJacobians, [f, by_x, by_v]) => elements.force_jacobians(all, x, v, f, by_x, by_v),
            (Call::Constraint, [c, j]) => elements.constraints(all, x, c, j),
            (Call::Residual, [r]) => elements.residuals(all, x, r),
            (Call::Jacobian, [r, j]) => elements.jacobians(all, x, r, j),
            _ => unreachable!("as many slots as results"),
        }
    }
}

/// Sizes of the arrays of one batch.
struct Sizes {
    count: usize,
    points: usize,
    rows: usize,
    unknowns: usize,
}

impl Sizes {
    fn of(elements: &Batch<f64>) -> Self {
        let element = elements.element();
        let (points, unknowns) = (count(element, InputKind::Point) / 3, count(element, InputKind::Unknown));
        Self { count: elements.len(), points, rows: element.declaration().rows, unknowns }
    }

    fn input(&self, call: Call) -> Vec<usize> {
        match call {
            Call::Residual | Call::Jacobian => vec![self.count, self.unknowns],
            _ => vec![self.count, self.points, 3],
        }
    }

    fn slots(&self, call: Call) -> Vec<Slot> {
        let (n, p, rows) = (self.count, self.points, self.rows);
        let slot = |name, shape: &[usize]| Slot { name, shape: shape.to_vec() };
        let matrix = [n, 3 * p, 3 * p];
        match call {
            Call::Value => vec![slot("U", &[n])],
            Call::Gradient => vec![slot("U", &[n]), slot("gradient", &[n, p, 3])],
            Call::Hessian => vec![slot("U", &[n]), slot("gradient", &[n, p, 3]), slot("Hessian", &matrix)],
            Call::HessianVector => vec![slot("product", &[n, p, 3])],
            Call::Force => vec![slot("force", &[n, p, 3])],
            Call::ForceJacobians => vec![slot("force", &[n, p, 3]), slot("∂f/∂x", &matrix), slot("∂f/∂v", &matrix)],
            Call::Constraint => vec![slot("C", &[n, rows]), slot("Jacobian", &[n, rows, 3 * p])],
            Call::Residual => vec![slot("residual", &[n, rows])],
            Call::Jacobian => vec![slot("residual", &[n, rows]), slot("Jacobian", &[n, rows, self.unknowns])],
        }
    }
}
