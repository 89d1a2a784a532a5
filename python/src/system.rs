//! Sums of elements over the vertices of a mesh.

use std::sync::MutexGuard;

use energy_dsl::{Kind, Vector3};
use energy_solve::{
    BlockMatrix, Bsr, Curvature, EvaluationError, LinearisationOptions, State, Storage, System as Assembled,
    SystemError, TapeTerm, Term, Weights,
};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, numbers, tuple, wrong_shape};
use crate::element::Element;
use crate::errors::{failed, wrong};
use crate::exclusive::Exclusive;

/// A sum of energies over vertices. Some may be pinned: they have no rows in the matrix.
#[pyclass(frozen, subclass, module = "energy_dsl._energy")]
pub struct System {
    pinned: Vec<bool>,
    state: Exclusive<Assembly>,
}

struct Assembly {
    /// Terms, as they were added.
    terms: Vec<TapeTerm>,
    /// Their sum, with its matrix; made when it is first needed.
    sum: Option<(Assembled, BlockMatrix)>,
}

/// U, ∂U/∂x and the matrix: offsets, columns and blocks.
type Linearised<'py> = (
    f64,
    Bound<'py, PyArrayDyn<f64>>,
    (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArrayDyn<f64>>),
);

#[pymethods]
impl System {
    #[new]
    #[pyo3(signature = (vertices, pinned = None))]
    fn new(vertices: usize, pinned: Option<Vec<usize>>) -> PyResult<Self> {
        let mut mask = vec![false; vertices];
        for vertex in pinned.into_iter().flatten() {
            let message = format!("pinned: there is no vertex {vertex}, only 0 to {}", vertices.saturating_sub(1));
            *mask.get_mut(vertex).ok_or_else(|| PyValueError::new_err(message))? = true;
        }
        Ok(Self { pinned: mask, state: Exclusive::new("System", Assembly { terms: Vec::new(), sum: None }) })
    }

    #[getter]
    fn vertices(&self) -> usize {
        self.pinned.len()
    }

    /// The vertices that are not pinned: those that have rows in the matrix.
    #[getter]
    fn free(&self) -> Vec<usize> {
        (0..self.pinned.len()).filter(|&vertex| !self.pinned[vertex]).collect()
    }

    /// Adds an element for each row of `stencils`, which names the vertices of its points.
    #[pyo3(signature = (element, stencils, **inputs))]
    fn add(&self, element: &Element, stencils: Vec<Vec<usize>>, inputs: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
        let (declaration, points) = (element.inner.declaration(), element.point_count());
        if !matches!(declaration.kind, Kind::Energy | Kind::Constraint) {
            let kind = declaration.kind.keyword();
            let message = format!("{}: a system sums energies, but this is a {kind}", declaration.name);
            return Err(PyTypeError::new_err(message));
        }
        for (row, stencil) in stencils.iter().enumerate() {
            if stencil.len() != points {
                let message = format!("stencils: row {row} has {} vertices; expected {points}", stencil.len());
                return Err(PyValueError::new_err(message));
            }
            if let Some(vertex) = stencil.iter().find(|&&vertex| vertex >= self.pinned.len()) {
                let count = self.pinned.len();
                let message = format!("stencils: row {row} names vertex {vertex}, but there are only {count} vertices");
                return Err(PyValueError::new_err(message));
            }
            if let Some(vertex) = (1..points).map(|i| stencil[i]).zip(0..).find(|(v, i)| stencil[..=*i].contains(v)) {
                let message = format!("stencils: row {row} names vertex {} twice", vertex.0);
                return Err(PyValueError::new_err(message));
            }
        }
        let bound = element.tapes::<f64>(stencils.len(), inputs)?;
        let mut state = self.state()?;
        let name = format!("{} {}", declaration.name, state.terms.len() + 1);
        state.terms.push(TapeTerm::new(name, declaration, bound.tape().clone(), stencils.into_iter().flatten()));
        state.sum = None;
        Ok(())
    }

    /// Returns U.
    fn energy(&self, x: &Bound<'_, PyAny>) -> PyResult<f64> {
        let (py, positions, mut state) = (x.py(), self.positions(x)?, self.state()?);
        let state = &mut *state;
        py.detach(|| state.energy(&self.pinned, &positions)).map_err(PyErr::from)
    }

