//! Declarations, and their inputs.

use std::sync::{Arc, Mutex, PoisonError};

use energy_compiler::{Budget, Elements as Tapes, InputKind, InputNumbers, Interpreted, Limits};
use energy_dsl::tape::Column;
use energy_dsl::{Declaration, RoutineKind};
use numpy::{PyArrayDescr, PyArrayDescrMethods, PyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt, PyString, PyTuple};

use crate::arrays::{Given, Precision, tuple, wrong_shape};
use crate::errors::wrong;
use crate::evaluation::{Batch, Elements, Request};
use crate::interrupt::compiled;
use crate::limits::limits_of;

/// An input of an element.
#[pyclass(frozen, get_all, module = "energy_dsl")]
pub struct Input {
    /// Name, as declared.
    name: String,
    /// `point`, `unknown`, `rest` or `parameter`.
    kind: &'static str,
    /// Shape of the numbers of one element; `()` for a scalar.
    shape: Vec<usize>,
    /// Unit, as declared; empty if none was given.
    unit: String,
}

#[pymethods]
impl Input {
    #[new]
    fn new(name: String, kind: &str, shape: Vec<usize>, unit: String) -> PyResult<Self> {
        let kinds = [InputKind::Point, InputKind::Unknown, InputKind::Rest, InputKind::Parameter].map(keyword);
        let known = kinds.into_iter().find(|known| *known == kind);
        let message = || format!("kind: expected one of {}, got {kind:?}", kinds.join(", "));
        Ok(Self { name, kind: known.ok_or_else(|| PyValueError::new_err(message()))?, shape, unit })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let arguments = (&self.name, self.kind, &self.shape, &self.unit).into_pyobject(py)?;
        Ok((py.get_type::<Self>().into_any(), arguments))
    }

    fn __eq__(&self, other: &Self) -> bool {
        (&self.name, self.kind, &self.shape, &self.unit) == (&other.name, other.kind, &other.shape, &other.unit)
    }

    fn __repr__(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" [{}]", self.unit) };
        format!("<{} {} {}{unit}>", self.kind, self.name, tuple(&self.shape))
    }
}

/// A declared energy, force, constraint or residual.
#[pyclass(frozen, module = "energy_dsl")]
#[derive(Clone)]
pub struct Element {
    pub inner: Interpreted,
    pub origin: Origin,
    last_call: Arc<Mutex<Option<BoundCall>>>,
}

/// The origin of an element. Pickles hold this.
#[derive(Clone)]
pub enum Origin {
    /// The library, which has compiled code for it.
    Library,
    /// A text, and the number of the declaration.
    Text(Arc<Text>, usize),
}

/// A text, the file for messages, and the limits within which it was compiled.
pub struct Text {
    text: String,
    file: String,
    limits: Limits,
}

impl Origin {
    pub fn is_library(&self) -> bool {
        matches!(self, Self::Library)
    }
}

/// A call whose inputs were numbers of Python, with its elements. Newton's method repeats such calls, and binding takes
/// longer than evaluating a few elements.
struct BoundCall {
    count: usize,
    single: bool,
    /// Rest shapes and parameters, in declared order.
    numbers: Vec<f64>,
    elements: Arc<Elements>,
}

impl BoundCall {
    /// Elements of one kept call.
    const MOST: usize = 64;
}

/// Compiles all declarations of a text.
#[pyfunction]
#[pyo3(signature = (text, file = "<text>", *, limits = None))]
pub fn energies(py: Python<'_>, text: &str, file: &str, limits: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Element>> {
    let limits = limits_of(limits)?;
    let elements = compiled(py, limits, |budget| Interpreted::from_file_within(text, file, budget))?;
    let text = Arc::new(Text { text: text.to_owned(), file: file.to_owned(), limits });
    let element = |(number, inner)| Element::new(inner, Origin::Text(Arc::clone(&text), number));
    Ok(elements.into_iter().enumerate().map(element).collect())
}

/// Returns the declarations of the library.
fn library() -> impl Iterator<Item = &'static Declaration> {
    energy_elements::DECLARATIONS.iter().chain(energy_elements::MIXED).copied()
}

/// Returns the names of the elements of the library, in alphabetical order.
#[pyfunction]
pub fn catalogue() -> Vec<&'static str> {
    let mut names: Vec<&str> = library().map(|declaration| &*declaration.name).collect();
    names.sort_unstable();
    names
}

