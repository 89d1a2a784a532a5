//! Elements with bound inputs, evaluated in batches.

use std::ops::Range;

use energy_compiler::{Elements as Tapes, EvaluateError, InputKind, Interpreted};
use energy_dsl::tape::TAPE_BLOCK;
use energy_dsl::{Flagged, Kind, RoutineKind};
use numpy::{PyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{Precision, Shape, Slot, array, numbers, outputs, tuple, writable, wrong_shape};
use crate::compiled::{CompiledBatch, bind};
use crate::element::{Element, Origin, count};
use crate::errors::wrong;

/// Results that are written without releasing the interpreter's lock: releasing it takes longer.
const FEW: usize = 2000;

/// Elements with bound rest shapes and parameters.
#[pyclass(frozen, module = "energy_dsl")]
pub struct Elements {
    batch: AnyBatch,
    origin: Origin,
    /// Copies of the inputs that were bound, for pickles; `None` for elements that no user holds.
    inputs: Option<Py<PyDict>>,
}

enum AnyBatch {
    Double(Batch<f64>),
    Single(Batch<f32>),
}

macro_rules! any {
    ($elements:expr, $batch:ident => $value:expr) => {
        match &$elements.batch {
            AnyBatch::Double($batch) => $value,
            AnyBatch::Single($batch) => $value,
        }
    };
}

#[pymethods]
impl Elements {
    fn __len__(&self) -> usize {
        any!(self, batch => batch.tapes.len())
    }

    /// Returns the declaration that was bound.
    #[getter]
    fn element(&self) -> Element {
        self.declared()
    }

    /// Name of the dtype that elements are evaluated in.
    #[getter]
    fn dtype(&self) -> &'static str {
        any!(self, batch => batch.dtype())
    }

    /// Whether compiled code evaluates energies, forces and residuals; else they run as tapes. Both return the same
    /// bits.
    #[getter]
    fn is_compiled(&self) -> bool {
        any!(self, batch => batch.parts.iter().all(|part| part.compiled.is_some()))
    }

    /// The most threads of one call.
    #[getter]
    fn threads(&self) -> usize {
        any!(self, batch => batch.threads)
    }

    /// Pickles hold the element and the inputs that were bound.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let bound = py.import("energy_dsl")?.getattr("_bound")?;
        let inputs = self.inputs.as_ref().map_or_else(|| PyDict::new(py), |inputs| inputs.bind(py).clone());
        let arguments = (self.declared(), self.__len__(), self.dtype(), self.threads(), inputs);
        Ok((bound, arguments.into_pyobject(py)?))
    }

    /// Bound elements do not change, so copies are the same object.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        any!(self, batch => format!("<{} elements of {}>", batch.tapes.len(), batch.tapes.element().declaration().name))
    }
}

impl Elements {
    /// Returns the declaration that was bound.
    pub fn declared(&self) -> Element {
        let inner = any!(self, batch => batch.tapes.element()).clone();
        Element::new(inner, self.origin.clone())
    }

    pub fn double(batch: Batch<f64>, origin: Origin) -> Self {
        Self { batch: AnyBatch::Double(batch), origin, inputs: None }
    }

    pub fn single(batch: Batch<f32>, origin: Origin) -> Self {
        Self { batch: AnyBatch::Single(batch), origin, inputs: None }
    }

    /// Keeps copies of the inputs, for pickles.
    pub fn with_inputs(self, inputs: Py<PyDict>) -> Self {
        Self { inputs: Some(inputs), ..self }
    }

    pub fn evaluate<'py>(&self, request: &Request<'_, 'py>) -> PyResult<Bound<'py, PyAny>> {
        any!(self, batch => batch.evaluate(request))
    }
}

/// A call of a routine from Python.
pub struct Request<'a, 'py> {
    pub routine: RoutineKind,
    /// Positions or unknowns.
    pub x: &'a Bound<'py, PyAny>,
    /// Velocities or vectors, if the routine takes any.
    pub v: Option<&'a Bound<'py, PyAny>>,
    pub out: Option<&'a Bound<'py, PyAny>>,
    /// Whether to return the flags of singular inputs.
    pub flags: bool,
}

/// Bound elements of one precision.
pub struct Batch<S> {
    tapes: Tapes<S>,
    /// Each is evaluated by one thread.
    parts: Vec<Part<S>>,
    threads: usize,
    sizes: Sizes,
}

/// Elements that one thread evaluates.
struct Part<S> {
    range: Range<usize>,
    compiled: Option<Box<dyn CompiledBatch<S>>>,
}