    /// Returns U, ∂U/∂x, and ∂²U/∂x² of the free vertices as (offsets, columns, blocks). Elements whose vertices are
    /// all pinned are left out: they are constant. With `curvature`
    /// "clamped" or "absolute", each element's Hessian is made positive semi-definite first.
    #[pyo3(signature = (x, curvature = "exact"))]
    fn linearise_blocks<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        curvature: &str,
    ) -> PyResult<Linearised<'py>> {
        let curvature = match curvature {
            "exact" => Curvature::Exact,
            "clamped" => Curvature::Clamped,
            "absolute" => Curvature::Absolute,
            other => {
                let message = format!("curvature: expected \"exact\", \"clamped\" or \"absolute\", got {other:?}");
                return Err(PyValueError::new_err(message));
            }
        };
        let (positions, mut state) = (self.positions(x)?, self.state()?);
        let state = &mut *state;
        let linearised = py.detach(|| state.linearise(&self.pinned, &positions, curvature));
        let (energy, gradient, matrix) = linearised.map_err(PyErr::from)?;
        let gradient = PyArray1::from_vec(py, gradient).reshape([positions.len(), 3])?.to_dyn().clone();
        let indices = |list: Vec<usize>| PyArray1::from_vec(py, list.into_iter().map(|i| i as i64).collect());
        let blocks = matrix.blocks.len();
        let numbers: Vec<f64> = matrix.blocks.into_iter().flatten().flatten().collect();
        let numbers = PyArray1::from_vec(py, numbers).reshape([blocks, 3, 3])?.to_dyn().clone();
        Ok((energy, gradient, (indices(matrix.offsets), indices(matrix.columns), numbers)))
    }
}

impl System {
    fn state(&self) -> PyResult<MutexGuard<'_, Assembly>> {
        self.state.get()
    }

    fn positions(&self, x: &Bound<'_, PyAny>) -> PyResult<Vec<Vector3<f64>>> {
        let array: PyReadonlyArrayDyn<'_, f64> = array("x", x)?;
        let expected = [self.pinned.len(), 3];
        if array.shape() != expected {
            return Err(wrong_shape("x", &tuple(&expected), array.shape()));
        }
        Ok(numbers("x", &array)?.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect())
    }
}

/// Why a sum cannot be evaluated. It becomes an exception once the interpreter's lock is held.
enum Failure {
    System(SystemError),
    Evaluation(EvaluationError),
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::System(error) => wrong(error),
            Failure::Evaluation(error) => failed(error),
        }
    }
}

impl Assembly {
    fn sum(&mut self, pinned: &[bool]) -> Result<&mut (Assembled, BlockMatrix), Failure> {
        let sum = match self.sum.take() {
            Some(sum) => sum,
            None => {
                let terms = self.terms.iter().map(|term| Box::new(term.clone()) as Box<dyn Term>).collect();
                let sum = Assembled::new(terms, pinned).map_err(Failure::System)?;
                let matrix = sum.matrix();
                (sum, matrix)
            }
        };
        Ok(self.sum.insert(sum))
    }

    fn energy(&mut self, pinned: &[bool], x: &[Vector3<f64>]) -> Result<f64, Failure> {
        total(&mut self.sum(pinned)?.0, x)
    }

    /// Returns U, ∂U/∂x and the matrix.
    fn linearise(
        &mut self,
        pinned: &[bool],
        x: &[Vector3<f64>],
        curvature: Curvature,
    ) -> Result<(f64, Vec<f64>, Bsr<f64>), Failure> {
        let (sum, matrix) = self.sum(pinned)?;
        let v = vec![[0.0; 3]; x.len()];
        let options = LinearisationOptions {
            weights: Weights { position: -1.0, velocity: 0.0 },
            curvature,
            stiffness_times_velocity: false,
        };
        let forces = sum.linearise(State { x, v: &v }, options, matrix).map_err(Failure::Evaluation)?;
        let gradient = forces.force.iter().flatten().map(|f| -f).collect();
        let energy = total(sum, x)?;
        let (_, matrix) = self.sum(pinned)?;
        Ok((energy, gradient, matrix.to_bsr(Storage::Whole)))
    }
}

fn total(sum: &mut Assembled, x: &[Vector3<f64>]) -> Result<f64, Failure> {
    Ok(sum.energies(x).map_err(Failure::Evaluation)?.iter().filter_map(|term| term.energy).sum())
}