/// Returns an element of the library; `None` if it has no such element. Its energies, forces and residuals run as
/// compiled code; with `vertices`, it has routines of single vertices, which run as tapes.
#[pyfunction]
pub fn library_element(py: Python<'_>, name: &str, vertices: bool) -> PyResult<Option<Element>> {
    let Some(declaration) = library().find(|declaration| declaration.name == name) else {
        return Ok(None);
    };
    let compile = || match vertices {
        true => Interpreted::from_file_with_vertices(&declaration.source, name, &Budget::default()),
        false => Interpreted::from_source(&declaration.source),
    };
    let mut elements = py.detach(|| compile().map_err(|errors| errors.to_string())).map_err(wrong)?;
    Ok(elements.pop().map(|inner| Element::new(inner, Origin::Library)))
}

#[pymethods]
impl Element {
    #[getter]
    fn name(&self) -> &str {
        &self.inner.declaration().name
    }

    /// `energy`, `force`, `constraint` or `residual`.
    #[getter]
    fn kind(&self) -> &'static str {
        self.inner.declaration().kind.keyword()
    }

    #[getter]
    fn formula(&self) -> &str {
        &self.inner.declaration().formula
    }

    /// The text of the declaration.
    #[getter]
    fn source(&self) -> &str {
        &self.inner.declaration().source
    }

    /// Description, formula, shapes and units.
    #[getter]
    fn description(&self) -> String {
        let declaration = self.inner.declaration();
        let inputs = self.inner.inputs().iter().map(|input| {
            let unit = if input.unit.is_empty() { String::new() } else { format!(", in {}", input.unit) };
            format!("  {}: {} of shape {}{unit}\n", input.name, keyword(input.kind), tuple(&input.shape))
        });
        format!(
            "{}\n\n{}\n\nInputs of one element:\n{}",
            declaration.docs,
            declaration.formula,
            inputs.collect::<String>()
        )
    }

    #[getter]
    fn inputs(&self) -> Vec<Input> {
        let input = |input: &InputNumbers| Input {
            name: input.name.clone(),
            kind: keyword(input.kind),
            shape: input.shape.clone(),
            unit: input.unit.clone(),
        };
        self.inner.inputs().iter().map(input).collect()
    }

    /// Number of points of one element; 0 if its unknowns are flat.
    #[getter]
    fn points(&self) -> usize {
        self.point_count()
    }

    /// Count of numbers of the unknowns, if they are flat: those of a residual, or unknowns that are not only points.
    #[getter]
    fn unknowns(&self) -> usize {
        self.unknown_count()
    }

    /// Count of coordinates in which the unknowns move: the columns of derivatives. A rotation has four numbers and three
    /// increments.
    #[getter]
    fn increments(&self) -> usize {
        self.inner.declaration().increments()
    }

    /// Names of the inputs that are the state of an element, which `next` updates.
    #[getter]
    fn state(&self) -> Vec<String> {
        self.inner.declaration().state.iter().map(|field| field.name.to_string()).collect()
    }

    fn __repr__(&self) -> String {
        let inputs = self.inner.inputs().iter().map(|input| input.name.as_str()).collect::<Vec<_>>().join(", ");
        format!("<{} {}({inputs})>", self.kind(), self.name())
    }

    /// Binds rest shapes and parameters of `count` elements: one value for all, or one for each along the first axis.
    /// They are evaluated in `dtype`: float64 (the default) or float32, by up to `threads` threads. Results do not
    /// depend on the number of threads. Each thread takes 64 elements or more, and costs about 30 µs in each call.
    #[pyo3(signature = (count, dtype = None, *, threads = 1, **inputs))]
    fn bind(
        &self,
        py: Python<'_>,
        count: usize,
        dtype: Option<&Bound<'_, PyAny>>,
        threads: usize,
        inputs: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Elements> {
        let single = match dtype {
            None => false,
            Some(dtype) => {
                let found = PyArrayDescr::new(py, dtype)?;
                match [numpy::dtype::<f64>(py), numpy::dtype::<f32>(py)].map(|wanted| found.is_equiv_to(&wanted)) {
                    [true, _] => false,
                    [_, true] => true,
                    _ => return Err(PyTypeError::new_err(format!("dtype: expected float64 or float32, got {found}"))),
                }
            }
        };
        if threads == 0 {
            return Err(PyValueError::new_err("threads: expected at least 1, got 0"));
        }
        Ok(self.bound(py, count, single, threads, inputs)?.with_inputs(copied(py, inputs)?))
    }

    /// Pickles hold the text, or the name of an element of the library.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let package = py.import("energy_dsl")?;
        Ok(match &self.origin {
            Origin::Library if self.has_vertices() => {
                (package.getattr("element")?, (self.name(), true).into_pyobject(py)?)
            }
            Origin::Library => (package.getattr("element")?, (self.name(),).into_pyobject(py)?),
            Origin::Text(text, number) => {
                let Text { text, file, limits } = &**text;
                let arguments = (text, file, *number, limits.steps, limits.bytes);
                (package.getattr("_declared")?, arguments.into_pyobject(py)?)
            }
        })
    }

    /// Elements do not change, so copies are the same object.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// Copies inputs: numbers unchanged, everything else as a new array.