impl<S: Precision> Batch<S> {
    /// Elements of the library are compiled code where it exists for the routine, else tapes.
    pub fn new(tapes: Tapes<S>, is_of_library: bool, threads: usize) -> Self {
        let (sizes, name) = (Sizes::of(tapes.element(), tapes.len()), tapes.element().declaration().name.as_ref());
        // Tapes run over whole blocks.
        let size = tapes.len().div_ceil(TAPE_BLOCK).div_ceil(threads).max(1) * TAPE_BLOCK;
        let starts = (0..tapes.len().max(1)).step_by(size);
        let part = |start: usize| {
            let range = start..tapes.len().min(start + size);
            let numbers = |element: usize| tapes.tape().numbers_of(range.start + element);
            let compiled = if is_of_library { bind(name, range.len(), numbers) } else { None };
            Part { range, compiled }
        };
        let parts = starts.map(part).collect();
        Self { tapes, parts, threads, sizes }
    }

    fn dtype(&self) -> &'static str {
        S::DTYPE
    }

    fn evaluate<'py>(&self, request: &Request<'_, 'py>) -> PyResult<Bound<'py, PyAny>> {
        let &Request { routine, x, v, out, flags } = request;
        let py = x.py();
        let name = if self.sizes.unknowns > 0 { "u" } else { "x" };
        let input = |name, value, expected: Shape| {
            let array = array::<S>(name, value)?;
            if array.shape() == &expected[..] {
                Ok(array)
            } else {
                Err(wrong_shape(name, &tuple(&expected), array.shape()))
            }
        };
        let (x, v) = (input(name, x, self.sizes.input())?, v.map(|v| input("v", v, self.sizes.vectors())).transpose()?);
        let (x, v) = (numbers(name, &x)?, v.as_ref().map(|v| numbers("v", v)).transpose()?.unwrap_or(&[]));
        let (slots, used) = self.sizes.slots(routine);
        let arrays = outputs::<S>(py, &slots[..used], out)?;
        let flagged = {
            let mut borrowed = writable(&arrays)?;
            let mut results: Vec<&mut [S]> =
                borrowed.iter_mut().map(|array| array.as_slice_mut().expect("contiguous")).collect();
            let few = results.iter().map(|numbers| numbers.len()).sum::<usize>() < FEW;
            let mut write = || self.write(routine, x, v, &mut results);
            if few { write() } else { py.detach(write) }.map_err(wrong)?
        };
        if !flags && let Some(out) = out {
            return Ok(out.clone());
        }
        let mut list: Vec<Bound<'py, PyAny>> = arrays.into_iter().map(Bound::into_any).collect();
        if flags {
            let mut marks = vec![0_u8; self.tapes.len()];
            for (index, flags) in flagged {
                marks[index] = u8::from(flags.degenerate) + 2 * u8::from(flags.kink);
            }
            list.push(PyArray1::from_vec(py, marks).into_any());
        }
        if list.len() == 1 { Ok(list.remove(0)) } else { Ok(PyTuple::new(py, list)?.into_any()) }
    }

    fn write(
        &self,
        routine: RoutineKind,
        x: &[S],
        v: &[S],
        results: &mut [&mut [S]],
    ) -> Result<Flagged, EvaluateError> {
        if let [part] = &self.parts[..] {
            return self.write_part(part, routine, x, v, results);
        }
        let count = self.tapes.len();
        let mut rest: Vec<&mut [S]> = results.iter_mut().map(|result| &mut **result).collect();
        let found: Vec<_> = std::thread::scope(|scope| {
            let mut running = Vec::with_capacity(self.parts.len());
            for part in &self.parts {
                let Range { start, end } = part.range;
                let of = |numbers: &'_ [S]| numbers.len() / count;
                let (x, v) = (&x[start * of(x)..end * of(x)], &v[start * of(v)..end * of(v)]);
                let mut own = Vec::with_capacity(rest.len());
                let mut others = Vec::with_capacity(rest.len());
                for numbers in rest {
                    let size = numbers.len() / (count - start) * (end - start);
                    let (head, tail) = numbers.split_at_mut(size);
                    own.push(head);
                    others.push(tail);
                }
                rest = others;
                running.push(scope.spawn(move || self.write_part(part, routine, x, v, &mut own)));
            }
            let join = |thread: std::thread::ScopedJoinHandle<'_, _>| thread.join().expect("elements do not panic");
            running.into_iter().map(join).collect()
        });
        let lists: Vec<Flagged> = found.into_iter().collect::<Result<_, _>>()?;
        Ok(lists.concat())
    }

    /// Writes the results of a part, to slices of it alone. Indices of flagged elements count from the first of all.
    fn write_part(
        &self,
        part: &Part<S>,
        routine: RoutineKind,
        x: &[S],
        v: &[S],
        results: &mut [&mut [S]],
    ) -> Result<Flagged, EvaluateError> {
        if let Some(result) = part.compiled.as_ref().and_then(|batch| batch.evaluate(routine, x, v, results)) {
            let mut flagged = result?;
            flagged.iter_mut().for_each(|(element, _)| *element += part.range.start);
            return Ok(flagged);
        }
        let (all, tapes) = (part.range.clone(), &self.tapes);
        match (routine, results) {
            (RoutineKind::Value, [u]) => tapes.values(all, x, u),
            (RoutineKind::Gradient, [u, g]) => tapes.gradients(all, x, u, g),
            (RoutineKind::Hessian, [u, g, h]) => tapes.hessians(all, x, u, g, h),
            (RoutineKind::Vertex(point), [u, g, block]) => tapes.vertices(point, all, x, u, g, block),
            (RoutineKind::HessianVector, [product]) => tapes.hessian_vectors(all, x, v, product),
            (RoutineKind::Force, [f]) => tapes.forces(all, x, v, f),
            (RoutineKind::Jacobians, [f, by_x, by_v]) => tapes.force_jacobians(all, x, v, f, by_x, by_v),
            (RoutineKind::ConstraintJacobian, [c, j]) => tapes.constraints(all, x, c, j),
            (RoutineKind::Residual, [r]) => tapes.residuals(all, x, r),
            (RoutineKind::Jacobian, [r, j]) => tapes.jacobians(all, x, r, j),
            (RoutineKind::Next, [state]) => tapes.next_states(all, x, state),
            (RoutineKind::NextJacobians, [state, by_u, by_s]) => tapes.next_jacobians(all, x, state, by_u, by_s),
            (RoutineKind::StateJacobian, [slopes, by_s]) => tapes.state_jacobians(all, x, slopes, by_s),
            _ => unreachable!("as many slots as results"),
        }
    }
}

/// Sizes of the arrays of one batch.
struct Sizes {
    count: usize,
    points: usize,
    rows: usize,
    /// Numbers that hold the unknowns, if these are flat.
    unknowns: usize,
    /// Coordinates in which the unknowns move.
    increments: usize,
    states: usize,
    /// First derivatives that depend on the state.
    slopes: usize,
    is_mixed: bool,
}

impl Sizes {
    fn of(element: &Interpreted, elements: usize) -> Self {
        let declaration = element.declaration();
        let increments = declaration.increments();
        Self {
            count: elements,
            points: count(element, InputKind::Point) / 3,
            rows: declaration.rows,
            unknowns: count(element, InputKind::Unknown),
            increments,
            states: declaration.state.iter().map(|field| field.size).sum(),
            slopes: if declaration.kind == Kind::Residual { declaration.rows } else { increments },
            is_mixed: declaration.is_mixed(),
        }
    }

    /// Returns the shape of the unknowns.
    fn input(&self) -> Shape {
        match self.unknowns {
            0 => [self.count, self.points, 3].into(),
            unknowns => [self.count, unknowns].into(),
        }
    }

    /// Returns the shape of first derivatives, forces and velocities: by points, or by increments.
    fn vectors(&self) -> Shape {
        match self.is_mixed {
            true => [self.count, self.increments].into(),
            false => [self.count, self.points, 3].into(),
        }
    }

    /// Returns the results of a routine; only the given number of them counts.
    fn slots(&self, routine: RoutineKind) -> ([Slot; 3], usize) {
        let (n, rows, columns, states) = (self.count, self.rows, self.increments, self.states);
        let slot = |name, shape: Shape| Slot { name, shape };
        let (vectors, matrix) = (self.vectors(), Shape::from([n, columns, columns]));
        let state = slot("state", [n, states].into());
        let unused = slot("", [0].into());
        let (energy, gradient) = (slot("U", [n].into()), slot("gradient", vectors));
        let residual = slot("residual", [n, rows].into());
        match routine {
            RoutineKind::Value => ([energy, unused, unused], 1),
            RoutineKind::Gradient => ([energy, gradient, unused], 2),
            RoutineKind::Hessian => ([energy, gradient, slot("Hessian", matrix)], 3),
            RoutineKind::HessianVector => ([slot("product", vectors), unused, unused], 1),
            RoutineKind::Force => ([slot("force", vectors), unused, unused], 1),
            RoutineKind::Jacobians => ([slot("force", vectors), slot("∂f/∂x", matrix), slot("∂f/∂v", matrix)], 3),
            RoutineKind::ConstraintJacobian => {
                ([slot("C", [n, rows].into()), slot("Jacobian", [n, rows, columns].into()), unused], 2)
            }
            RoutineKind::Residual => ([residual, unused, unused], 1),
            RoutineKind::Rest
            | RoutineKind::ReducedHessian
            | RoutineKind::ConstraintHessian
            | RoutineKind::GaussNewton => ([unused; 3], 0),
            RoutineKind::Vertex(_) => ([energy, slot("gradient", [n, 3].into()), slot("block", [n, 3, 3].into())], 3),
            RoutineKind::Jacobian => ([residual, slot("Jacobian", [n, rows, columns].into()), unused], 2),
            RoutineKind::Next => ([state, unused, unused], 1),
            RoutineKind::NextJacobians => {
                let by_unknowns = slot("Jacobian by unknowns", [n, states, columns].into());
                ([state, by_unknowns, slot("Jacobian by state", [n, states, states].into())], 3)
            }
            RoutineKind::StateJacobian => {
                let slopes = slot("slopes", [n, self.slopes].into());
                ([slopes, slot("Jacobian by state", [n, self.slopes, states].into()), unused], 2)
            }
        }
    }
}