pub fn copied(py: Python<'_>, inputs: Option<&Bound<'_, PyDict>>) -> PyResult<Py<PyDict>> {
    let (copies, numpy) = (PyDict::new(py), py.import("numpy")?);
    for (name, value) in inputs.into_iter().flatten() {
        let is_number = value.cast::<PyFloat>().is_ok() || value.cast::<PyInt>().is_ok();
        copies.set_item(name, if is_number { value } else { numpy.call_method1("array", (value,))? })?;
    }
    Ok(copies.unbind())
}

impl Element {
    pub fn new(inner: Interpreted, origin: Origin) -> Self {
        Self { inner, origin, last_call: Arc::default() }
    }

    pub fn point_count(&self) -> usize {
        count(&self.inner, InputKind::Point) / 3
    }

    pub fn unknown_count(&self) -> usize {
        count(&self.inner, InputKind::Unknown)
    }

    /// Returns the number of vertices whose coordinates are the unknowns of one element.
    pub fn vertices_of_one(&self) -> PyResult<usize> {
        let declaration = self.inner.declaration();
        let (name, unknowns) = (&declaration.name, self.unknown_count());
        if declaration.is_mixed() || unknowns > 0 && unknowns != declaration.increments() {
            let message = format!(
                "{name}: a system moves vertices, and the unknowns of this {} are not only points of its own",
                declaration.kind.keyword()
            );
            return Err(PyTypeError::new_err(message));
        }
        if unknowns.is_multiple_of(3) {
            return Ok(if unknowns > 0 { unknowns / 3 } else { self.point_count() });
        }
        Err(PyTypeError::new_err(format!("{name}: expected three unknowns for each vertex, got {unknowns} unknowns")))
    }

    /// Binds inputs as tapes of one precision.
    pub fn tapes<S: Precision>(
        &self,
        py: Python<'_>,
        count: usize,
        inputs: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Tapes<S>> {
        let columns = Columns::<S>::new(self, count, inputs)?;
        let (rest, parameters) = (columns.of(InputKind::Rest)?, columns.of(InputKind::Parameter)?);
        let bind = || self.inner.elements(count, &rest, &parameters);
        // Releasing the interpreter's lock takes longer than binding a few elements.
        if count <= BoundCall::MOST { bind() } else { py.detach(bind) }.map_err(wrong)
    }

    fn bound(
        &self,
        py: Python<'_>,
        count: usize,
        single: bool,
        threads: usize,
        inputs: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Elements> {
        let origin = self.origin.clone();
        let library = origin.is_library();
        Ok(match single {
            true => Elements::single(Batch::new(self.tapes(py, count, inputs)?, library, threads), origin),
            false => Elements::double(Batch::new(self.tapes(py, count, inputs)?, library, threads), origin),
        })
    }

    /// Binds inputs for one call: as many elements as the first axis of `x` has, in single precision if `x` is.
    fn bound_for(&self, x: &Bound<'_, PyAny>, inputs: Option<&Bound<'_, PyDict>>) -> PyResult<Arc<Elements>> {
        let single = x.cast::<PyArrayDyn<f32>>().is_ok();
        let count = match x.cast::<PyUntypedArray>() {
            Ok(x) => x.shape().first().copied().unwrap_or(0),
            Err(_) => x.len().unwrap_or(0),
        };
        let bind = || Ok(Arc::new(self.bound(x.py(), count, single, 1, inputs)?));
        let Some(numbers) = self.numbers(inputs).filter(|_| count <= BoundCall::MOST) else { return bind() };
        let mut last = self.last_call.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(call) = last.as_ref()
            && (call.count, call.single) == (count, single)
            && call.numbers.iter().map(|x| x.to_bits()).eq(numbers.iter().map(|x| x.to_bits()))
        {
            return Ok(Arc::clone(&call.elements));
        }
        let elements = bind()?;
        *last = Some(BoundCall { count, single, numbers, elements: Arc::clone(&elements) });
        Ok(elements)
    }

    /// Returns the rest shapes and parameters; `None` unless they are complete, in declared order, and all `float`.
    fn numbers(&self, given: Option<&Bound<'_, PyDict>>) -> Option<Vec<f64>> {
        let mut inputs = self.inner.inputs().iter().filter(|input| is_bound(input.kind));
        let mut numbers = Vec::with_capacity(given.map_or(0, |given| given.len()));
        for (name, value) in given.into_iter().flatten() {
            let is_next = name.cast::<PyString>().ok()?.to_str().ok()? == inputs.next()?.name;
            numbers.push(value.cast::<PyFloat>().ok().filter(|_| is_next)?.value());
        }
        inputs.next().is_none().then_some(numbers)
    }
}

/// Returns the numbers of all inputs of a kind.
pub fn count(element: &Interpreted, kind: InputKind) -> usize {
    element.inputs().iter().filter(|input| input.kind == kind).map(InputNumbers::size).sum()
}

macro_rules! evaluations {
    ($($(#[$doc:meta])* $name:ident($x:ident $(, $v:ident)?) => $routine:ident;)*) => {
        #[pymethods]
        impl Element {
            $($(#[$doc])*
            #[pyo3(signature = ($x, $($v,)? *, out = None, flags = false, **inputs))]
            fn $name<'py>(
                &self,
                $x: &Bound<'py, PyAny>,
                $($v: &Bound<'py, PyAny>,)?
                out: Option<&Bound<'py, PyAny>>,
                flags: bool,
                inputs: Option<&Bound<'py, PyDict>>,
            ) -> PyResult<Bound<'py, PyAny>> {
                let (routine, v) = (RoutineKind::$routine, evaluations!(@v $($v)?));
                self.bound_for($x, inputs)?.evaluate(&Request { routine, x: $x, v, out, flags })
            })*
        }

        #[pymethods]
        impl Elements {
            $($(#[$doc])*
            #[pyo3(signature = ($x, $($v,)? *, out = None, flags = false))]
            fn $name<'py>(
                &self,
                $x: &Bound<'py, PyAny>,
                $($v: &Bound<'py, PyAny>,)?
                out: Option<&Bound<'py, PyAny>>,
                flags: bool,
            ) -> PyResult<Bound<'py, PyAny>> {
                let (routine, v) = (RoutineKind::$routine, evaluations!(@v $($v)?));
                self.evaluate(&Request { routine, x: $x, v, out, flags })
            })*
        }
    };
    (@v) => { None };
    (@v $v:ident) => { Some($v) };
}

evaluations! {
    /// Returns U, of shape (n,).
    value(x) => Value;
    /// Returns U and ∂U/∂x, of shape (n, points, 3).
    gradient(x) => Gradient;
    /// Returns U, ∂U/∂x and ∂²U/∂x², of shape (n, 3 points, 3 points).
    hessian(x) => Hessian;
    /// Returns (∂²U/∂x²) v, of shape (n, points, 3).
    hessian_vector(x, v) => HessianVector;
    /// Returns f(x, v), of shape (n, points, 3).
    force(x, v) => Force;
    /// Returns f, ∂f/∂x and ∂f/∂v; the last two of shape (n, 3 points, 3 points).
    force_jacobians(x, v) => Jacobians;
    /// Returns C, of shape (n, rows), and ∂C/∂x, of shape (n, rows, 3 points).
    constraint(x) => ConstraintJacobian;
    /// Returns r(u), of shape (n, rows), for unknowns of shape (n, unknowns).
    residual(u) => Residual;
    /// Returns r and ∂r/∂u, of shape (n, rows, increments).
    jacobian(u) => Jacobian;
    /// Returns the state after a step that ends at u, of shape (n, states).
    next(u) => Next;
    /// Returns the state after a step, and its derivatives by the unknowns and by the state before, of shape
    /// (n, states, increments) and (n, states, states).
    next_jacobians(u) => NextJacobians;
    /// Returns ∂U/∂u, of shape (n, increments), and ∂²U/∂u∂(state), of shape (n, increments, states); of a residual r and
    /// ∂r/∂(state).
    state_jacobian(u) => StateJacobian;
}

#[pymethods]
impl Element {
    /// Returns U, of shape (n,), and its derivatives by one point of each element: of shape (n, 3) and (n, 3, 3).
    #[pyo3(signature = (x, point, *, out = None, flags = false, **inputs))]
    fn vertex<'py>(
        &self,
        x: &Bound<'py, PyAny>,
        point: usize,
        out: Option<&Bound<'py, PyAny>>,
        flags: bool,
        inputs: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let routine = self.vertex_routine(point)?;
        self.bound_for(x, inputs)?.evaluate(&Request { routine, x, v: None, out, flags })
    }
}

#[pymethods]
impl Elements {
    /// Returns U, of shape (n,), and its derivatives by one point of each element: of shape (n, 3) and (n, 3, 3).
    #[pyo3(signature = (x, point, *, out = None, flags = false))]
    fn vertex<'py>(
        &self,
        x: &Bound<'py, PyAny>,
        point: usize,
        out: Option<&Bound<'py, PyAny>>,
        flags: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let routine = self.declared().vertex_routine(point)?;
        self.evaluate(&Request { routine, x, v: None, out, flags })
    }
}

impl Element {
    /// Returns the routine of a point.
    fn vertex_routine(&self, point: usize) -> PyResult<RoutineKind> {
        let (name, points) = (self.name(), self.point_count());
        let routine = u8::try_from(point).ok().filter(|_| point < points).map(RoutineKind::Vertex);
        let message = || format!("point: expected less than {points}, the number of points of {name}, got {point}");
        let routine = routine.ok_or_else(|| PyIndexError::new_err(message()))?;
        if self.has_vertices() {
            return Ok(routine);
        }
        let remedy = match self.origin {
            _ if !matches!(self.kind(), "energy" | "constraint") => {
                "only energies and constraints have them".to_owned()
            }
            Origin::Library => format!("get it by element(\"{name}\", vertices=True)"),
            Origin::Text(..) => format!("declare it as `#[vertex] {} {name}`", self.kind()),
        };
        Err(PyValueError::new_err(format!("{name} has no routines of single vertices: {remedy}")))
    }

    /// Returns whether it has routines of single vertices.
    fn has_vertices(&self) -> bool {
        self.inner.routines().has(RoutineKind::Vertex(0))
    }
}

/// Returns whether inputs of this kind are bound before elements are evaluated.
fn is_bound(kind: InputKind) -> bool {
    matches!(kind, InputKind::Rest | InputKind::Parameter)
}

fn keyword(kind: InputKind) -> &'static str {
    match kind {
        InputKind::Point => "point",
        InputKind::Unknown => "unknown",
        InputKind::Rest => "rest",
        InputKind::Parameter => "parameter",
    }
}

/// The numbers of the inputs that elements are bound to.
struct Columns<'a, 'py, S: Precision> {
    element: &'a Interpreted,
    count: usize,
    /// In the order of the inputs; `None` for points.
    given: Vec<Option<Given<'py, S>>>,
}

impl<'a, 'py, S: Precision> Columns<'a, 'py, S> {
    fn new(element: &'a Element, count: usize, given: Option<&Bound<'py, PyDict>>) -> PyResult<Self> {
        let (name, inputs) = (element.name(), element.inner.inputs());
        let wanted = || {
            let names: Vec<&str> =
                inputs.iter().filter(|i| is_bound(i.kind)).map(|input| input.name.as_str()).collect();
            if names.is_empty() { "none".to_owned() } else { names.join(", ") }
        };
        let (mut columns, mut used) = (Vec::with_capacity(inputs.len()), 0);
        for input in inputs {
            if !is_bound(input.kind) {
                columns.push(None);
                continue;
            }
            let Some(value) = given.map(|given| given.get_item(&input.name)).transpose()?.flatten() else {
                let kind = keyword(input.kind);
                let message = format!("{name}: missing {kind} `{}`; expected {}", input.name, wanted());
                return Err(PyTypeError::new_err(message));
            };
            columns.push(Some(Given::new(&input.name, &value)?));
            used += 1;
        }
        if let Some(given) = given.filter(|given| given.len() > used) {
            let known = |key: &str| inputs.iter().any(|input| is_bound(input.kind) && input.name == key);
            let keys: Vec<String> = given.keys().extract()?;
            let unknown = keys.into_iter().find(|key| !known(key)).unwrap_or_default();
            let message = format!("{name}: no input `{unknown}` to bind; expected {}", wanted());
            return Err(PyTypeError::new_err(message));
        }
        Ok(Self { element: &element.inner, count, given: columns })
    }

    fn of(&self, kind: InputKind) -> PyResult<Vec<Column<'_, S>>> {
        let inputs = self.element.inputs().iter().zip(&self.given).filter(|(input, _)| input.kind == kind);
        inputs
            .map(|(input, given)| {
                let given = given.as_ref().expect("checked");
                let (data, shape) = (given.numbers(&input.name)?, given.shape());
                if shape == input.shape {
                    return Ok(Column::Same(data));
                }
                if shape.split_first() == Some((&self.count, &input.shape)) {
                    return Ok(Column::Each(data));
                }
                let each = [&[self.count], &input.shape[..]].concat();
                let expected = format!("{} or {}", tuple(&input.shape), tuple(&each));
                Err(wrong_shape(&input.name, &expected, shape))
            })
            .collect()
    }
}
